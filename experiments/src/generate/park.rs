//! The statuary park: how many statues of which kind stand where.
//!
//! System T's three scenes stand on one area of 1650 x 2035 with the kinds, numbers and boxes of [`Kind`]; the smaller scenes
//! are subsets of the larger ones. Here there is one endless seeded sequence of placements, and a park is a **prefix** of it:
//!
//! - the first eight are one of each kind; the first 64, 132 and 253 are the paper's 2M, 4M and 8M numbers, in an order
//!   that keeps each prefix's mixture as even as it can be. The 2M scene grows outwards by quarters of the area, so that a small park
//!   is a small place; from there to 8M the whole area fills up;
//! - beyond that, each further 253 have the 8M scene's mixture and stand in the frame by which the area grows, so that
//!   density stays what it was: 64M is about eight times the area;
//! - the prefix taken is the one whose total is nearest to the request, or the paper's scene if one is within 1 % of it. If
//!   its total is more than 1 % off (a dragon is a tenth of the 2M scene), or the request is below one of each kind, all
//!   meshes get finer or coarser by the same factor.
//!
//! Positions are uniform by rejection: circles about the footprints, with some room between them, do not overlap. That takes
//! O(statues^2) with fewer than ten tries a statue, 0.1 s at 64M. Deviation: the paper does not say how it placed its statues.

use glam::{DVec2, DVec3, Vec3Swizzles};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use farfield_core::mesh::TriangleMesh;

use super::GenerateError;
use super::fit::fit_to_box;
use super::kind::{Kind, PaperModel};
use super::sculpt::{LEAST_TRIANGLES, sculpt};

/// The paper's total of its 2M scene.
pub const PARK_2M: u64 = 2_017_700;
/// The total of its 4M scene.
pub const PARK_4M: u64 = 4_188_885;
/// The total of its 8M scene.
pub const PARK_8M: u64 = 8_004_863;

/// Least total of a park.
pub const LEAST_TOTAL: u64 = 100_000;
/// Greatest total of a park.
pub const MOST_TOTAL: u64 = 64_100_000;

/// Half the paper's area, x and z.
const HALF_AREA: DVec2 = DVec2::new(825.0, 1017.5);
/// Free way between any two statues, scene units: two people pass.
const CLEARANCE: f64 = 6.0;
/// Real meshes that are fitted by height have wider footprints than the paper's box by up to this factor.
const FOOTPRINT_SLACK: f64 = 1.25;
/// How far the chosen prefix may be off the requested total before the meshes are adapted.
const TOLERANCE: f64 = 0.01;

/// What park to make.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ParkSettings {
    /// Triangles in the scene, all instances counted, 100,000 to 64.1 million; met within 1 %. The paper's scenes are
    /// 2,017,700, 4,188,885 and 8,004,863.
    pub triangles: u64,
    /// Seed of positions, turns, relief and colours.
    pub seed: u64,
}

impl Default for ParkSettings {
    fn default() -> Self {
        Self { triangles: PARK_2M, seed: 1 }
    }
}

/// One statue's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// What stands there.
    pub kind: Kind,
    /// The middle of its foot, on y = 0.
    pub position: DVec3,
    /// Turn about the vertical, counter-clockwise seen from above.
    pub yaw_rad: f64,
    /// Scale of the mesh; 1 for all of the paper's statues.
    pub scale: f64,
}

/// Who stands where, without meshes.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The statues; a park of a smaller total and the same seed has a prefix of them.
    pub placements: Vec<Placement>,
    /// Half the area's extent in x and z; its middle is the origin. Parks from 2M to 8M have the paper's 1650 x 2035.
    pub half_area: DVec2,
    /// Triangles of each kind's mesh if it is sculpted, in the order of [`Kind::ALL`].
    pub mesh_triangles: [u32; 8],
    /// Triangles of the whole park if all is sculpted.
    pub total_triangles: u64,
}

