//! A small scene of spheres and an experiment over it, and the command run on them.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder with `spheres.obj` and `experiment.toml`.
pub(crate) struct Folder(pub(crate) tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("spheres.obj"), spheres()).unwrap();
        std::fs::write(dir.path().join("experiment.toml"), EXPERIMENT).unwrap();
        Self(dir)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut c = Command::new(env!("CARGO_BIN_EXE_farfield"));
        c.current_dir(self.0.path()).args(args).env("NO_COLOR", "1");
        c
    }

    pub(crate) fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Standard output of a command that must succeed.
    pub(crate) fn ok(&self, args: &[&str]) -> String {
        let out = self.run(args);
        assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
        String::from_utf8(out.stdout).unwrap()
    }

    /// Exit code and standard error of a command that must fail.
    pub(crate) fn fails(&self, args: &[&str]) -> (i32, String) {
        let out = self.run(args);
        assert!(!out.status.success(), "{args:?} succeeded");
        (out.status.code().unwrap(), String::from_utf8(out.stderr).unwrap())
    }
}

pub(crate) const EXPERIMENT: &str = r#"
[scene]
path = "spheres.obj"
two_sided = false

[view]
resolution = 96
eye_height = 2.0
near = 0.05
path = "line"
max_speed = 60.0
frames_per_s = 5
frames = 8

[measure]
every = 2
audit_views = 12

[reference]
pipeline = "all geometry"

[[pipeline]]
name = "all geometry"
backend = "cpu"
far_field = { type = "geometry", frustum_culling = false }

[[pipeline]]
name = "frustum culled"
backend = "cpu"
far_field = { type = "geometry" }

[[pipeline]]
name = "hybrid"
backend = "cpu"
partition = { type = "hex-cells", edge = 12.0 }
far_field = { type = "textured-lod-mesh", edge_px = 3.0 }
"#;

/// Two rows of spheres along x, each an object of its own.
fn spheres() -> String {
    let (mut out, mut first) = (String::new(), 1);
    for i in 0..14 {
        let (x, z) = (f64::from(i / 2) * 14.0, if i % 2 == 0 { -16.0 } else { 16.0 });
        writeln!(out, "o sphere{i}").unwrap();
        let (rings, sides) = (24, 32);
        for r in 0..=rings {
            for s in 0..sides {
                let (a, b) = (
                    std::f64::consts::PI * f64::from(r) / f64::from(rings),
                    std::f64::consts::TAU * f64::from(s) / f64::from(sides),
                );
                let bump = 1.0 + 0.08 * (5.0 * b).sin() * a.sin();
                writeln!(
                    out,
                    "v {} {} {}",
                    x + 2.0 * bump * a.sin() * b.cos(),
                    2.0 + 2.0 * a.cos(),
                    z + 2.0 * bump * a.sin() * b.sin()
                )
                .unwrap();
            }
        }
        for r in 0..rings {
            for s in 0..sides {
                let at = |r: i32, s: i32| first + r * sides + s % sides;
                writeln!(out, "f {} {} {} {}", at(r, s), at(r, s + 1), at(r + 1, s + 1), at(r + 1, s)).unwrap();
            }
        }
        first += (rings + 1) * sides;
    }
    out
}

/// Every file under a folder with its bytes.
pub(crate) fn tree(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut out = BTreeMap::new();
    let mut folders = vec![root.to_owned()];
    while let Some(f) = folders.pop() {
        for e in std::fs::read_dir(f).unwrap() {
            let p = e.unwrap().path();
            if p.is_dir() {
                folders.push(p);
            } else {
                out.insert(p.strip_prefix(root).unwrap().to_owned(), std::fs::read(&p).unwrap());
            }
        }
    }
    out
}
