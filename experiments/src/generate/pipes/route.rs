//! Where pipes run: seeded walks over the lattice that avoid themselves and each other.
//!
//! Vessels come first, then pipe after pipe until [`FILL`] of the cells are taken. A pipe starts at a vessel's nozzle, at a pipe
//! that is there already (a tee), or in the least crowded of some random cells; it goes straight for some cells, turns, and so
//! on, until it is long enough or shut in. Most pipes run in bundles: copies of one walk, side by side, across the plane
//! that the walk keeps to. O(cells) tries of O(length) each.

use glam::IVec3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lattice::{BAY, DIRECTIONS, Lattice};
use super::parts::{SYSTEMS, System};

/// Share of the cells that is taken before routing stops: dense, and still seen into.
const FILL: f64 = 0.62;
/// Pipes shorter than this, cells, are not laid.
const SHORTEST: usize = 4;
/// Least and most cells between turns, where there is room.
const RUN: std::ops::RangeInclusive<i32> = 2..=12;
/// Share of the bundles that start upwards or downwards in a riser cell.
const RISERS: f64 = 0.15;
/// Share of the tries at branches; many fail.
const BRANCHES: f64 = 0.4;
/// Random cells that a start is chosen from.
const STARTS: usize = 6;
/// One vessel for so many cells.
const CELLS_A_VESSEL: i32 = 1_300;
/// Narrowest lattice with vessels, cells.
const LEAST_EDGE_WITH_VESSELS: i32 = 13;

/// A vessel: 3 cells wide, 4 long.
pub(super) struct Vessel {
    /// Its lowest cell.
    pub(super) low: IVec3,
    /// Its cells along each axis.
    pub(super) cells: IVec3,
}

/// A pipe.
pub(super) struct Line {
    /// Index into [`SYSTEMS`].
    pub(super) system: u8,
    /// Whether it is of the narrow bore.
    pub(super) narrow: bool,
    /// The cells it runs through, neighbours in turn.
    pub(super) cells: Vec<IVec3>,
    /// The direction in which it leaves what it starts from; `None`: it starts with a blind end.
    pub(super) from: Option<IVec3>,
    /// Narrow pipes that branch off: index into `cells` and direction.
    pub(super) tees: Vec<(usize, IVec3)>,
}

impl Line {
    /// Directions into and out of a cell; at a blind end both are the same.
    pub(super) fn through(&self, i: usize) -> (IVec3, IVec3) {
        let after = self.cells.get(i + 1).map(|&c| c - self.cells[i]);
        let before = if i > 0 { Some(self.cells[i] - self.cells[i - 1]) } else { self.from };
        let into = before.or(after).unwrap_or(IVec3::X);
        (into, after.unwrap_or(into))
    }
}

/// Vessels, where there is room for them: upright ones fill the height between galleries.
pub(super) fn vessels(lattice: &mut Lattice, rng: &mut ChaCha8Rng) -> Vec<Vessel> {
    let size = lattice.size;
    if size.x < LEAST_EDGE_WITH_VESSELS {
        return vec![];
    }
    let wanted = (size.element_product() / CELLS_A_VESSEL) as usize;
    let mut out: Vec<Vessel> = vec![];
    for _ in 0..20 * wanted {
        if out.len() == wanted {
            break;
        }
        let mut cells = IVec3::splat(3);
        cells[[0, 1, 1, 2][rng.random_range(0..4)]] = 4;
        let low = IVec3::new(
            rng.random_range(0..=size.x - cells.x),
            rng.random_range(0..=size.y - cells.y),
            rng.random_range(0..=size.z - cells.z),
        );
        let all = || cube(low, cells);
        if all().all(|c| lattice.free(c) && !lattice.gallery(c)) && between_columns(low, cells) {
            all().for_each(|c| lattice.take(c, true));
            out.push(Vessel { low, cells });
        }
    }
    out
}

/// Whether a box of cells stays out of the planes of columns.
fn between_columns(low: IVec3, cells: IVec3) -> bool {
    [0, 2].into_iter().all(|k| low[k] % BAY != 0 && low[k] / BAY == (low[k] + cells[k] - 1) / BAY)
}

