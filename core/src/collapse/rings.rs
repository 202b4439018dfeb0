//! The triangles round every vertex, and which edges are no plain ones: the connectivity that a mesh under collapse begins with.
//!
//! A counting sort of corners by vertex. Beside each triangle of a vertex stand its other two vertices while the borders are
//! looked for, so that this reads one array from front to back. O(triangles).

use super::mesh::{BORDER, DEAD, ODD};

/// Up to this valence an inner vertex is recognised without counters.
const FEW: usize = 8;

pub(super) struct Rings {
    /// Where each vertex's run ends; it begins where the one before ends.
    ends: Vec<u32>,
    /// The runs: triangles.
    pub(super) triangles: Vec<u32>,
    /// For each entry of a run, the triangle's vertices after and before.
    around: Vec<[u32; 2]>,
}

impl Rings {
    pub(super) fn new(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        let mut ends = vec![0; vertices];
        let living = || triangles.iter().zip(0..).filter(|(t, _)| t[0] != DEAD);
        for (t, _) in living() {
            t.iter().for_each(|&v| ends[v as usize] += 1);
        }
        let mut sum = 0;
        for end in &mut ends {
            (*end, sum) = (sum, sum + *end);
        }
        // Begins until they are filled.
        let mut rings = Self { ends, triangles: vec![0; sum as usize], around: vec![[0; 2]; sum as usize] };
        for (&[a, b, c], i) in living() {
            for (v, around) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                let at = &mut rings.ends[v as usize];
                rings.triangles[*at as usize] = i;
                rings.around[*at as usize] = around;
                *at += 1;
            }
        }
        rings
    }

    /// A vertex's run.
    #[inline]
    pub(super) fn range(&self, vertex: usize) -> (usize, usize) {
        let start = if vertex == 0 { 0 } else { self.ends[vertex - 1] };
        (start as usize, self.ends[vertex] as usize)
    }

    /// `BORDER` and `ODD` for each vertex.
    pub(super) fn borders(&self) -> Vec<u8> {
        // Triangles that run from the vertex at hand to this one, and back. Most meshes never need it.
        let mut count: Vec<[u32; 2]> = Vec::new();
        let of = |v| {
            let (start, end) = self.range(v);
            let around = &self.around[start..end];
            if is_inner(around) {
                return 0;
            }
            count.resize(self.ends.len(), [0; 2]);
            for [next, last] in around {
                count[*next as usize][0] += 1;
                count[*last as usize][1] += 1;
            }
            let mut flags = 0;
            for &x in around.as_flattened() {
                // Emptied at the first look; later ones see a balanced pair.
                let [forth, back] = std::mem::take(&mut count[x as usize]);
                flags |= if forth != back { ODD } else { 0 } | if matches!(forth + back, 0 | 2) { 0 } else { BORDER };
            }
            flags
        };
        (0..self.ends.len()).map(of).collect()
    }
}

/// Whether a vertex of few triangles has one in each direction at each of its edges. False says nothing.
#[inline]
fn is_inner(around: &[[u32; 2]]) -> bool {
    if around.len() > FEW {
        return false;
    }
    // Free places hold numbers that no vertex of a mesh of usual size has, the same on both sides.
    let mut next: [u32; FEW] = std::array::from_fn(|i| DEAD - i as u32);
    let mut last = next;
    for (i, [n, l]) in around.iter().enumerate() {
        (next[i], last[i]) = (*n, *l);
    }
    // Each next one once among the next and once among the last ones: so both are the same set.
    let mut twins = [0; FEW];
    for i in 0..FEW {
        for j in 0..FEW {
            twins[j] += (next[j] == next[i]) as u32 + ((next[j] == last[i]) as u32) * 16;
        }
    }
    twins == [17; FEW]
}
