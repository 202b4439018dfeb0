//! What small primitives cost on a backend, in triangles: what a far field goes by that draws points where they are cheaper (`point_cost`).

use farfield_core::backend::{Backend, BlockData};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef, TargetId};
use farfield_core::payload::{LinesPart, MeshPart, Part, Payload, PointsPart};
use farfield_core::scene::SceneBuilder;
use farfield_core::{Aabb, Camera, Fault};
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::config::BackendName;
use crate::failure::Failure;
use crate::walk::device;

/// Primitives of each kind; many against what an empty frame costs.
const PRIMITIVES: usize = 200_000;
/// Frames of each kind that are timed, after one that is not.
const FRAMES: usize = 9;

/// The time of one primitive each, nanoseconds: the median frame of many, less the median empty frame, by the device's clock where it has one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveTimes {
    /// A triangle with two edges of two pixels.
    pub triangle_ns: f64,
    /// A point of two pixels' edge.
    pub point_ns: f64,
    /// A line of two pixels' length.
    pub line_ns: f64,
}

/// Times small primitives at random places of a picture of 1024 x 1024 pixels. The kinds are drawn in turns, so that whatever else the machine does
/// meets all. What is uploaded is freed again.
///
/// # Errors
/// What the backend gives.
pub fn primitive_times(backend: &mut dyn Backend) -> Result<PrimitiveTimes, Fault> {
    let (parts, camera) = small_primitives();
    let id = |n| PayloadRef { asset: AssetId(u32::MAX), id: LocalPayload(n) };
    let list = |draws| DrawList { passes: vec![Pass { kind: PassKind::Surface, camera, writes: TargetId(0), draws }] };
    let mut lists = vec![list(vec![])];
    for (n, part) in (0..).zip(parts) {
        let payload = Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![part] };
        backend.upload(Block::Payload(id(n)), &BlockData::Payload(&payload))?;
        let what = DrawWhat::Payload { id: id(n), part: 0, object: 1 };
        lists.push(list(vec![Draw { what, bounds: Aabb::EMPTY, error_px: 0.0 }]));
    }
    let mut times: Vec<Vec<f64>> = vec![vec![]; lists.len()];
    for turn in 0..=FRAMES {
        for (list, times) in lists.iter().zip(&mut times) {
            let counted = backend.render(list)?;
            times.extend((turn > 0).then(|| counted.gpu_ms.unwrap_or(counted.wall_ms)));
        }
    }
    (0..3).for_each(|n| backend.release(Block::Payload(id(n))));
    let [empty, triangle_ns, point_ns, line_ns] = [0, 1, 2, 3].map(|i| {
        times[i].sort_by(f64::total_cmp);
        times[i][FRAMES / 2] * 1e6 / PRIMITIVES as f64
    });
    Ok(PrimitiveTimes { triangle_ns: triangle_ns - empty, point_ns: point_ns - empty, line_ns: line_ns - empty })
}

/// Triangles, points and lines of about two pixels, each at the same random places of a picture, all facing the eye, and the camera.
fn small_primitives() -> ([Part; 3], Camera) {
    let camera = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [1024, 1024], 0.1);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let px = |x: f32, y: f32, z: f32| camera.ray(x, y) * z;
    let places: Vec<[f32; 3]> = (0..PRIMITIVES)
        .map(|_| [rng.random_range(2f32..1020.0), rng.random_range(2f32..1020.0), rng.random_range(19.9f32..20.1)])
        .collect();
    let colors = |n: usize| (0..n).map(|i| [(i % 256) as u8, 90, 160, 255]).collect::<Vec<_>>();
    let corners: Vec<Vec3> =
        places.iter().flat_map(|&[x, y, z]| [px(x, y, z), px(x, y + 2.0, z), px(x + 2.0, y, z)]).collect();
    let triangles = MeshPart {
        normals: vec![Vec3::Z; corners.len()],
        albedo: colors(corners.len()),
        indices: (0..corners.len() as u32).collect(),
        positions: corners,
        two_sided: false,
    };
    // One radius a part: of nearly one depth.
    let positions: Vec<Vec3> = places.iter().map(|&[x, y, z]| px(x, y, z)).collect();
    let radius = 20.0 / camera.px_per_tan();
    let points = PointsPart {
        normals: vec![Vec3::Z; PRIMITIVES],
        albedo: colors(PRIMITIVES),
        positions,
        radius,
        two_sided: false,
    };
    let ends: Vec<Vec3> = places.iter().flat_map(|&[x, y, z]| [px(x, y, z), px(x + 1.7, y + 1.0, z)]).collect();
    let lines = LinesPart {
        normals: vec![Vec3::Z; ends.len()],
        albedo: colors(ends.len()),
        indices: (0..ends.len() as u32).collect(),
        positions: ends,
    };
    ([Part::Mesh(triangles), Part::Points(points), Part::Lines(lines)], camera)
}

/// A line a backend: the one that is named, which has to be there, or all that are.
///
/// # Errors
/// [`Failure::Work`] where it is not there, or fails.
pub fn calibrate(name: Option<BackendName>) -> Result<String, Failure> {
    let names = match name {
        Some(name) => {
            device::available(name)?;
            vec![name]
        }
        None => BackendName::ALL.into_iter().filter(|b| device::available(*b).is_ok()).collect(),
    };
    let scene = SceneBuilder::default().build().map_err(|e| Failure::during("an empty scene", e))?;
    let mut out =
        String::from("backend  device                                    triangle ns  point_cost  a line, triangles\n");
    for name in names {
        let mut backend = device::open(name, &scene)?;
        let failed = |e| Failure::during(format!("drawing with the backend \"{}\"", name.name()), e);
        let t = primitive_times(&mut *backend).map_err(failed)?;
        out += &format!(
            "{:<7}  {:<40.40}  {:>11.0}  {:>10.2}  {:>17.2}\n",
            name.name(),
            backend.info().device,
            t.triangle_ns,
            t.point_ns / t.triangle_ns,
            t.line_ns / t.triangle_ns
        );
    }
    Ok(out)
}