fn cube(low: IVec3, cells: IVec3) -> impl Iterator<Item = IVec3> {
    let range = move |k: usize| low[k]..low[k] + cells[k];
    range(0).flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| IVec3::new(x, y, z))))
}

/// The cells before a vessel's nozzles, with the directions out.
fn nozzles(v: &Vessel) -> Vec<(IVec3, IVec3)> {
    let along = (0..3).find(|&k| v.cells[k] == 4).unwrap_or(0);
    let centre = v.low + IVec3::ONE;
    DIRECTIONS.into_iter().filter(|d| d[along] == 0).map(|d| (centre + 2 * d, d)).collect()
}

/// Lays pipes until the lattice is full enough.
pub(super) fn lines(lattice: &mut Lattice, vessels: &[Vessel], rng: &mut ChaCha8Rng) -> Vec<Line> {
    lines_of(lattice, vessels, None, rng)
}

/// Lays pipes until `cells` are laid; `None`: until the lattice is full enough.
pub(super) fn lines_of(
    lattice: &mut Lattice,
    vessels: &[Vessel],
    pipe_cells: Option<usize>,
    rng: &mut ChaCha8Rng,
) -> Vec<Line> {
    let mut out: Vec<Line> = vec![];
    for (start, d) in vessels.iter().flat_map(nozzles) {
        let (system, narrow) = ([0, 1, 1, 2][rng.random_range(0..4)], rng.random_bool(0.5));
        out.extend(lay(lattice, start, d, None, rng).map(|cells| line(system, narrow, cells, Some(d))));
    }
    let cells = lattice.size.element_product();
    let wanted = (FILL * f64::from(cells)) as usize;
    let count = |l: &Lattice| cube(IVec3::ZERO, l.size).filter(|&c| !l.free(c)).count();
    let mut taken = count(lattice);
    let wanted = pipe_cells.map_or(wanted, |n| taken + n);
    for _ in 0..4 * cells {
        if taken >= wanted {
            break;
        }
        let before = out.len();
        if !out.is_empty() && rng.random_bool(BRANCHES) {
            branch(lattice, &mut out, rng);
        } else {
            bundle(lattice, &mut out, rng);
        }
        taken += out[before..].iter().map(|l| l.cells.len()).sum::<usize>();
    }
    out
}

fn line(system: u8, narrow: bool, cells: Vec<IVec3>, from: Option<IVec3>) -> Line {
    Line { system, narrow, cells, from, tees: vec![] }
}

/// A narrow pipe that leaves a straight cell of one that is there.
fn branch(lattice: &mut Lattice, lines: &mut Vec<Line>, rng: &mut ChaCha8Rng) {
    let which = rng.random_range(0..lines.len());
    let parent = &lines[which];
    let i = rng.random_range(1..parent.cells.len() - 1);
    let (into, out) = parent.through(i);
    let apart = |t: &(usize, IVec3)| t.0.abs_diff(i) > 1;
    if into != out || lattice.gallery(parent.cells[i]) || !parent.tees.iter().all(apart) {
        return;
    }
    let first = rng.random_range(0..6);
    let across = (0..6).map(|k| DIRECTIONS[(first + k) % 6]).filter(|d| d.dot(into) == 0);
    let Some(d) = across.max_by_key(|&d| room(lattice, parent.cells[i], d)) else { return };
    let system = parent.system;
    if let Some(cells) = lay(lattice, parent.cells[i] + d, d, None, rng) {
        lines[which].tees.push((i, d));
        lines.push(line(system, true, cells, Some(d)));
    }
}

/// How many cells, at most 12, are open from `c` in direction `d`.
fn room(lattice: &Lattice, c: IVec3, d: IVec3) -> usize {
    (1..=12).take_while(|&s| lattice.open(c + d * s, d)).count()
}

