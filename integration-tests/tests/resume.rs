//! Builds that are killed with SIGKILL resume and leave the very bytes of one that was not; so do builds on one and on two threads;
//! blocks that were flipped or cut are named and built again.
//!
//! The build runs in a process of its own: this test program, told by its environment to be a builder (`cli/tests/resume.rs` does the
//! like with the command itself). Only processes that were started here are killed, through their handles.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use farfield_experiments::config::{self, BackendName};
use farfield_experiments::run::{self, Options};
use farfield_experiments::walk::Opened;
use farfield_integration_tests::lab::{Lab, told};
use farfield_integration_tests::stones;

const PIPELINES: &str = r#"
[[pipeline]]
name = "hybrid"
partition = { type = "hex-cells", edge = 3.0 }
far_field = { type = "textured-lod-mesh", edge_px = 1.0 }
[[pipeline]]
name = "several views"
partition = { type = "hex-cells", edge = 3.0 }
far_field = { type = "textured-lod-mesh", edge_px = 1.0, view_test = { type = "self-occlusion", max_px = 0.0 } }
[[pipeline]]
name = "levels of the whole scene"
far_field = { type = "point-polygon-hlod", node_triangles = 200, resolution = 64.0 }
"#;

const STORE: &str = "FARFIELD_TEST_BUILDS_INTO";

/// Not a test where [`STORE`] is not set: the builder that the tests below start.
#[test]
fn builder() {
    let Some(store) = std::env::var_os(STORE).map(PathBuf::from) else { return };
    let file = store.parent().unwrap().join("experiment.toml");
    let experiment =
        config::load(&file, &[], &farfield_experiments::list::entries()).unwrap_or_else(|f| panic!("{}", told(&f)));
    let cancel = AtomicBool::new(false);
    let options = Options { store, quiet: true, cancel: &cancel, say: &|line| eprintln!("{line}") };
    run::build(&experiment, &options).unwrap_or_else(|f| panic!("{}", told(&f)));
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let dir = stones::folder();
        let text = stones::experiment([256, 256], PIPELINES);
        std::fs::write(dir.path().join("experiment.toml"), text).unwrap();
        Self(dir)
    }

    fn store(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn start(&self, store: &str, threads: usize) -> Child {
        let mut c = Command::new(std::env::current_exe().unwrap());
        c.args(["--exact", "builder", "--nocapture"]).env(STORE, self.store(store));
        c.env("RAYON_NUM_THREADS", threads.to_string()).stdout(Stdio::null()).stderr(Stdio::piped());
        c.spawn().unwrap()
    }

    /// A build to its end; what it said.
    fn build(&self, store: &str, threads: usize) -> String {
        let out = self.start(store, threads).wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success(), "{said}");
        said
    }
}

/// Every file of a store with its bytes.
fn tree(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut out, mut folders) = (BTreeMap::new(), vec![root.to_owned()]);
    while let Some(f) = folders.pop() {
        for e in std::fs::read_dir(f).into_iter().flatten().flatten() {
            match e.path() {
                p if p.is_dir() => folders.push(p),
                // What a running build has just renamed is found at its new place.
                p => _ = std::fs::read(&p).map(|b| out.insert(p.strip_prefix(root).unwrap().to_owned(), b)),
            }
        }
    }
    out
}

/// Kills a process that was started here.
fn kill(mut child: Child) -> bool {
    assert!(i32::try_from(child.id()).is_ok_and(|pid| pid > 1), "{} is no process of ours", child.id());
    child.kill().unwrap();
    !child.wait().unwrap().success()
}

