//! Builds that are killed resume, and leave the very bytes of a build that was not; threads and processes change nothing.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::common::{Folder, tree};

fn blocks(root: &Path) -> usize {
    let folder = root.join("blocks");
    if folder.is_dir() { tree(&folder).len() } else { 0 }
}

#[test]
fn a_killed_build_resumes_to_the_same_bytes() {
    let f = Folder::new();
    f.ok(&["build", "experiment.toml", "--store", "whole", "--threads", "1"]);
    let whole = tree(&f.path("whole"));
    let n = whole.len();
    assert!(n > 10, "{n} blocks");
    let mut killed = 0;
    for target in [n / 5, n / 2, 4 * n / 5] {
        let mut child = f.command(&["build", "experiment.toml", "--store", "torn"]).spawn().unwrap();
        let start = Instant::now();
        while blocks(&f.path("torn")) < target && start.elapsed() < Duration::from_secs(120) {
            if child.try_wait().unwrap().is_some() {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        // SIGKILL: nothing is cleaned up.
        child.kill().unwrap();
        killed += usize::from(!child.wait().unwrap().success());
    }
    assert!(killed > 0, "the build was never caught at work");
    f.ok(&["build", "experiment.toml", "--store", "torn", "--threads", "2"]);
    let torn = tree(&f.path("torn"));
    assert_eq!(torn.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
    assert!(torn == whole, "some block differs");
}

#[test]
fn two_processes_share_a_store() {
    let f = Folder::new();
    let mut both = [0, 1].map(|_| f.command(&["build", "experiment.toml", "--store", "shared"]).spawn().unwrap());
    both.iter_mut().for_each(|c| assert!(c.wait().unwrap().success()));
    f.ok(&["build", "experiment.toml", "--store", "own"]);
    assert!(tree(&f.path("shared")) == tree(&f.path("own")));
}

#[test]
fn a_damaged_block_is_reported_and_built_again() {
    let f = Folder::new();
    f.ok(&["build", "experiment.toml", "--store", "store"]);
    let whole = tree(&f.path("store"));
    for (name, bytes) in whole.iter().step_by(7) {
        let mut bad = bytes.clone();
        let middle = bad.len() / 2;
        bad[middle] ^= 1;
        std::fs::write(f.path("store").join(name), bad).unwrap();
    }
    let out = f.run(&["build", "experiment.toml", "--store", "store"]);
    assert!(out.status.success());
    assert!(String::from_utf8_lossy(&out.stderr).contains("is damaged"));
    let out = f.run(&["run", "experiment.toml", "--store", "store", "--out", "results"]);
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success() && !said.contains("is damaged"), "{said}");
}

#[test]
fn an_interrupted_build_says_so_ends_with_1_and_goes_on() {
    let f = Folder::new();
    let caught = (0..5).any(|i| {
        let store = format!("store{i}");
        let mut command = f.command(&["build", "experiment.toml", "--store", &store, "--threads", "1"]);
        let child = command.stderr(std::process::Stdio::piped()).stdout(std::process::Stdio::null()).spawn().unwrap();
        let start = Instant::now();
        while blocks(&f.path(&store)) < 2 && start.elapsed() < Duration::from_secs(120) {
            std::thread::sleep(Duration::from_millis(1));
        }
        // The shell's own: a bare machine has no other `kill`.
        let interrupt = format!("kill -INT {}", child.id());
        let sent = std::process::Command::new("sh").args(["-c", &interrupt]).status().unwrap();
        let out = child.wait_with_output().unwrap();
        if !sent.success() || out.status.success() {
            return false;
        }
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.code() == Some(1) && said.contains("stopped"), "{:?} {said}", out.status);
        f.ok(&["build", "experiment.toml", "--store", &store]);
        true
    });
    assert!(caught, "the build was never caught at work");
}
