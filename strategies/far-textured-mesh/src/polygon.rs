//! Which views texture a simplified polygon.
//!
//! Follows textured LOD meshes (2003, section 3.1.4): the views that see all three of its vertices. The paper leaves polygons that
//! are partly hidden although their vertices are not to "general visibility"; here each view is checked on its own depth image: the
//! polygon is projected, and where more than `HIDDEN_SHARE` of its pixels lie behind what was captured the view is dropped, as
//! it is where the polygon turns away from it. By default the pixels decide alone ([`PolygonViews`]): a view that loses a corner behind an
//! outline but shows the rest is better than none, and where all views lose more, the one that shows most serves if it shows
//! half. For a single view the question is the other way round, whether the view shows
//! anything of the polygon: what it does show must come from its picture, and what it hides is seen by a few pixels at most.
//!
//! O(pixels of the polygon), at most about `MOST_SAMPLES`.

use glam::{Vec2, Vec3};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::shot::Picture;

/// What makes a view one of a polygon's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PolygonViews {
    /// It shows nine tenths of the polygon's pixels; where none does, the one that shows most, if that is half.
    #[default]
    Pixels,
    /// It sees all three vertices, as printed, and shows nine tenths of the pixels.
    Vertices,
}

/// A view that loses more of a polygon's pixels than this to something before it does not texture it.
const HIDDEN_SHARE: f32 = 0.1;
/// The least that a view has to show of a polygon that no view shows well.
const LEAST_SHARE: f32 = 0.5;
/// A simplified polygon may lie this many footprints behind the surface it stands for without being hidden by it: twice the step
/// that makes an interior silhouette.
const SLACK_PX: f32 = 8.0;
/// Pixels looked at, about.
const MOST_SAMPLES: f32 = 256.0;

/// The share of a triangle (relative to the piece's origin) that a view shows, 0 where it turns away.
pub(crate) fn shown(view: &Picture, t: [Vec3; 3]) -> f32 {
    let n = (t[1] - t[0]).as_dvec3().cross((t[2] - t[0]).as_dvec3());
    if n.dot(view.eye - t[0].as_dvec3()) <= 0.0 {
        return 0.0;
    }
    let [Some(a), Some(b), Some(c)] = t.map(|p| view.project(p)) else { return 0.0 };
    let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
    let step = (((hi.x - lo.x) * (hi.y - lo.y) / MOST_SAMPLES).sqrt().ceil()).max(1.0);
    let (mut all, mut seen) = (0u32, 0u32);
    let mut y = lo.y.floor() + 0.5;
    while y <= hi.y {
        let mut x = lo.x.floor() + 0.5;
        while x <= hi.x {
            if let Some(z) = depth_at([a, b, c], Vec2::new(x, y)) {
                all += 1;
                seen += u32::from(view.shows(Vec3::new(x, y, z), SLACK_PX));
            }
            x += step;
        }
        y += step;
    }
    if all == 0 {
        return f32::from(u8::from(view.shows((a + b + c) / 3.0, SLACK_PX)));
    }
    seen as f32 / all as f32
}

/// Linear depth of a projected triangle at a pixel; `None` beside it. 1/z is linear in the picture.
fn depth_at([a, b, c]: [Vec3; 3], p: Vec2) -> Option<f32> {
    let (pa, pb, pc) = (a.truncate() - p, b.truncate() - p, c.truncate() - p);
    let w = Vec3::new(pb.perp_dot(pc), pc.perp_dot(pa), pa.perp_dot(pb));
    let sum = w.element_sum();
    let inside = sum != 0.0 && (w / sum).cmpge(Vec3::ZERO).all();
    inside.then(|| sum / w.dot(Vec3::new(1.0 / a.z, 1.0 / b.z, 1.0 / c.z)))
}

/// The set of views that texture a triangle. `vertices` are the sets that see its corners.
pub(crate) fn view_set(views: &[Picture], t: [Vec3; 3], vertices: [u32; 3], by: PolygonViews) -> u32 {
    if let [only] = views {
        return u32::from(shown(only, t) > 0.0);
    }
    let allowed = match by {
        PolygonViews::Vertices => vertices[0] & vertices[1] & vertices[2],
        PolygonViews::Pixels => u32::MAX,
    };
    let shares: Vec<f32> =
        views.iter().enumerate().map(|(i, v)| if allowed >> i & 1 == 1 { shown(v, t) } else { 0.0 }).collect();
    let set = shares.iter().enumerate().filter(|(_, s)| **s >= 1.0 - HIDDEN_SHARE).fold(0, |set, (i, _)| set | 1 << i);
    if set != 0 || by == PolygonViews::Vertices {
        return set;
    }
    let best = (0..views.len()).rev().max_by(|&a, &b| shares[a].total_cmp(&shares[b]));
    best.filter(|&i| shares[i] >= LEAST_SHARE).map_or(0, |i| 1 << i)
}
