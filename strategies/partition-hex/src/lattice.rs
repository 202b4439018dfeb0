//! The hexagonal lattice: flat-topped hexagons in columns, one of them centred on the local frame's origin.
//!
//! Column q, row r has its centre at (1.5 c q, sqrt(3) c (r + 1/2 [q odd])) in (x, z), with c the edge (and the circumscribed
//! circle's radius). Each hexagon is the set of points nearest to its centre, so that looking a point up is finding the nearest
//! centre; points as near to two or three centres go to the one with the smaller (q, r): every point is in exactly one.

use glam::DVec2;

/// Square root of three: the distance of two neighbouring centres in edges.
const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// A range of columns and rows of the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lattice {
    /// Edge of a hexagon, scene units.
    pub(crate) edge: f64,
    /// First column and row.
    pub(crate) first: [i64; 2],
    /// Number of columns and rows.
    pub(crate) count: [i64; 2],
}

impl Lattice {
    /// The least range of columns and rows whose hexagons cover a rectangle (x, z).
    pub(crate) fn covering(edge: f64, min: DVec2, max: DVec2) -> Self {
        // A column reaches c / 2 beyond its width of 1.5 c on each side; rows of odd columns stand half a step further.
        let q = [(min.x / edge - 0.5) / 1.5, (max.x / edge + 0.5) / 1.5];
        let r = [min.y / (SQRT_3 * edge) - 0.5, max.y / (SQRT_3 * edge)];
        let first = [q[0].round() as i64, r[0].round() as i64];
        let last = [q[1].round() as i64, r[1].round() as i64];
        Self { edge, first, count: [last[0] - first[0] + 1, last[1] - first[1] + 1] }
    }

    /// The centre (x, z) of a hexagon.
    pub(crate) fn centre(&self, [q, r]: [i64; 2]) -> DVec2 {
        DVec2::new(1.5 * q as f64, SQRT_3 * (r as f64 + 0.5 * q.rem_euclid(2) as f64)) * self.edge
    }

    /// Corner k (counter-clockwise in (x, z), the first one towards +x) relative to the centre.
    pub(crate) fn corner(&self, k: usize) -> DVec2 {
        DVec2::from_angle(k as f64 * std::f64::consts::FRAC_PI_3) * self.edge
    }

    /// The hexagon that holds a point, in the range or not.
    pub(crate) fn nearest(&self, p: DVec2) -> [i64; 2] {
        let near = (p.x / (1.5 * self.edge)).round() as i64;
        let mut best = (f64::INFINITY, [0, 0]);
        for q in near - 1..=near + 1 {
            let low = (p.y / (SQRT_3 * self.edge) - 0.5 * q.rem_euclid(2) as f64).floor() as i64;
            for r in [low, low + 1] {
                let d = self.centre([q, r]).distance_squared(p);
                if d < best.0 {
                    best = (d, [q, r]);
                }
            }
        }
        best.1
    }

    /// The index of a hexagon, row by row; `None` outside the range.
    pub(crate) fn index(&self, [q, r]: [i64; 2]) -> Option<u32> {
        let (x, y) = (q - self.first[0], r - self.first[1]);
        ((0..self.count[0]).contains(&x) && (0..self.count[1]).contains(&y)).then(|| (y * self.count[0] + x) as u32)
    }

    /// The hexagon of an index.
    pub(crate) fn at(&self, index: u32) -> [i64; 2] {
        let i = i64::from(index);
        [self.first[0] + i % self.count[0], self.first[1] + i / self.count[0]]
    }

    /// The six hexagons round one.
    pub(crate) fn around([q, r]: [i64; 2]) -> [[i64; 2]; 6] {
        let odd = q.rem_euclid(2);
        [[q + 1, r + odd], [q, r + 1], [q - 1, r + odd], [q - 1, r - 1 + odd], [q, r - 1], [q + 1, r - 1 + odd]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Whether a hexagon holds a point, by its six edges; `slack` in edges.
    fn holds(l: &Lattice, cell: [i64; 2], p: DVec2, slack: f64) -> bool {
        let centre = l.centre(cell);
        (0..6).all(|k| {
            let (a, b) = (centre + l.corner(k), centre + l.corner(k + 1));
            (b - a).perp_dot(p - a) >= -slack * l.edge * l.edge
        })
    }

    proptest! {
        #[test]
        fn a_point_is_in_the_hexagon_that_is_looked_up_and_in_no_other(
            x in -1e4f64..1e4, y in -1e4f64..1e4, edge in 0.01f64..500.0
        ) {
            let l = Lattice { edge, first: [0, 0], count: [1, 1] };
            let p = DVec2::new(x, y);
            let cell = l.nearest(p);
            prop_assert!(holds(&l, cell, p, 1e-9));
            for other in Lattice::around(cell) {
                prop_assert!(!holds(&l, other, p, -1e-9));
            }
        }

        #[test]
        fn a_covering_range_holds_its_whole_rectangle(
            x in -50f64..50.0, y in -50f64..50.0, w in 0f64..90.0, h in 0f64..90.0, u in 0f64..=1.0, v in 0f64..=1.0
        ) {
            let (min, max) = (DVec2::new(x, y), DVec2::new(x + w, y + h));
            let l = Lattice::covering(7.0, min, max);
            for p in [min + (max - min) * DVec2::new(u, v), min, max, DVec2::new(x, y + h), DVec2::new(x + w, y)] {
                prop_assert!(l.index(l.nearest(p)).is_some(), "{:?} {:?}", l, p);
            }
        }
    }

    #[test]
    fn corners_and_middles_of_edges_have_one_cell_whichever_neighbour_is_asked() {
        let l = Lattice { edge: 1.0, first: [-3, -3], count: [7, 7] };
        // These lie on borders exactly where the numbers allow it; the answer must be a hexagon that touches them.
        for i in 0..49 {
            let cell = l.at(i);
            for k in 0..6 {
                let corner = l.centre(cell) + l.corner(k);
                let middle = l.centre(cell) + (l.corner(k) + l.corner(k + 1)) / 2.0;
                for p in [corner, middle] {
                    let found = l.nearest(p);
                    assert_eq!(found, l.nearest(p));
                    assert!(holds(&l, found, p, 1e-12));
                    assert!(found == cell || Lattice::around(cell).contains(&found));
                }
            }
        }
        // An exact tie: the border between rows of column 0 lies at z = sqrt(3) / 2; x = 0.
        let found = l.nearest(DVec2::new(0.0, SQRT_3 / 2.0));
        assert_eq!(found, [0, 0]);
    }

    #[test]
    fn neighbours_are_mutual_and_one_step_needs_at_most_three_new_ones() {
        for q in -2..3 {
            for r in -2..3 {
                let mine = Lattice::around([q, r]);
                for n in mine {
                    let theirs = Lattice::around(n);
                    assert!(theirs.contains(&[q, r]));
                    let new = theirs.iter().filter(|c| **c != [q, r] && !mine.contains(c)).count();
                    assert_eq!(new, 3);
                    let l = Lattice { edge: 2.0, first: [0, 0], count: [1, 1] };
                    assert!((l.centre(n).distance(l.centre([q, r])) - 2.0 * SQRT_3).abs() < 1e-12);
                }
            }
        }
    }
}
