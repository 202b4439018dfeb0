//! Meshing a distance field: marching cubes with a table that is derived, not typed.
//!
//! Lorensen and Cline 1987, with ambiguous faces always resolved so that inside corners are cut off one by one. Both cells of a
//! face decide alike and each cell's polygons are simple loops over its faces, so that the mesh is a closed, oriented
//! 2-manifold by construction, which surface nets and the original table are not. A loop that cannot be cut into triangles
//! without a diagonal inside a face (which could meet its twin of the next cell) gets a vertex in its middle. The slivers that
//! marching cubes are known for are left to [`super::remesh`]. Cells far from the surface are skipped block by block.
//! O(surface cells + volume / block volume); memory 4 bytes a lattice point.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::sdf::Solid;

/// Positions and triangles.
pub(super) struct Raw {
    /// Vertex positions.
    pub(super) positions: Vec<Vec3>,
    /// Corners, counter-clockwise from outside.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Edge of a cell: lower corner (bits x, y, z) and axis.
type CellEdge = (u8, u8);

/// The triangles of one sign pattern; corners are indices of `EDGES`, or `MIDDLE + i` for the middle of loop `i`.
#[derive(Default)]
struct Case {
    triangles: Vec<[u8; 3]>,
    /// Loops that need a middle vertex.
    middles: Vec<Vec<u8>>,
}

/// A layer of cells: triangles by vertex names, and the vertices.
type Layer = (Vec<[u64; 3]>, Vec<(u64, Vec3)>);

const MIDDLE: u8 = 12;
const BLOCK: u32 = 4;

const EDGES: [CellEdge; 12] =
    [(0, 0), (2, 0), (4, 0), (6, 0), (0, 1), (1, 1), (4, 1), (5, 1), (0, 2), (1, 2), (2, 2), (3, 2)];

/// Corners of the six faces, counter-clockwise seen from outside the cell.
const FACES: [[u8; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

fn edge_between(a: u8, b: u8) -> u8 {
    let (low, axis) = (a & b, (a ^ b).trailing_zeros() as u8);
    EDGES.iter().position(|&e| e == (low, axis)).expect("neighbouring corners share an edge") as u8
}

fn share_face(a: u8, b: u8) -> bool {
    let on = |face: &[u8; 4], e: u8| {
        let (low, axis) = EDGES[e as usize];
        face.contains(&low) && face.contains(&(low | 1 << axis))
    };
    FACES.iter().any(|f| on(f, a) && on(f, b))
}

fn table() -> Vec<Case> {
    (0..256_u32).map(|mask| case(|corner| mask >> corner & 1 == 1)).collect()
}

fn case(inside: impl Fn(u8) -> bool) -> Case {
    // On each face, going round it, every run of inside corners is cut off by one segment from its start to its end.
    let mut next = [u8::MAX; 12];
    for face in FACES {
        for i in 0..4 {
            if inside(face[i]) || !inside(face[(i + 1) % 4]) {
                continue;
            }
            let entry = edge_between(face[i], face[(i + 1) % 4]);
            let mut j = (i + 1) % 4;
            while inside(face[(j + 1) % 4]) {
                j = (j + 1) % 4;
            }
            next[entry as usize] = edge_between(face[j], face[(j + 1) % 4]);
        }
    }
    let mut out = Case::default();
    for start in 0..12 {
        let mut polygon = Vec::new();
        let mut e = start;
        while next[e as usize] != u8::MAX {
            polygon.push(e);
            e = std::mem::replace(&mut next[e as usize], u8::MAX);
        }
        if polygon.len() < 3 {
            continue;
        }
        let n = polygon.len();
        let fan = (0..n).find(|&s| (2..n - 1).all(|i| !share_face(polygon[s], polygon[(s + i) % n])));
        if let Some(s) = fan {
            let at = |i: usize| polygon[(s + i) % n];
            out.triangles.extend((1..n - 1).map(|i| [at(0), at(i), at(i + 1)]));
        } else {
            let middle = MIDDLE + out.middles.len() as u8;
            out.triangles.extend((0..n).map(|i| [middle, polygon[i], polygon[(i + 1) % n]]));
            out.middles.push(polygon);
        }
    }
    out
}

/// The surface of `solid` on a lattice of its spacing, as a closed manifold.
pub(super) fn march(solid: &Solid) -> Raw {
    let h = solid.spacing();
    let (lo, hi) = solid.bounds();
    // Two cells of air all round, and an offset that keeps flat faces of the sculpture off the lattice planes.
    let origin = lo - Vec3::new(2.37, 2.41, 2.43) * h;
    let cells = ((hi - origin) / h).ceil().as_uvec3() + 3;
    let cells = cells.map(|c| c.div_ceil(BLOCK) * BLOCK);
    let points = cells + 1;
    let layer = (points.x * points.y) as usize;
    let at = |i: UVec3| origin + i.as_vec3() * h;
    let reach = 1.5 * (0.5 * BLOCK as f32 * h * 3.0_f32.sqrt()) + solid.relief_max();
    let busy: Vec<bool> = {
        let blocks = cells / BLOCK;
        (0..blocks.element_product())
            .into_par_iter()
            .map(|b| {
                let i = UVec3::new(b % blocks.x, b / blocks.x % blocks.y, b / (blocks.x * blocks.y));
                solid.smooth_distance(at(i * BLOCK) + 0.5 * BLOCK as f32 * h).abs() < reach
            })
            .collect()
    };
    let blocks = cells / BLOCK;
    let is_busy = |c: UVec3| {
        let b = c / BLOCK;
        b.cmplt(blocks).all() && busy[(b.x + blocks.x * (b.y + blocks.y * b.z)) as usize]
    };
    // A lattice point is needed where one of the up to eight blocks around it is busy.
    let needed = |p: UVec3| {
        (0..8_u32).any(|k| {
            let back = UVec3::new(k & 1, k >> 1 & 1, k >> 2);
            p.cmpge(back).all() && is_busy(p - back)
        })
    };
    let values: Vec<f32> = (0..points.z)
        .into_par_iter()
        .flat_map_iter(|z| {
            (0..points.y).flat_map(move |y| (0..points.x).map(move |x| UVec3::new(x, y, z))).map(|p| {
                let d = if needed(p) { solid.distance(at(p)) } else { f32::NAN };
                // Exactly on the surface counts as outside.
                if d == 0.0 { f32::MIN_POSITIVE } else { d }
            })
        })
        .collect();
    let index = |p: UVec3| p.x as usize + points.x as usize * p.y as usize + layer * p.z as usize;
    let table = table();
    let corner = |k: u8| UVec3::new(u32::from(k & 1), u32::from(k >> 1 & 1), u32::from(k >> 2));
    // Vertices are named by lattice point and axis (or 3 + loop, for middles): cells agree on names without talking.
    let key = |cell: UVec3, e: u8| -> u64 {
        if e >= MIDDLE {
            return index(cell) as u64 * 8 + 3 + u64::from(e - MIDDLE);
        }
        let (low, axis) = EDGES[e as usize];
        index(cell + corner(low)) as u64 * 8 + u64::from(axis)
    };
    let named: Vec<Layer> = (0..cells.z)
        .into_par_iter()
        .map(|z| {
            let (mut triangles, mut vertices) = (Vec::new(), Vec::new());
            for y in 0..cells.y {
                for x in 0..cells.x {
                    let cell = UVec3::new(x, y, z);
                    if !is_busy(cell) {
                        continue;
                    }
                    let mut mask = 0;
                    for k in 0..8 {
                        mask |= usize::from(values[index(cell + corner(k))] < 0.0) << k;
                    }
                    let case = &table[mask];
                    let crossing = |e: u8| {
                        let (low, axis) = EDGES[e as usize];
                        let (a, b) = (cell + corner(low), cell + corner(low | 1 << axis));
                        let (da, db) = (values[index(a)], values[index(b)]);
                        // Kept off the lattice points, so that no triangle starts degenerate.
                        at(a).lerp(at(b), (da / (da - db)).clamp(0.05, 0.95))
                    };
                    for t in &case.triangles {
                        triangles.push(t.map(|e| key(cell, e)));
                        vertices.extend(t.iter().filter(|&&e| e < MIDDLE).map(|&e| (key(cell, e), crossing(e))));
                    }
                    for (i, polygon) in case.middles.iter().enumerate() {
                        let sum: Vec3 = polygon.iter().map(|&e| crossing(e)).sum();
                        vertices.push((key(cell, MIDDLE + i as u8), sum / polygon.len() as f32));
                    }
                }
            }
            vertices.sort_unstable_by_key(|v| v.0);
            vertices.dedup_by_key(|v| v.0);
            (triangles, vertices)
        })
        .collect();
    let mut vertices: Vec<(u64, Vec3)> = named.iter().flat_map(|n| n.1.iter().copied()).collect();
    vertices.par_sort_unstable_by_key(|v| v.0);
    vertices.dedup_by_key(|v| v.0);
    let find = |k: u64| vertices.binary_search_by_key(&k, |v| v.0).expect("every corner has a vertex") as u32;
    let triangles = named.par_iter().flat_map_iter(|n| n.0.iter().map(|t| t.map(find))).collect();
    largest_piece(Raw { positions: vertices.iter().map(|v| v.1).collect(), triangles })
}

/// The connected piece with the most triangles: crumbs of the relief and cavities inside are dropped.
fn largest_piece(raw: Raw) -> Raw {
    let mut parent: Vec<u32> = (0..raw.positions.len() as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    for t in &raw.triangles {
        let a = root(&mut parent, t[0]);
        for &c in &t[1..] {
            let b = root(&mut parent, c);
            parent[b as usize] = a;
        }
    }
    let mut sizes = vec![0_u32; parent.len()];
    for t in &raw.triangles {
        sizes[root(&mut parent, t[0]) as usize] += 1;
    }
    let best = (0..sizes.len()).max_by_key(|&i| (sizes[i], std::cmp::Reverse(i))).unwrap_or(0) as u32;
    let mut names = vec![u32::MAX; parent.len()];
    let mut positions = Vec::new();
    for (i, &p) in raw.positions.iter().enumerate() {
        if root(&mut parent, i as u32) == best {
            names[i] = positions.len() as u32;
            positions.push(p);
        }
    }
    let kept = raw.triangles.iter().map(|t| t.map(|c| names[c as usize])).filter(|t| t[0] != u32::MAX);
    Raw { triangles: kept.collect(), positions }
}