/// A park as plain data.
#[derive(Clone, Debug, PartialEq)]
pub struct ParkScene {
    /// One mesh a kind, in the order of [`Kind::ALL`], with its name.
    pub meshes: Vec<(&'static str, TriangleMesh)>,
    /// The instances; `kind as usize` is the mesh's index.
    pub placements: Vec<Placement>,
    /// Half the area's extent in x and z; its middle is the origin.
    pub half_area: DVec2,
}

impl ParkScene {
    /// Triangles of all instances together.
    pub fn triangles(&self) -> u64 {
        self.placements.iter().map(|p| self.meshes[p.kind as usize].1.triangles() as u64).sum()
    }
}

/// The park with sculpted statues.
///
/// # Errors
/// If the total is out of [`LEAST_TOTAL`]..=[`MOST_TOTAL`].
pub fn park(settings: &ParkSettings) -> Result<ParkScene, GenerateError> {
    let layout = layout(settings)?;
    let meshes = Kind::ALL
        .par_iter()
        .map(|&kind| Ok((kind.name(), sculpt(kind, layout.mesh_triangles[kind as usize], settings.seed)?)))
        .collect::<Result<_, GenerateError>>()?;
    Ok(ParkScene { meshes, placements: layout.placements, half_area: layout.half_area })
}

/// The same park of given meshes, one a kind in the order of [`Kind::ALL`], as they come from their files: each is turned as
/// `models` says and scaled uniformly to the paper's height. Its total follows the files: `settings.triangles` chooses the
/// prefix by the paper's counts.
///
/// # Errors
/// If the total is out of [`LEAST_TOTAL`]..=[`MOST_TOTAL`], or a mesh cannot be fitted.
pub fn park_of(
    settings: &ParkSettings,
    models: &[PaperModel; 8],
    meshes: [TriangleMesh; 8],
) -> Result<ParkScene, GenerateError> {
    let layout = layout(settings)?;
    let mut named = Vec::with_capacity(meshes.len());
    for (mut mesh, model) in meshes.into_iter().zip(models) {
        fit_to_box(&mut mesh, model.up, model.yaw_deg, model.kind.size())?;
        named.push((model.kind.name(), mesh));
    }
    Ok(ParkScene { meshes: named, placements: layout.placements, half_area: layout.half_area })
}

/// Who stands where; also for parks of given meshes, whose totals follow the files.
///
/// # Errors
/// If the total is out of [`LEAST_TOTAL`]..=[`MOST_TOTAL`].
pub fn layout(settings: &ParkSettings) -> Result<Layout, GenerateError> {
    let asked = settings.triangles;
    if !(LEAST_TOTAL..=MOST_TOTAL).contains(&asked) {
        return Err(GenerateError::Total { what: "a park", asked, least: LEAST_TOTAL, most: MOST_TOTAL });
    }
    let (kinds, factor) = choose(asked);
    let mesh_triangles = Kind::ALL.map(|kind| {
        let count = (f64::from(kind.sculpted_triangles()) * factor / 2.0).round() as u32 * 2;
        count.max(LEAST_TRIANGLES)
    });
    let (placements, half_area) = place(&kinds, settings.seed);
    let total_triangles = kinds.iter().map(|&kind| u64::from(mesh_triangles[kind as usize])).sum();
    Ok(Layout { placements, half_area, mesh_triangles, total_triangles })
}

/// The prefix of the sequence of kinds for `asked` triangles, and the factor for the meshes' counts.
fn choose(asked: u64) -> (Vec<Kind>, f64) {
    let block = sequence();
    let close = |total: u64| asked.abs_diff(total) as f64 <= TOLERANCE * asked as f64;
    // A total that is one of the paper's scenes but for rounding is that scene.
    let scene = [PARK_2M, PARK_4M, PARK_8M].into_iter().find(|&paper| close(paper));
    let aim = scene.unwrap_or(asked);
    let mut kinds: Vec<Kind> = Vec::new();
    let mut total = 0;
    for &kind in block.iter().cycle() {
        let more = total + u64::from(kind.sculpted_triangles());
        if kinds.len() >= Kind::ALL.len() && more.abs_diff(aim) > total.abs_diff(aim) {
            break;
        }
        kinds.push(kind);
        total = more;
    }
    (kinds, if close(total) { 1.0 } else { asked as f64 / total as f64 })
}

/// The kinds of the paper's 8M scene in the order they are placed: the 2M scene first, then what the 4M has more, then the rest.
fn sequence() -> Vec<Kind> {
    let mut out = Vec::new();
    let mut before = [0; 8];
    for scene in 0..3 {
        let mut order: Vec<(f64, Kind)> = Vec::new();
        for kind in Kind::ALL {
            let count = kind.paper_numbers()[scene] - before[kind as usize];
            before[kind as usize] += count;
            // Evenly through the scene; the very first of each kind come at once.
            let first = f64::from(u8::from(scene > 0)) * 0.5;
            order.extend((0..count).map(|i| ((f64::from(i) + first) / f64::from(count), kind)));
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        out.extend(order.into_iter().map(|o| o.1));
    }
    out
}

/// Places statue after statue, each in the frame of its index ([`frame`]).
fn place(kinds: &[Kind], seed: u64) -> (Vec<Placement>, DVec2) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut placements: Vec<Placement> = Vec::with_capacity(kinds.len());
    let mut half = HALF_AREA;
    for (i, &kind) in kinds.iter().enumerate() {
        let (inner, outer) = frame(i);
        half = outer;
        let radius = reach(kind);
        let position = loop {
            let p = DVec2::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)) * (outer - radius);
            let free = |q: &Placement| q.position.xz().distance(p) >= radius + reach(q.kind) + CLEARANCE;
            if p.abs().cmpgt(inner).any() && placements.iter().all(free) {
                break p;
            }
        };
        let yaw_rad = rng.random_range(0.0..std::f64::consts::TAU);
        placements.push(Placement { kind, position: DVec3::new(position.x, 0.0, position.y), yaw_rad, scale: 1.0 });
    }
    (placements, half)
}

/// Half extents of the rectangles between which statue `i` stands; areas go with the number of statues inside.
fn frame(i: usize) -> (DVec2, DVec2) {
    let [small, _, large] = [0, 1, 2].map(|s| Kind::ALL.iter().map(|k| k.paper_numbers()[s] as usize).sum::<usize>());
    // In paper areas: quarters up to the 2M scene, then all of it up to the 8M scene, then one more for each 8M scene.
    let (inner, outer) = if i < small {
        let quarter = 4 * i / small;
        (quarter as f64 / 4.0, (quarter + 1) as f64 / 4.0)
    } else if i < large {
        (0.0, 1.0)
    } else {
        ((i / large) as f64, (i / large + 1) as f64)
    };
    (HALF_AREA * inner.sqrt(), HALF_AREA * outer.sqrt())
}

/// Radius of the circle that holds a kind's footprint however it is turned, with room for real meshes.
fn reach(kind: Kind) -> f64 {
    let size = kind.size().as_dvec3();
    0.5 * FOOTPRINT_SLACK * size.x.hypot(size.z)
}
