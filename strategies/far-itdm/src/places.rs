//! Where the first samples of a region are taken.
//!
//! Follows Wilson and Manocha 2003, section 3.4: one at each corner of the navigable region. Of a region with many corners (the ball's
//! outline has 32) eight stand for all.

use farfield_core::Fault;
use farfield_core::cell::Cell;
use glam::{DVec3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The most first samples in the plane.
const MOST: usize = 8;

/// Which corners of a region are sampled first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Corners {
    /// Those of its outline seen from above, at the height of its centre: the published way, for eyes that walk.
    #[default]
    Planar,
    /// All of them, for eyes that rise and sink too.
    Solid,
}

/// The first viewpoints, each once, in a fixed order.
pub(crate) fn first(cell: &Cell, corners: Corners) -> Result<Vec<DVec3>, Fault> {
    let outline = &cell.outline;
    let solid = match corners {
        Corners::Solid => outline.region.corners(),
        Corners::Planar => {
            let flat = outline.region.footprint();
            let every = flat.len().div_ceil(MOST).max(1);
            let at = |p: &[f32; 2]| Vec3::new(p[0], outline.centre.y, p[1]);
            (!flat.is_empty()).then(|| flat.iter().step_by(every).map(at).collect())
        }
    };
    let all = solid.ok_or_else(|| Fault::Refused(format!("cell {} has no corners to sample from", outline.id.0)))?;
    Ok(each_once(all.into_iter().map(|p| outline.region.brought_in(p))))
}

fn each_once(places: impl IntoIterator<Item = Vec3>) -> Vec<DVec3> {
    let mut out: Vec<DVec3> = vec![];
    for p in places.into_iter().map(Vec3::as_dvec3) {
        if !out.contains(&p) {
            out.push(p);
        }
    }
    out
}

/// Viewpoints on a uniform grid of `n` x `n` over the region's outline, at the height of its centre: the middles of the grid's fields
/// that lie in the region, or the centre where none does.
pub(crate) fn grid(cell: &Cell, n: u32) -> Vec<DVec3> {
    let outline = &cell.outline;
    let flat = outline.region.footprint();
    let bounds = farfield_core::Aabb::of(flat.iter().map(|p| Vec3::new(p[0], outline.centre.y, p[1])));
    let at = |i: u32| {
        let t = Vec3::new((i % n) as f32 + 0.5, 0.0, (i / n) as f32 + 0.5) / n as f32;
        bounds.min + bounds.size() * t
    };
    let inside = each_once((0..n * n).map(at).filter(|p| outline.region.contains(*p)));
    if inside.is_empty() { vec![outline.centre.as_dvec3()] } else { inside }
}
