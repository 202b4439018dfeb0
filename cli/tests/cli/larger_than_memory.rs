//! From a model larger than memory to measured frames, within a limit of the system's; and what is refused because it holds all triangles at once.
//!
//! The limit is a control group's (cgroup v2, swap off) where one can be made, else RLIMIT_DATA: heap, private mappings and stacks of threads,
//! whether they are touched or not.
//!
//! The large one is run by
//!
//! ```text
//! cargo test --release -p farfield-cli --test cli -- --ignored --nocapture thirty_million
//! ```
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::Folder;

const EXPERIMENT: &str = r#"
[scene]
path = "asteroid.ply"
two_sided = false
out_of_core = true
memory_bytes = 16_777_216

[view]
resolution = [320, 240]
path = "orbit"
frames = 4

[budget]
memory_bytes = 33_554_432

[[pipeline]]
name = "bounded"
backend = "cpu"
far_field = { type = "point-polygon-hlod", resolution = 64.0, primitives = "triangles", metric = { type = "hausdorff" } }
scheduler = { type = "movement-priority" }
"#;

fn asteroid(triangles: &str, experiment: &str) -> Folder {
    let f = Folder::new();
    f.ok(&["scene", "asteroid", "--triangles", triangles, "--out", "asteroid.ply"]);
    std::fs::write(f.path("large.toml"), experiment).unwrap();
    f
}

/// The most bytes that a command may take.
struct Limit {
    bytes: u64,
    group: Option<Group>,
}

/// A control group of the second version, removed when it is dropped.
struct Group(PathBuf);

impl Group {
    /// Beside or below this process's own, wherever the memory controller is handed down.
    fn new(bytes: u64) -> Option<Self> {
        let root = Path::new("/sys/fs/cgroup");
        let own = std::fs::read_to_string("/proc/self/cgroup").ok()?;
        let own = root.join(own.lines().find_map(|l| l.strip_prefix("0::/"))?);
        let hands_down = |at: &&Path| {
            let all = std::fs::read_to_string(at.join("cgroup.subtree_control")).unwrap_or_default();
            at.starts_with(root) && all.split_whitespace().any(|c| c == "memory")
        };
        let group = Self(
            [own.as_path(), own.parent()?]
                .into_iter()
                .find(hands_down)?
                .join(format!("farfield-{}", std::process::id())),
        );
        std::fs::create_dir(&group.0).ok()?;
        std::fs::write(group.0.join("memory.max"), bytes.to_string()).ok()?;
        // Not there where the system has no swap.
        _ = std::fs::write(group.0.join("memory.swap.max"), "0");
        let joins = Command::new("sh").args(["-c", &group.join()]).status();
        joins.is_ok_and(|s| s.success()).then_some(group)
    }

    fn join(&self) -> String {
        format!("echo $$ > '{}'", self.0.join("cgroup.procs").display())
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        _ = std::fs::remove_dir(&self.0);
    }
}

/// What a limited command left, and the processor time that it took.
struct Done {
    out: Output,
    cpu_s: f64,
}

impl Done {
    fn told(&self) -> String {
        String::from_utf8_lossy(&self.out.stderr).into_owned()
    }
}

impl Limit {
    fn new(bytes: u64) -> Self {
        Self { bytes, group: Group::new(bytes) }
    }

    fn name(&self) -> &'static str {
        if self.group.is_some() { "cgroup v2" } else { "RLIMIT_DATA" }
    }

    fn run(&self, f: &Folder, args: &[&str]) -> Done {
        let limit = match &self.group {
            Some(g) => g.join(),
            None => format!("ulimit -d {}", self.bytes / 1024),
        };
        let script = format!("{limit} || exit 99; \"$@\"; code=$?; times; exit $code");
        let mut c = Command::new("sh");
        c.current_dir(f.0.path()).args(["-c", &script, "sh", env!("CARGO_BIN_EXE_farfield")]);
        c.args(args).args(["--quiet", "--threads", "2"]).env("NO_COLOR", "1");
        // Mesa tells on the error stream where it has no such folder; a backtrace of memory that ran out needs memory, and waits for ever.
        let out = c.env("XDG_RUNTIME_DIR", f.0.path()).env("RUST_BACKTRACE", "0").output().unwrap();
        // The last line is of the command: "0m1.5s 0m0.25s", user and system.
        let said = String::from_utf8_lossy(&out.stdout);
        let times = said.lines().last().unwrap_or_default().split_whitespace();
        let seconds = |t: &str| -> Option<f64> {
            let (minutes, rest) = t.split_once('m')?;
            Some(60.0 * minutes.parse::<f64>().ok()? + rest.strip_suffix('s')?.parse::<f64>().ok()?)
        };
        let cpu_s = times.map(|t| seconds(t).unwrap_or_else(|| panic!("{said}"))).sum();
        Done { out, cpu_s }
    }

    fn ok(&self, f: &Folder, args: &[&str]) -> Done {
        let done = self.run(f, args);
        assert!(done.out.status.success(), "{args:?} in {} bytes: {}", self.bytes, done.told());
        done
    }
}