/// Some pipes side by side.
fn bundle(lattice: &mut Lattice, lines: &mut Vec<Line>, rng: &mut ChaCha8Rng) {
    let mut draw = rng.random_range(0..SYSTEMS.iter().map(|s| s.share).sum());
    let passed = |s: &&System| {
        let passed = draw >= s.share;
        draw -= if passed { s.share } else { 0 };
        passed
    };
    let system = SYSTEMS.iter().take_while(passed).count();
    let number = rng.random_range(1..=SYSTEMS[system].bundle);
    let narrow = rng.random_bool(0.35);
    let size = lattice.size;
    let cell = |rng: &mut ChaCha8Rng| IVec3::from_array(size.to_array().map(|n| rng.random_range(0..n)));
    let riser = rng.random_bool(RISERS);
    let starts: Vec<IVec3> = (0..STARTS).map(|_| if riser { lattice.riser(cell(rng)) } else { cell(rng) }).collect();
    let Some(start) = starts.into_iter().filter(|&c| lattice.free(c)).min_by_key(|&c| lattice.crowd(c)) else {
        return;
    };
    let d = DIRECTIONS[if riser { 2 + rng.random_range(0..2) } else { rng.random_range(0..6) }];
    let across = DIRECTIONS[rng.random_range(0..6)];
    if across.dot(d) != 0 || lattice.gallery(start) {
        return;
    }
    // As many as there is room for.
    let free = |k: &i32| lattice.open(start + across * *k, d);
    let number = (0..number).take_while(free).count() as i32;
    let copies = (number > 1).then_some((across, number));
    if let Some(cells) = lay(lattice, start, d, copies, rng) {
        for k in 0..number {
            lines.push(line(system as u8, narrow, cells.iter().map(|&c| c + across * k).collect(), None));
        }
    }
}

/// Walks from `start` in direction `d` and takes the cells, of all copies; `None` where it would get too short.
fn lay(
    lattice: &mut Lattice,
    start: IVec3,
    d: IVec3,
    copies: Option<(IVec3, i32)>,
    rng: &mut ChaCha8Rng,
) -> Option<Vec<IVec3>> {
    let (across, number) = copies.unwrap_or((IVec3::ZERO, 1));
    let open = |l: &Lattice, c: IVec3, d: IVec3| (0..number).all(|k| l.open(c + across * k, d));
    let take = |l: &mut Lattice, c: IVec3, taken| (0..number).for_each(|k| l.take(c + across * k, taken));
    if !open(lattice, start, d) || lattice.gallery(start) {
        return None;
    }
    let most = rng.random_range(8..=16 + 2 * lattice.size.x) as usize;
    let mut cells = vec![start];
    take(lattice, start, true);
    let (mut head, mut d, mut last) = (start, d, IVec3::ZERO);
    while cells.len() < most {
        for _ in 0..rng.random_range(RUN) {
            let next = head + d;
            // A gallery is crossed as a whole.
            let steps = if lattice.gallery(next) { 2 } else { 1 };
            if !(1..=steps).all(|s| open(lattice, head + d * s, d)) {
                break;
            }
            for _ in 0..steps {
                head += d;
                take(lattice, head, true);
                cells.push(head);
            }
        }
        // Where there is most room, and rather not back along the last run but one: pipes go places.
        let room = |e: IVec3| (1..=12).take_while(|&s| open(lattice, head + e * s, e)).count();
        let mut best = (0, d);
        for e in DIRECTIONS.into_iter().filter(|e| e.dot(d) == 0 && e.dot(across) == 0) {
            let needed = if lattice.gallery(head + e) { 2 } else { 1 };
            let room = room(e);
            let liked = room + rng.random_range(1..6) + if e == -last { 0 } else { 8 };
            if room >= needed && liked > best.0 {
                best = (liked, e);
            }
        }
        // Straight on where there is no other way; else it ends here.
        if best.0 > 0 {
            (last, d) = (d, best.1);
        } else if !open(lattice, head + d, d) || lattice.gallery(head + d) {
            break;
        }
    }
    if cells.len() < SHORTEST {
        cells.iter().for_each(|&c| take(lattice, c, false));
        return None;
    }
    Some(cells)
}
