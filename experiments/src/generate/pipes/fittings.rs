//! From the cells of a pipe to its parts: bends where it turns, tees where pipes branch off, fittings here and there, and tubes
//! between them. O(cells).

use glam::{DAffine3, DMat3, DVec3, IVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lattice::{BAY, DIRECTIONS, Lattice};
use super::parts::{LONGEST, Part, Piece};
use super::route::{Line, Vessel};

/// Chances that a straight cell with a straight one before it holds a joint, a valve, a reducer.
const JOINT: f64 = 0.22;
const VALVE: f64 = 0.1;
const REDUCER: f64 = 0.03;

/// A part and its place.
pub(in crate::generate) type Placed = (Part, DAffine3);

/// The transform of a part whose x and y axes point along `x` and `y`.
fn place(middle: DVec3, x: IVec3, y: IVec3) -> DAffine3 {
    let (x, y) = (x.as_dvec3(), y.as_dvec3());
    DAffine3::from_mat3_translation(DMat3::from_cols(x, y, x.cross(y)), middle)
}

/// A direction across `d`; the same one for both ways along an axis.
fn side(d: IVec3) -> IVec3 {
    if d.y == 0 { IVec3::Y } else { IVec3::X }
}

/// Columns along the height, beams along the floors of levels.
pub(super) fn frame(lattice: &Lattice) -> Vec<Placed> {
    let size = lattice.size;
    let mut out = vec![];
    let mut run = |low: IVec3, axis: usize, length: i32, sink: f64| {
        let d = IVec3::AXES[axis];
        for at in (0..length).step_by(usize::from(LONGEST)) {
            let cells = i32::from(LONGEST).min(length - at);
            let extent = IVec3::ONE + d * (cells - 1);
            let middle = lattice.middle(low + d * at, extent) - DVec3::Y * sink;
            out.push((Part::Beam(cells as u8), place(middle, d, side(d))));
        }
    };
    for (x, z) in lattice.columns() {
        run(IVec3::new(x, 0, z), 1, size.y, 0.0);
    }
    for y in lattice.levels() {
        for row in (0..size.z).step_by(BAY as usize) {
            run(IVec3::new(0, y, row), 0, size.x, 0.42);
        }
        for row in (0..size.x).step_by(BAY as usize) {
            run(IVec3::new(row, y, 0), 2, size.z, 0.42);
        }
    }
    out
}

/// Drums and towers.
pub(super) fn vessel(lattice: &Lattice, v: &Vessel) -> Placed {
    let middle = lattice.middle(v.low, v.cells);
    if v.cells.y == 4 {
        (Part::Tower, place(middle, IVec3::Y, IVec3::X))
    } else {
        let d = if v.cells.x == 4 { IVec3::X } else { IVec3::Z };
        (Part::Drum, place(middle, d, IVec3::Y))
    }
}

/// The parts of a pipe; the cells that stems of valves reach into are taken.
pub(super) fn pipe(lattice: &mut Lattice, line: &Line, rng: &mut ChaCha8Rng) -> Vec<Placed> {
    let mut out = vec![];
    let mut narrow = line.narrow;
    let last = line.cells.len() - 1;
    // Straight cells that wait to become a tube: the first one, and how many.
    let mut waiting: (usize, i32) = (0, 0);
    let flush = |out: &mut Vec<Placed>, waiting: &mut (usize, i32), narrow: bool, lattice: &Lattice| {
        if waiting.1 > 0 {
            let (_, d) = line.through(waiting.0);
            let (a, b) = (line.cells[waiting.0], line.cells[waiting.0 + waiting.1 as usize - 1]);
            let middle = lattice.middle(a.min(b), (a - b).abs() + IVec3::ONE);
            let part = Part::Pipe { system: line.system, narrow, piece: Piece::Tube(waiting.1 as u8) };
            // Along the axis, not along the flow: tubes that meet have their sides at the same angles.
            out.push((part, place(middle, d.abs(), side(d))));
        }
        waiting.1 = 0;
    };
    for (i, &cell) in line.cells.iter().enumerate() {
        let (into, onward) = line.through(i);
        let middle = lattice.middle(cell, IVec3::ONE);
        let part = |narrow, piece| Part::Pipe { system: line.system, narrow, piece };
        let tee = line.tees.iter().find(|t| t.0 == i);
        let (piece, at) = if i == 0 && line.from.is_none() {
            (Piece::End, place(middle, -onward, side(onward)))
        } else if i == last {
            (Piece::End, place(middle, into, side(into)))
        } else if into != onward {
            (Piece::Bend, place(middle, into, onward))
        } else if let Some(&(_, d)) = tee {
            (Piece::Tee, place(middle, into, d))
        } else {
            let quiet = waiting.1 == 0 || lattice.gallery(cell);
            let chance = if quiet { 1.0 } else { rng.random_range(0.0..1.0) };
            let stem = (chance < VALVE).then(|| stem(lattice, cell, into, rng)).flatten();
            if let Some(up) = stem {
                lattice.take(cell + up, true);
                (Piece::Valve, place(middle, into, up))
            } else if (VALVE..VALVE + JOINT).contains(&chance) {
                (Piece::Joint, place(middle, into, side(into)))
            } else if (VALVE + JOINT..VALVE + JOINT + REDUCER).contains(&chance) && !narrow {
                (Piece::Reducer, place(middle, into, side(into)))
            } else {
                if waiting.1 == 0 {
                    waiting.0 = i;
                }
                waiting.1 += 1;
                if waiting.1 == i32::from(LONGEST) {
                    flush(&mut out, &mut waiting, narrow, lattice);
                }
                continue;
            }
        };
        flush(&mut out, &mut waiting, narrow, lattice);
        out.push((part(narrow, piece), at));
        narrow |= piece == Piece::Reducer;
    }
    flush(&mut out, &mut waiting, narrow, lattice);
    out
}

/// Where a valve's stem may point: up if it can.
fn stem(lattice: &Lattice, cell: IVec3, d: IVec3, rng: &mut ChaCha8Rng) -> Option<IVec3> {
    let first = rng.random_range(0..6);
    let turns = [IVec3::Y].into_iter().chain((0..6).map(|k| DIRECTIONS[(first + k) % 6]));
    let fits = |&u: &IVec3| u.dot(d) == 0 && lattice.free(cell + u) && !lattice.gallery(cell + u);
    turns.into_iter().find(fits)
}
