//! Golden pictures: a frame of a small park on the cpu backend, all geometry and hybrid, held against the pictures in `golden/`.
//!
//! Compared by FLIP: its mean, and the 99th percentile of its pixels, so that a small part that is quite wrong is not lost in the
//! mean. Other processors may round otherwise, so equality is not asked for; the tolerance has a cap that no caller can pass.
//! `FARFIELD_BLESS=1` writes the pictures anew: look at them before they are committed.

use std::path::{Path, PathBuf};

use farfield_core::image::Picture;
use farfield_experiments::config::BackendName;
use farfield_experiments::images::write_png;
use farfield_experiments::measure::flip;
use farfield_integration_tests::lab::Lab;

const EXPERIMENT: &str = r#"
[scene]
source = "park"
triangles = 100_000
[view]
resolution = [160, 120]
eye_height = [16.0, 18.0]
near = 0.5
fov_y_deg = 40.0
max_speed = 30.0
max_turn_deg_per_s = 20.0
path = "tour"
frames_per_s = 0.6
frames = 36
[[pipeline]]
name = "geometry"
far_field = { type = "geometry", frustum_culling = false }
[[pipeline]]
name = "hybrid"
partition = { type = "hex-cells", edge = 50.0 }
far_field = { type = "textured-lod-mesh", edge_px = 1.5 }
"#;

const FRAME: usize = 33;

/// Mean FLIP and its 99th percentile.
#[derive(Clone, Copy, Debug)]
struct Tolerance {
    mean: f64,
    p99: f32,
}

/// No picture may be let off with more: about what a statue moved by two pixels makes.
const CAP: Tolerance = Tolerance { mean: 0.01, p99: 0.25 };

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("golden").join(format!("{name}.png"))
}

fn blessing() -> bool {
    std::env::var_os("FARFIELD_BLESS").is_some_and(|v| v == "1")
}

fn read(file: &Path) -> Picture {
    let image = image::open(file).unwrap_or_else(|e| panic!("{}: {e}; FARFIELD_BLESS=1 writes it", file.display()));
    let image = image.to_rgba8();
    Picture { size: [image.width(), image.height()], rgba: image.pixels().map(|p| p.0).collect() }
}

fn difference(golden: &Picture, found: &Picture) -> Tolerance {
    assert_eq!(golden.size, found.size, "a picture of another size");
    let (mean, mut pixels) = flip(golden, found);
    pixels.sort_by(f32::total_cmp);
    Tolerance { mean, p99: pixels[(pixels.len() - 1) * 99 / 100] }
}

/// # Panics
/// When more is allowed than [`CAP`].
fn within(found: Tolerance, allowed: Tolerance) -> bool {
    assert!(allowed.mean <= CAP.mean && allowed.p99 <= CAP.p99, "a tolerance of {allowed:?} is above the cap {CAP:?}");
    found.mean <= allowed.mean && found.p99 <= allowed.p99
}

#[track_caller]
fn assert_like_golden(name: &str, found: &Picture, allowed: Tolerance) {
    let file = golden(name);
    if blessing() {
        write_png(&file, found).unwrap();
        eprintln!("wrote {}: look at it", file.display());
    }
    let d = difference(&read(&file), found);
    println!("{name}: FLIP mean {:.5}, 99th percentile {:.4}", d.mean, d.p99);
    if !within(d, allowed) {
        let failed = std::env::temp_dir().join(format!("farfield-golden-{name}.png"));
        write_png(&failed, found).unwrap();
        panic!("{name}: {d:?} differs by more than {allowed:?} from {}; it is in {}", file.display(), failed.display());
    }
}

#[test]
fn a_park_looks_as_it_did() {
    let lab = Lab::new(EXPERIMENT, Path::new("")).unwrap();
    let mut device = lab.device(BackendName::Cpu).unwrap();
    for (i, p) in lab.experiment.pipelines.iter().enumerate() {
        let frame = lab.frames(i, &[FRAME], &mut device).unwrap().remove(0);
        // A hybrid without a far field would look as good.
        assert_eq!(frame.far_triangles > 0, p.name == "hybrid");
        assert_like_golden(&p.name, &frame.rendered.picture, Tolerance { mean: 0.002, p99: 0.05 });
    }
}

#[test]
fn a_shifted_or_recoloured_picture_is_not_like_golden() {
    if blessing() {
        return;
    }
    let picture = read(&golden("geometry"));
    let [w, h] = picture.size.map(|n| n as usize);
    let shifted = Picture {
        rgba: (0..w * h).map(|i| picture.rgba[i / w * w + (i % w + 2).min(w - 1)]).collect(),
        ..picture.clone()
    };
    let mut patched = picture.clone();
    // A patch of 15 x 15 pixels of another colour: 1.2 % of the picture.
    (0..225).for_each(|k| patched.rgba[(50 + k / 15) * w + 70 + k % 15] = [255, 0, 255, 255]);
    for (what, other) in [("shifted", &shifted), ("patched", &patched)] {
        let d = difference(&picture, other);
        assert!(!within(d, CAP), "{what}: {d:?} passes even the cap {CAP:?}");
    }
    assert!(within(difference(&picture, &picture), Tolerance { mean: 0.0, p99: 0.0 }));
    let above = std::panic::catch_unwind(|| within(CAP, Tolerance { mean: 2.0 * CAP.mean, ..CAP }));
    assert!(above.is_err(), "a tolerance above the cap is taken");
}