#[test]
fn a_build_killed_again_and_again_ends_with_the_bytes_of_one_that_was_not() {
    let f = Folder::new();
    f.build("whole", 2);
    let whole = tree(&f.store("whole"));
    assert!(whole.len() > 20, "{} blocks", whole.len());
    let (mut killed, mut torn) = (0, vec![]);
    for (eighths, then_ms) in [(0, 30), (1, 0), (2, 7), (4, 1), (6, 3)] {
        let (child, start) = (f.start("torn", 2), Instant::now());
        let blocks = || tree(&f.store("torn")).len();
        while blocks() < whole.len() * eighths / 8 && start.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(2));
        }
        std::thread::sleep(Duration::from_millis(then_ms));
        killed += usize::from(kill(child));
        torn.push(blocks());
    }
    println!("{} blocks; killed {killed} times, left with {torn:?}", whole.len());
    assert!(killed >= 3 && torn.iter().any(|&n| n > 0 && n < whole.len()), "never caught at work: {torn:?}");
    f.build("torn", 2);
    same(&tree(&f.store("torn")), &whole);
}

#[track_caller]
fn same(found: &BTreeMap<PathBuf, Vec<u8>>, whole: &BTreeMap<PathBuf, Vec<u8>>) {
    assert_eq!(found.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>(), "other blocks");
    let differ: Vec<&PathBuf> = whole.iter().filter(|(k, v)| found[*k] != **v).map(|(k, _)| k).collect();
    assert!(differ.is_empty(), "blocks that differ: {differ:?}");
}

#[test]
fn one_thread_and_two_leave_the_same_bytes() {
    let f = Folder::new();
    f.build("one", 1);
    f.build("two", 2);
    same(&tree(&f.store("two")), &tree(&f.store("one")));
}

/// What only frames depend on is no part of a key: another bound on the error on screen draws other nodes of the same bake.
#[test]
fn a_sweep_of_a_frame_setting_does_not_bake_again() {
    let folder = stones::folder();
    let one = |max_px: f64| {
        format!(
            "[[pipeline]]\nname = \"{max_px}\"\nbackend = \"cpu\"\n\
             far_field = {{ type = \"static-lod\", max_px = {max_px:?}, max_albedo_off = 64 }}\n"
        )
    };
    let text = stones::experiment([160, 120], &(one(0.5) + &one(64.0)));
    let lab = Lab::new(&text, folder.path()).unwrap();
    let built = |i: usize| {
        let what = |o: &Opened<'_>| (o.built.shared.as_ref().map(|s| s.0), o.built.preprocess.seconds);
        lab.with(i, what).unwrap()
    };
    let (first, second) = (built(0), built(1));
    assert!(first.0.is_some() && first.1 > 0.0, "nothing is baked: {first:?}");
    assert_eq!(second, (first.0, 0.0), "it is baked again");
    let mut device = lab.device(BackendName::Cpu).unwrap();
    let mut drawn = |i: usize| {
        let frames = lab.frames(i, &[0, 1, 3], &mut device).unwrap();
        frames.iter().map(|f| f.near_triangles + f.far_triangles).sum::<u64>()
    };
    let (fine, coarse) = (drawn(0), drawn(1));
    assert!(0 < coarse && coarse < fine, "{coarse} triangles at 64 px, {fine} at half a pixel");
}

#[test]
fn flipped_and_cut_blocks_are_named_and_built_again() {
    let f = Folder::new();
    f.build("store", 2);
    let whole = tree(&f.store("store"));
    let mut damaged = vec![];
    for (i, (name, bytes)) in whole.iter().enumerate().step_by(5) {
        let mut bad = bytes.clone();
        match i % 3 {
            0 => bad[bytes.len() / 2] ^= 1,
            1 => bad.truncate(bytes.len() / 2),
            _ => bad.clear(),
        }
        std::fs::write(f.store("store").join(name), bad).unwrap();
        damaged.push(name);
    }
    let said = f.build("store", 2);
    for name in &damaged {
        let line = said.lines().find(|l| l.contains(&*name.to_string_lossy()));
        assert!(line.is_some_and(|l| l.contains("is damaged")), "{} is not named: {said}", name.display());
    }
    same(&tree(&f.store("store")), &whole);
    assert!(!f.build("store", 2).contains("is damaged"));
}
