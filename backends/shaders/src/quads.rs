//! Quads whose vertices are pulled: one pattern of indices for all points and lines, and the draws that walk a span with it.
//!
//! WGSL has no point size and lines of no width but one that drivers choose, so each point and line is a quad. An element of a page has
//! four vertices, 4 i .. 4 i + 4, of which the vertex stage finds the element and the corner: bit 0 is the far side across, bit
//! 1 the far side down. A draw walks up to [`QUADS`] of them with the shared indices, its base vertex saying where they
//! start. Instances of four vertices each would need no indices, but devices and lavapipe start an instance at far greater cost
//! than a vertex, and a draw's instance is its record here.

use crate::layout::DrawCommand;
use crate::pool::Span;

/// How many quads a draw has at most: with four vertices each, as many as 16 bits count.
pub const QUADS: u32 = 1 << 14;

/// The indices of so many quads, two triangles each: what every backend keeps in one index buffer of 32 bits.
pub fn indices() -> Vec<u32> {
    (0..QUADS).flat_map(|i| [0, 2, 1, 1, 2, 3].map(|corner| 4 * i + corner)).collect()
}

/// The draws of a span.
pub(crate) fn commands(span: Span, record: u32) -> impl Iterator<Item = DrawCommand> {
    (0..span.len).step_by(QUADS as usize).map(move |first| DrawCommand {
        index_count: 6 * (span.len - first).min(QUADS),
        instance_count: 1,
        first_index: 0,
        base_vertex: (4 * (span.first + first)) as i32,
        first_instance: record,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_reach_every_element_once() {
        let pattern = indices();
        for (first, len) in [(0, 0), (7, 1), (3, QUADS), (11, QUADS + 1), (0, 3 * QUADS + 5)] {
            let mut corners = vec![[0u8; 4]; len as usize];
            for c in commands(Span { page: 0, first, len }, 9) {
                assert_eq!((c.first_instance, c.instance_count), (9, 1));
                for &i in &pattern[c.first_index as usize..][..c.index_count as usize] {
                    let vertex = i + c.base_vertex as u32;
                    corners[(vertex / 4 - first) as usize][(vertex % 4) as usize] += 1;
                }
            }
            assert!(corners.iter().all(|&c| c == [1, 2, 2, 1]), "{first}, {len}");
        }
    }
}
