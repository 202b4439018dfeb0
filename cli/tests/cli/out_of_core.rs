//! Models larger than memory, as their users run them: under a limit of the system's, and with the same pictures.

use std::process::Command;

use crate::common::{Folder, tree};

/// An asteroid in a file, and an experiment over it.
fn asteroid(triangles: &str) -> Folder {
    let f = Folder::new();
    f.ok(&["scene", "asteroid", "--triangles", triangles, "--out", "asteroid.ply"]);
    std::fs::write(f.path("asteroid.toml"), EXPERIMENT).unwrap();
    f
}

const EXPERIMENT: &str = r#"
[scene]
path = "asteroid.ply"
two_sided = false

[view]
resolution = 128
path = "orbit"
frames = 8

[[pipeline]]
name = "all geometry"
backend = "cpu"
far_field = { type = "geometry" }
"#;

#[test]
fn pictures_and_stored_bytes_are_those_of_the_scene_in_memory() {
    let f = asteroid("100000");
    for (name, how) in [("held", "false"), ("disk", "true")] {
        let set = format!("scene.out_of_core={how}");
        let mut args =
            vec!["render", "asteroid.toml", "--set", &set, "--set", "scene.memory_bytes=16777216", "--store", name];
        let pipeline = ["--pipeline", "all geometry", "--frame", "5"];
        args.extend(pipeline);
        let png = format!("{name}.png");
        args.extend(["--out", &png]);
        f.ok(&args);
    }
    let picture = |name: &str| std::fs::read(f.path(name)).unwrap();
    assert!(picture("held.png") == picture("disk.png"));
    let decoded = image::open(f.path("disk.png")).unwrap().into_rgb8();
    let stone = decoded.pixels().filter(|p| ![[150, 185, 225], [86, 112, 68]].contains(&p.0)).count();
    assert!((4000..12_000).contains(&stone), "{stone} of 16,384 pixels are neither sky nor ground");
    // What is built of either is the same: the textured far field of the spheres, whose model is an OBJ.
    f.ok(&["build", "experiment.toml", "--store", "a", "--set", "scene.out_of_core=false"]);
    f.ok(&["build", "experiment.toml", "--store", "b", "--set", "scene.out_of_core=true"]);
    let (a, mut b) = (tree(&f.path("a")), tree(&f.path("b")));
    let scenes: Vec<_> = b.keys().filter(|k| k.starts_with("scenes")).cloned().collect();
    assert_eq!(scenes.len(), 1);
    scenes.iter().for_each(|s| _ = b.remove(s));
    // A store may remember the model's digest, too, once the file is old enough.
    assert!(a.len() > 10 && a.iter().all(|(name, bytes)| b.get(name) == Some(bytes)));
    assert!(b.len() <= a.len() + 1, "{} blocks more", b.len() - a.len());
}

#[test]
fn a_damaged_chunk_is_named_and_nothing_is_drawn() {
    let f = asteroid("100000");
    let args = |out: &'static str| {
        let mut args = vec!["render", "asteroid.toml", "--pipeline", "all geometry", "--frame", "0", "--out", out];
        args.extend(["--set", "scene.out_of_core=true"]);
        args
    };
    f.ok(&args("good.png"));
    let file = std::fs::read_dir(f.path("store/scenes")).unwrap().next().unwrap().unwrap().path();
    let mut bytes = std::fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(&file, &bytes).unwrap();
    let (code, said) = f.fails(&args("bad.png"));
    assert_eq!(code, 1, "{said}");
    let flat = said.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", "");
    for part in ["chunk ", "mesh \"ply\"", "checksum", "read twice"] {
        assert!(flat.contains(part), "{part}: {flat}");
    }
    assert!(!f.path("bad.png").exists());
    // Half a file is seen when it is opened, and made anew.
    std::fs::write(&file, &bytes[..middle]).unwrap();
    let out = f.run(&args("again.png"));
    let told = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success() && told.contains("truncated; it is made anew"), "{told}");
    assert!(std::fs::read(f.path("again.png")).unwrap() == std::fs::read(f.path("good.png")).unwrap());
}

/// The command where its data may take 256 MB and no more (RLIMIT_DATA: heap, private mappings, stacks of threads).
#[cfg(target_os = "linux")]
fn limited(f: &Folder, out_of_core: bool) -> std::process::Output {
    let mut c = Command::new("sh");
    c.current_dir(f.0.path()).args(["-c", "ulimit -d 262144 && exec \"$@\"", "sh", env!("CARGO_BIN_EXE_farfield")]);
    c.args(["build", "asteroid.toml", "--quiet", "--threads", "2", "--set", "scene.memory_bytes=134217728"]);
    c.args(["--set", &format!("scene.out_of_core={out_of_core}")]);
    c.env("NO_COLOR", "1").output().unwrap()
}

#[test]
#[cfg(target_os = "linux")]
fn eight_million_triangles_are_cut_in_256_mb() {
    let f = asteroid("8000000");
    let held = limited(&f, false);
    assert!(!held.status.success(), "in memory they do not fit, so that the limit is one");
    let disk = limited(&f, true);
    assert!(disk.status.success(), "{}", String::from_utf8_lossy(&disk.stderr));
    // Again: without the limit on what is held being asked for, it is what the size of the file says.
    let again = f.run(&["build", "asteroid.toml", "--set", "scene.memory_bytes=134217728"]);
    let said = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.success() && !said.contains("is cut into chunks"), "the file is there: {said}");
    let scene = std::fs::read_dir(f.path("store/scenes")).unwrap().next().unwrap().unwrap();
    assert!(scene.metadata().unwrap().len() > 100 << 20);
}