/// The first pipeline's results, and the peak memory of the run.
fn results(f: &Folder, out: &str) -> (serde_json::Value, u64) {
    let text = std::fs::read_to_string(f.path(out).join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    (summary["pipelines"][0].clone(), summary["peak_rss_bytes"].as_u64().unwrap())
}

fn column(f: &Folder, out: &str, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(f.path(out).join("frames.csv")).unwrap();
    let at = text.lines().next().unwrap().split(',').position(|c| c == name).unwrap();
    text.lines().skip(1).map(|l| l.split(',').nth(at).unwrap().parse().unwrap()).collect()
}

#[test]
fn a_model_is_built_and_walked_in_less_memory_than_it_takes() {
    let f = asteroid("2000000", EXPERIMENT);
    let limit = Limit::new(144 << 20);
    let held = limit.run(&f, &["run", "large.toml", "--out", "held", "--set", "scene.out_of_core=false"]);
    assert!(!held.out.status.success(), "held whole it does not fit, so that the limit is one");
    limit.ok(&f, &["run", "large.toml", "--out", "disk"]);
    let (p, peak) = results(&f, "disk");
    let triangles = p["triangles"]["total"]["max"].as_f64().unwrap();
    assert!((1000.0..1_500_000.0).contains(&triangles), "{triangles} triangles");
    assert!(column(&f, "disk", "missing_blocks").iter().all(|&m| m == 0.0), "all of it was there");
    // What the budget does not hold is drawn coarser, and told.
    let errors = column(&f, "disk", "far_error_px");
    assert!(errors.len() == 4 && errors.iter().all(|e| (0.25..4.0).contains(e)), "{errors:?}");
    assert!(p["resident_bytes"].as_u64().unwrap() <= 33_554_432);
    assert!(peak > 16 << 20, "{peak}");
}

/// Refused for the reason and with the help that `parts` tell.
fn refused(f: &Folder, experiment: &str, code: i32, parts: &[&str]) {
    std::fs::write(f.path("large.toml"), experiment).unwrap();
    let (found, said) = f.fails(&["run", "large.toml", "--quiet"]);
    let flat = said.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", "");
    assert_eq!(found, code, "{flat}");
    parts.iter().for_each(|p| assert!(flat.contains(p), "{p}: {flat}"));
}

#[test]
fn what_holds_all_triangles_at_once_is_refused_and_says_what_to_set() {
    let start = EXPERIMENT.split("[[pipeline]]").next().unwrap();
    let f = asteroid("700000", start);
    let textured = "[[pipeline]]\nname = \"textured\"\nbackend = \"cpu\"\npartition = { type = \"hex-cells\", edge = 50.0 }\n\
                    far_field = { type = \"textured-lod-mesh\" }\n";
    let parts = [
        "\"textured\" takes pictures",
        "all triangles at once",
        "[scene] memory_bytes allows 17 MB",
        "out_of_core = false",
    ];
    refused(&f, &format!("{start}{textured}"), 2, &parts);
    assert!(!f.path("out").exists());
    let geometry = |name: &str| {
        format!("[[pipeline]]\nname = \"{name}\"\nbackend = \"cpu\"\nfar_field = {{ type = \"geometry\" }}\n")
    };
    let two = format!("{start}{}{}", geometry("all"), geometry("again"));
    let parts = ["the reference \"all\" lacks", "blocks in frame 0", "17 MB", "raise memory_bytes"];
    refused(&f, &two, 1, &parts);
    // What a frame of it draws may well fit, and then it streams: along the surface, on one side and on the other.
    let csv = "time_s,x,y,z,yaw_deg,pitch_deg\n0,0,0,100,90,0\n1,0,0,-100,-90,0\n";
    std::fs::write(f.path("path.csv"), csv).unwrap();
    let along = two.replace("path = \"orbit\"\nframes = 4", "path = \"path.csv\"\nframes_per_s = 1\nframes = 2");
    let along = along.replace("memory_bytes = 16_777_216", "memory_bytes = 25_165_824");
    std::fs::write(f.path("large.toml"), along).unwrap();
    f.ok(&["run", "large.toml", "--quiet", "--out", "along"]);
    let drawn = column(&f, "along", "near_triangles");
    assert!(drawn.len() == 4 && drawn[..2].iter().all(|&t| (1.0..350_000.0).contains(&t)), "{drawn:?}");
    // The reference waits for what it lacks; no other frame waits for the disk but the first.
    let missing = column(&f, "along", "missing_blocks");
    assert!(missing[..3].iter().all(|&m| m == 0.0) && missing[3] > 0.0, "{missing:?}");
}

/// From afar to 15 units above the surface, and along it.
const APPROACH: &str =
    "time_s,x,y,z,yaw_deg,pitch_deg\n0,0,0,500,0,0\n1,0,0,130,0,0\n2,60,0,100,20,0\n3,60,0,100,60,0\n";

/// What is built and drawn is all bounded; its peak, bytes.
fn peak(done: &Done) -> f64 {
    let said = String::from_utf8_lossy(&done.out.stdout).into_owned();
    let at = said.split("peak memory ").nth(1).and_then(|s| s.split(' ').next()?.parse::<f64>().ok());
    1e6 * at.unwrap_or_else(|| panic!("{said}"))
}

#[test]
#[ignore = "takes half an hour, and 7 GB of disk; in a release build"]
fn thirty_million_triangles_in_512_mb() {
    let limit = Limit::new(512 << 20);
    println!("limit: 512 MB by {}", limit.name());
    let large = EXPERIMENT
        .replace("16_777_216", "33_554_432")
        .replace("[budget]\nmemory_bytes = 33_554_432", "[budget]\nmemory_bytes = 67_108_864")
        .replace("[320, 240]", "[640, 480]")
        .replace("path = \"orbit\"\nframes = 4", "path = \"path.csv\"\nframes_per_s = 8\nframes = 24")
        .replace("backend = \"cpu\"\n", "");
    let mut work: Vec<f64> = vec![];
    for triangles in ["1000000", "8000000", "30000000"] {
        let f = asteroid(triangles, &large);
        std::fs::write(f.path("path.csv"), APPROACH).unwrap();
        let far_field = |which: &str| format!("pipeline.bounded.far_field={which}");
        let cut = limit.ok(&f, &["build", "large.toml", "--set", &far_field("{ type = \"geometry\" }")]);
        let built = limit.ok(&f, &["build", "large.toml"]);
        let walked = limit.ok(&f, &["run", "large.toml", "--out", "walk"]);
        assert!(walked.told().is_empty(), "it was cut and built: {}", walked.told());
        let (p, walking) = results(&f, "walk");
        let levels: Vec<[u64; 2]> = p["levels"]
            .as_array()
            .unwrap()
            .iter()
            .map(|l| [&l["nodes"], &l["triangles"]].map(|n| n.as_u64().unwrap()))
            .collect();
        let original = f.path("walk/summary.json");
        let original: serde_json::Value = serde_json::from_slice(&std::fs::read(original).unwrap()).unwrap();
        let original = original["scene"]["triangles"].as_f64().unwrap();
        let number = |v: &serde_json::Value| v.as_f64().unwrap();
        println!(
            "\n{original} triangles: cut at {:.2} s of CPU a million, peak {:.0} MB",
            cut.cpu_s / original * 1e6,
            peak(&cut) / 1e6
        );
        println!(
            "built in {:.0} s of CPU: {:.3} Mtri/s a core, peak {:.0} MB, {:.1} MB stored",
            built.cpu_s,
            original / 1e6 / built.cpu_s,
            peak(&built) / 1e6,
            number(&p["preprocess"]["bytes_stored"]) / 1e6
        );
        println!("levels (nodes, triangles): {levels:?}");
        println!(
            "walked {} frames on {}: {:.0} triangles a frame ({:.0} original), at most {:.0}; {:.1} x floor; resident at most {:.0} MB; \
             peak {:.0} MB; stated error at most {:.3} px, mean {:.3}",
            column(&f, "walk", "frame").len(),
            p["device"]["backend"],
            number(&p["triangles"]["total"]["mean"]),
            number(&p["triangles"]["near"]["mean"]),
            number(&p["triangles"]["total"]["max"]),
            number(&p["frame_ms"]["p50"]) / number(&p["floor_ms"]),
            number(&p["resident_bytes"]) / 1e6,
            walking as f64 / 1e6,
            number(&p["far_error_px"]["max"]),
            number(&p["far_error_px"]["mean"]),
        );
        let errors = column(&f, "walk", "far_error_px");
        println!("stated error by frame, px: {errors:?}");
        // Memory holds less than half a pixel asks for close by; a few times as much is uncovered by no turn and no step.
        assert!(errors.iter().all(|e| *e < 4.0));
        assert!(column(&f, "walk", "missing_blocks").iter().all(|&m| m == 0.0));
        work.push(levels.iter().map(|l| l[1] as f64).sum::<f64>() / original);
        if work.len() == 1 {
            let all = Limit { bytes: 8 << 30, group: None };
            let clusters = all.ok(&f, &["build", "large.toml", "--set", &far_field("{ type = \"cluster-lod\" }")]);
            println!(
                "cluster-lod: {:.3} Mtri/s a core, peak {:.0} MB",
                original / 1e6 / clusters.cpu_s,
                peak(&clusters) / 1e6
            );
        }
    }
    println!("\ntriangles over all levels, a triangle of the original: {work:.3?}");
    assert!(work[2] < 1.25 * work[0], "as much work a triangle at thirty million as at one");
}
