//! The cubic lattice that pipes are routed on: which cells are taken, and where none may go.
//!
//! A cell is one scene unit wide and holds one piece of pipe. Steel columns stand [`BAY`] cells apart. The middle layer and each
//! fifth from it is a level: beams run from column to column along its floor, and its bays are **galleries**, most of them
//! in the middle level and half of them elsewhere. Pipes only cross a gallery, straight up or down, and only in four riser cells of
//! a bay, so that an eye finds its way between them; the other bays are as full of pipes as any layer.

use glam::{DVec3, IVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Distance of levels, layers.
const LEVEL_PERIOD: i32 = 5;
/// Share of a level's bays that are full of pipes, in the middle level and in the others. More in the middle and a
/// tour would not find its way.
const FULL_BAYS: [f64; 2] = [0.12, 0.5];
/// Distance of columns, cells.
pub(super) const BAY: i32 = 6;

/// The six directions, opposites next to each other.
pub(super) const DIRECTIONS: [IVec3; 6] = [IVec3::X, IVec3::NEG_X, IVec3::Y, IVec3::NEG_Y, IVec3::Z, IVec3::NEG_Z];

/// Cells and who has taken them.
pub(super) struct Lattice {
    /// Cells along x, y and z.
    pub(super) size: IVec3,
    taken: Vec<bool>,
    /// Whether the bay is full of pipes: levels from the bottom, then z, then x; empty where there are no galleries.
    full: Vec<bool>,
}

impl Lattice {
    /// `edge` cells wide and deep and about as many high; columns stand already.
    pub(super) fn new(edge: i32, rng: &mut ChaCha8Rng) -> Self {
        let size = IVec3::new(edge, height(edge), edge);
        let taken = vec![false; (size.x * size.y * size.z) as usize];
        let mut lattice = Self { size, taken, full: vec![] };
        let bays = bays(edge) * bays(edge);
        for y in lattice.levels() {
            let share = FULL_BAYS[usize::from(y != size.y / 2)];
            lattice.full.extend((0..bays).map(|_| rng.random_bool(share)));
        }
        for (x, z) in lattice.columns() {
            (0..size.y).for_each(|y| lattice.take(IVec3::new(x, y, z), true));
        }
        lattice
    }

    /// A lattice of any size without columns, levels and galleries.
    pub(super) fn bare(size: IVec3) -> Self {
        Self { size, taken: vec![false; size.element_product() as usize], full: vec![] }
    }

    /// x and z of the columns' cells.
    pub(super) fn columns(&self) -> Vec<(i32, i32)> {
        let step = BAY as usize;
        let size = self.size;
        (0..size.x).step_by(step).flat_map(|x| (0..size.z).step_by(step).map(move |z| (x, z))).collect()
    }

    /// The layers that are levels, from the bottom.
    pub(super) fn levels(&self) -> Vec<i32> {
        (0..self.size.y).filter(|y| (y - self.size.y / 2) % LEVEL_PERIOD == 0).collect()
    }

    /// Whether the cell is one of a gallery, or of the way of a beam.
    pub(super) fn gallery(&self, c: IVec3) -> bool {
        let first = self.size.y / 2 % LEVEL_PERIOD;
        if self.full.is_empty() || (c.y - first) % LEVEL_PERIOD != 0 || self.index(c).is_none() {
            return false;
        }
        let bay = ((c.y - first) / LEVEL_PERIOD * bays(self.size.z) + c.z / BAY) * bays(self.size.x) + c.x / BAY;
        c.x % BAY == 0 || c.z % BAY == 0 || !self.full[bay as usize]
    }

    fn index(&self, c: IVec3) -> Option<usize> {
        let inside = c.cmpge(IVec3::ZERO).all() && c.cmplt(self.size).all();
        inside.then(|| ((c.y * self.size.z + c.z) * self.size.x + c.x) as usize)
    }

    /// Whether the cell is inside and nobody's.
    pub(super) fn free(&self, c: IVec3) -> bool {
        self.index(c).is_some_and(|i| !self.taken[i])
    }

    /// Whether a cell may be entered in direction `d`.
    pub(super) fn open(&self, c: IVec3, d: IVec3) -> bool {
        self.free(c) && (!self.gallery(c) || d.y != 0 && self.riser(c) == c)
    }

    /// The riser cell next to `c` in its bay and layer: the second and the third of a bay's cells along x and z are risers.
    pub(super) fn riser(&self, c: IVec3) -> IVec3 {
        let to = |v: i32| v - v % BAY + (v % BAY).clamp(1, 2);
        IVec3::new(to(c.x), c.y, to(c.z))
    }

    /// Takes a cell or gives it back; cells outside are nobody's.
    pub(super) fn take(&mut self, c: IVec3, taken: bool) {
        if let Some(i) = self.index(c) {
            self.taken[i] = taken;
        }
    }

    /// Cells taken among the 5 x 5 x 5 about `c`; those outside count as taken.
    pub(super) fn crowd(&self, c: IVec3) -> usize {
        let near = |v: i32| v - 2..=v + 2;
        near(c.x)
            .flat_map(|x| near(c.y).flat_map(move |y| near(c.z).map(move |z| IVec3::new(x, y, z))))
            .filter(|&c| !self.free(c))
            .count()
    }

    /// The middle of a box of cells, scene units: the lattice's floor is y = 0, its middle x = z = 0.
    pub(super) fn middle(&self, low: IVec3, cells: IVec3) -> DVec3 {
        let half = self.size.as_dvec3() * DVec3::new(0.5, 0.0, 0.5);
        low.as_dvec3() + 0.5 * cells.as_dvec3() - half
    }
}

/// Bays along an edge.
fn bays(edge: i32) -> i32 {
    (edge + BAY - 1) / BAY
}

/// Layers of a lattice `edge` cells wide: odd, so that there is a middle one, and no level at the top and the bottom.
pub(super) fn height(edge: i32) -> i32 {
    let half = (edge - 1) / 2;
    2 * (half + i32::from(half % LEVEL_PERIOD == 0)) + 1
}
