//! The second phase: the static view-dependent cut of the merge tree.

use farfield_core::collapse::{Candidate, Cost, LiveMesh, Place};

use super::Limits;
use super::tree::{Merge, sides};

/// The tree's merges as the only edges, in the tree's order.
pub(super) struct Cut {
    /// For each vertex whom it merges into and when; itself where it does not, or not within the limits.
    into: Vec<(u32, f32)>,
}

impl Cut {
    pub(super) fn new(merges: Vec<Merge>, live: &LiveMesh, silhouette: &[bool], limits: &Limits) -> Self {
        let mut into: Vec<(u32, f32)> = (0..silhouette.len() as u32).map(|v| (v, 0.0)).collect();
        for (i, m) in merges.iter().enumerate() {
            let strict = live.is_border(m.from) || silhouette[m.from as usize];
            if m.px <= if strict { limits.border_px } else { limits.interior_px } {
                into[m.from as usize] = (m.onto, i as f32);
            }
        }
        Self { into }
    }
}

impl Cost for Cut {
    fn costs(&mut self, live: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        for (&[a, b], out) in edges.iter().zip(out) {
            let merge = |from: u32, onto: u32, place: Place| {
                let (to, when) = self.into[from as usize];
                let along = !live.is_border(from) || sides(live, from, onto) == 1;
                (to == onto && along).then_some(Candidate { cost: when, place })
            };
            *out = merge(b, a, Place::First).or_else(|| merge(a, b, Place::Second)).unwrap_or(Candidate::FORBIDDEN);
        }
    }
}
