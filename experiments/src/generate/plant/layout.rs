//! What stands where: a grid of columns 10 m apart, a storey each 5 m, and a lattice of metres that says what is taken.
//!
//! Lines of columns lie at multiples of 10 m; along each, on its far side, runs a corridor 2 m wide that belongs to walkways on every
//! storey, and what is left of a bay, 7 m square, to one machine, to pipes or to nothing. The boiler takes 16 x 16 m and 13 storeys, so that
//! corridors run along its four walls. All corridors of the storey of the route are laid; on others the share of walkways and of
//! machines goes with the total.

use glam::{DAffine3, IVec3, Vec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::boiler::{self, HALF, PANEL, STOREY};
use super::machines;
use super::model::{Placed, part, put};
use super::steel::{self, WIDE};

/// Bays along an edge, and storeys.
const BAYS: i32 = 6;
const STOREYS: i32 = 16;
const BAY: f32 = 10.0;
/// Half the plant's width.
const EDGE: f32 = 30.0;
/// The storey of the route.
pub(super) const ROUTE_STOREY: i32 = 6;
/// The middle of the boiler.
const BOILER: Vec3 = Vec3::new(-9.0, 0.0, 1.0);
/// The middle of the stack.
const STACK: [f32; 2] = [26.0, -24.0];

/// Which metres of the plant are taken: x, y, z from the low corner.
pub(super) struct Space {
    taken: Vec<bool>,
}

/// Cells of the lattice along x, y, z.
pub(super) const CELLS: IVec3 = IVec3::new(60, 80, 60);

impl Space {
    fn index(c: IVec3) -> Option<usize> {
        let inside = c.cmpge(IVec3::ZERO).all() && c.cmplt(CELLS).all();
        inside.then(|| ((c.y * CELLS.z + c.z) * CELLS.x + c.x) as usize)
    }

    /// Whether a cell is taken.
    pub(super) fn taken(&self, c: IVec3) -> bool {
        Self::index(c).is_none_or(|i| self.taken[i])
    }

    fn cells(low: Vec3, high: Vec3) -> impl Iterator<Item = IVec3> {
        let off = Vec3::new(EDGE, 0.0, EDGE);
        let (a, b) = ((low + off + 1e-3).floor().as_ivec3(), (high + off - 1e-3).ceil().as_ivec3());
        (a.y..b.y).flat_map(move |y| (a.z..b.z).flat_map(move |z| (a.x..b.x).map(move |x| IVec3::new(x, y, z))))
    }

    /// Takes a box.
    fn take(&mut self, low: Vec3, high: Vec3) {
        Self::cells(low, high).filter_map(Self::index).for_each(|i| self.taken[i] = true);
    }

    /// Whether a box is free.
    fn free(&self, low: Vec3, high: Vec3) -> bool {
        Self::cells(low, high).all(|c| !self.taken(c))
    }
}

/// A line's coordinate.
fn line(k: i32) -> f32 {
    BAY * k as f32 - EDGE
}

fn floor_of(storey: i32) -> f32 {
    STOREY * storey as f32
}

/// The parts, and what of the plant they take. `share` of walkways and machines, 0..1.
pub(super) fn layout(share: f64, rng: &mut ChaCha8Rng) -> (Vec<Placed>, Space) {
    let mut space = Space { taken: vec![false; CELLS.element_product() as usize] };
    let mut out = vec![];
    frame(&mut out, &mut space);
    fire(&mut out, &mut space);
    flue(&mut out, &mut space);
    heavy(&mut out, &mut space);
    walkways(&mut out, &mut space, share, rng);
    bays(&mut out, &mut space, share, rng);
    (out, space)
}

/// Ground, columns, beams, and cladding to the north and west.
fn frame(out: &mut Vec<Placed>, space: &mut Space) {
    let half = EDGE + 4.0;
    out.push(part("ground", vec![DAffine3::IDENTITY], move |s, level| {
        let n = 8 + 2 * level;
        let edge = 2.0 * half / n as f32;
        for j in 0..n {
            for i in 0..n {
                let c = Vec3::new((i as f32 + 0.5) * edge - half, -0.25, (j as f32 + 0.5) * edge - half);
                let tone = 138 + (20.0 * crate::generate::noise::unit(i as i32, j as i32, 3)) as u8;
                s.block(
                    glam::Affine3A::from_translation(c),
                    Vec3::new(0.5 * edge, 0.25, 0.5 * edge),
                    [tone, tone, tone - 6],
                );
            }
        }
    }));
    let all = || (0..=BAYS).flat_map(|i| (0..=BAYS).map(move |j| (i, j)));
    let inside = |i: i32, j: i32| {
        let (x, z) = (line(i) - BOILER.x, line(j) - BOILER.z);
        x.abs() < HALF + 1.0 && z.abs() < HALF + 1.0
    };
    let mut columns = vec![];
    let (mut across, mut along) = (vec![], vec![]);
    for (i, j) in all() {
        let own = !inside(i, j);
        let (x, z) = (line(i) - 0.5, line(j) - 0.5);
        if own {
            columns.extend((0..STOREYS / 2).map(|k| put(x, 2.0 * floor_of(k), z, 0)));
            space.take(Vec3::new(x - 0.5, 0.0, z - 0.5), Vec3::new(x + 0.5, 80.0, z + 0.5));
        }
        for storey in 1..=STOREYS {
            let y = floor_of(storey) - 0.16;
            let (right, down) = (i < BAYS && own && !inside(i + 1, j), j < BAYS && own && !inside(i, j + 1));
            if right {
                across.push(put(x + 5.0, y, z, 0));
                space.take(Vec3::new(x, y - 0.5, z - 0.5), Vec3::new(x + 10.0, y, z + 0.5));
            }
            if down {
                along.push(put(x, y, z + 5.0, 1));
                space.take(Vec3::new(x - 0.5, y - 0.5, z), Vec3::new(x + 0.5, y, z + 10.0));
            }
        }
    }
    out.push(part("column", columns, |s, level| steel::column(s, level, 10.0)));
    across.extend(along);
    out.push(part("beam", across, |s, level| steel::beam(s, level, 9.98, 0.45)));
    // Two walls from the eighth storey up: around the bunkers.
    let mut sheets = vec![];
    for i in 0..BAYS {
        let middle = line(i) + 4.5;
        for storey in 8..STOREYS {
            let y = floor_of(storey);
            sheets.push(put(middle, y, -EDGE - 0.85, 2));
            sheets.push(put(-EDGE - 0.85, y, middle, 3));
        }
    }
    out.push(part("cladding", sheets, steel::cladding));
}

/// The boiler.
fn fire(out: &mut Vec<Placed>, space: &mut Space) {
    let c = BOILER;
    space.take(c - Vec3::new(HALF + 0.6, 0.0, HALF + 0.6), c + Vec3::new(HALF + 0.6, 79.0, HALF + 0.6));
    let (low, high) = (7.0, 67.0);
    let storeys = ((high - low) / STOREY) as i32;
    // A wall's frame: its middle, and the turn that makes it look outwards.
    let walls = [(0.0, 1.0, 0), (1.0, 0.0, 1), (0.0, -1.0, 2), (-1.0, 0.0, 3)];
    let (mut panels, mut stays, mut headers) = (vec![], vec![], vec![]);
    for &(nx, nz, quarters) in &walls {
        let middle = c + Vec3::new(nx, 0.0, nz) * HALF;
        let side = Vec3::new(nz, 0.0, -nx);
        for k in 0..storeys {
            let y = low + STOREY * k as f32;
            for p in 0..4 {
                let at = middle + side * PANEL * (p as f32 - 1.5);
                panels.push(put(at.x, y, at.z, quarters));
            }
            stays.push(put(middle.x, y + 2.5, middle.z, quarters));
        }
        headers.push(put(middle.x, low - 0.7, middle.z, quarters));
        headers.push(put(middle.x, high + 0.2, middle.z, quarters));
    }
    out.push(part("tube wall", panels, boiler::panel));
    out.push(part("buckstay", stays, boiler::buckstay));
    out.push(part("wall header", headers, boiler::header));
    out.push(part("hopper", vec![put(c.x, 0.0, c.z, 0)], boiler::hopper));
    out.push(part("boiler roof", vec![put(c.x, high, c.z, 0)], |s, level| {
        super::model::bar(s, [-HALF, -0.1, -HALF], [HALF, 0.2, HALF], [110, 100, 92]);
        for k in 0..(4 + level) {
            let x = -HALF + 2.0 * HALF * (k as f32 + 0.5) / (4 + level) as f32;
            super::model::bar(s, [x - 0.1, 0.2, -HALF], [x + 0.1, 0.6, HALF], [112, 124, 136]);
        }
    }));
    out.push(part("steam drum", vec![put(c.x, 72.0, c.z, 0)], boiler::drum));
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)];
    let places = |(x, z): (f32, f32)| (1..14).map(move |k| put(c.x + x * (HALF - 0.9), floor_of(k), c.z + z * HALF, 0));
    let down = corners.into_iter().flat_map(places).collect();
    out.push(part("downcomer", down, boiler::downcomer));
    let rows = (0..3).map(|k| put(c.x, 14.5 + STOREY * k as f32, c.z + HALF, 0));
    let rear = (0..3).map(|k| put(c.x, 14.5 + STOREY * k as f32, c.z - HALF, 2));
    out.push(part("burners", rows.chain(rear).collect(), boiler::burners));
    for side in [-1.0, 1.0] {
        let z = c.z + side * (HALF + 1.5);
        space.take(Vec3::new(c.x - 7.5, 9.0, z - 1.0), Vec3::new(c.x + 7.5, 29.0, z + 1.0));
    }
}

/// Ducts from the boiler to the stack, and the stack.
fn flue(out: &mut Vec<Placed>, space: &mut Space) {
    let [x, z] = STACK;
    let rings = |banded: bool| (0..16).filter(move |k| (*k >= 12 && k % 2 == 0) == banded);
    out.push(part("stack", rings(false).map(|k| put(x, floor_of(k), z, 0)).collect(), |s, l| {
        boiler::stack(s, l, false)
    }));
    out.push(part("stack, red", rings(true).map(|k| put(x, floor_of(k), z, 0)).collect(), |s, l| {
        boiler::stack(s, l, true)
    }));
    out.push(part("stack mouth", vec![put(x, 80.0, z, 0)], boiler::mouth));
    space.take(Vec3::new(x - 3.0, 0.0, z - 3.0), Vec3::new(x + 3.0, 80.0, z + 3.0));
    // High out of the boiler to the east, down beside it, low to the stack.
    let (dx, dz) = (6.0, -4.2);
    let upright = |y: f32| {
        DAffine3::from_translation(glam::DVec3::new(dx.into(), y.into(), dz.into()))
            * DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2)
    };
    let falls: Vec<DAffine3> = (3..12).map(|k| upright(floor_of(k) + 2.5)).collect();
    out.push(part("duct, upright", falls, |s, l| machines::duct(s, l, 5.0, 4.4)));
    space.take(Vec3::new(dx - 2.5, 10.0, dz - 2.5), Vec3::new(dx + 2.5, 65.0, dz + 2.5));
    let flat = vec![put(1.4, 62.3, dz, 0), put(10.9, 12.7, dz, 0), put(20.9, 12.7, dz, 0)];
    for p in &flat {
        let c = p.translation.as_vec3();
        space.take(c - Vec3::new(5.0, 2.4, 2.4), c + Vec3::new(5.0, 2.4, 2.4));
    }
    out.push(part("duct", flat, |s, l| machines::duct(s, l, 9.9, 4.4)));
    let last = vec![put(26.0, 12.7, -7.0, 1), put(26.0, 12.7, -16.9, 1)];
    for p in &last {
        let c = p.translation.as_vec3();
        space.take(c - Vec3::new(2.4, 2.4, 5.0), c + Vec3::new(2.4, 2.4, 5.0));
    }
    out.push(part("duct to the stack", last, |s, l| machines::duct(s, l, 9.9, 4.4)));
}

/// Turbines and mills on the ground, bunkers above the mills.
fn heavy(out: &mut Vec<Placed>, space: &mut Space) {
    let turbines = [(-10.0, 25.6), (11.0, 25.6)];
    for (x, z) in turbines {
        space.take(Vec3::new(x - 9.0, 0.0, z - 3.0), Vec3::new(x + 9.0, 9.5, z + 3.0));
    }
    out.push(part("turbine", turbines.map(|(x, z)| put(x, 0.0, z, 0)).to_vec(), machines::turbine));
    let mills = [(-24.2, -14.2), (-24.2, -4.2), (-24.2, 5.8), (-24.2, 15.8)];
    for (x, z) in mills {
        space.take(Vec3::new(x - 3.4, 0.0, z - 3.0), Vec3::new(x + 3.4, 10.0, z + 3.0));
        space.take(Vec3::new(x - 3.2, 35.0, z - 3.2), Vec3::new(x + 3.2, 50.0, z + 3.2));
    }
    out.push(part("coal mill", mills.map(|(x, z)| put(x, 0.0, z, 0)).to_vec(), machines::mill));
    out.push(part("coal bunker", mills.map(|(x, z)| put(x, 35.0, z, 0)).to_vec(), machines::bunker));
}

/// Gratings with railings and cable trays along the corridors, and stair towers.
fn walkways(out: &mut Vec<Placed>, space: &mut Space, share: f64, rng: &mut ChaCha8Rng) {
    let (mut gratings, mut nodes, mut rails, mut trays) = (vec![], vec![], vec![], vec![]);
    for storey in 1..STOREYS {
        let y = floor_of(storey);
        let keep = if storey == ROUTE_STOREY { 1.0 } else { share };
        let mut used = [[false; BAYS as usize]; BAYS as usize];
        for i in 0..BAYS {
            for j in 0..BAYS {
                for turn in 0..2 {
                    // The middle of the 8 m after the node, along x or along z.
                    let (x, z) =
                        if turn == 0 { (line(i) + 6.0, line(j) + 1.0) } else { (line(i) + 1.0, line(j) + 6.0) };
                    let half = if turn == 0 { Vec3::new(4.0, 0.0, 1.0) } else { Vec3::new(1.0, 0.0, 4.0) };
                    let (low, high) = (Vec3::new(x, y, z) - half, Vec3::new(x, y + 3.0, z) + half);
                    if !rng.random_bool(keep) || !space.free(low, high) {
                        continue;
                    }
                    let quarters = if turn == 0 { 0 } else { 1 };
                    gratings.push(put(x, y, z, quarters));
                    used[i as usize][j as usize] = true;
                    let (ni, nj) = if turn == 0 { (i + 1, j) } else { (i, j + 1) };
                    if ni < BAYS && nj < BAYS {
                        used[ni as usize][nj as usize] = true;
                    }
                    let side = 0.5 * WIDE - 0.04;
                    for o in [-side, side] {
                        let (rx, rz) = if turn == 0 { (x, z + o) } else { (x + o, z) };
                        rails.push(put(rx, y, rz, quarters));
                    }
                    if (i + j) % 2 == 0 {
                        trays.push(put(x, y + 4.3, z, quarters));
                        space.take(low + Vec3::Y * 3.2, high + Vec3::Y * 1.3);
                    }
                }
            }
        }
        for (i, row) in used.iter().enumerate() {
            for (j, _) in row.iter().enumerate().filter(|u| *u.1) {
                nodes.push(put(line(i as i32) + 1.0, y, line(j as i32) + 1.0, 0));
            }
        }
    }
    let placed: Vec<(DAffine3, f32)> =
        gratings.iter().map(|&p| (p, 4.0)).chain(nodes.iter().map(|&p| (p, 1.0))).collect();
    for (p, long) in placed {
        let c = p.translation.as_vec3();
        let turned = p.transform_vector3(glam::DVec3::X).x.abs() < 0.5;
        let half = if turned { Vec3::new(1.0, 0.0, long) } else { Vec3::new(long, 0.0, 1.0) };
        space.take(c - half - Vec3::Y * 0.2, c + half + Vec3::Y * 3.0);
    }
    out.push(part("grating", gratings, |s, level| steel::grating(s, level, 8.0)));
    out.push(part("grating, crossing", nodes, |s, level| steel::grating(s, level, 2.0)));
    out.push(part("railing", rails, |s, level| steel::railing(s, level, 7.9)));
    out.push(part("cable trays", trays, |s, level| steel::trays(s, level, 8.0)));
    let mut towers = vec![];
    for storey in 0..STOREYS - 1 {
        let y = floor_of(storey);
        for (x, z, from) in [(25.9, 15.9, 0.0), (-14.2, -24.2, 0.3)] {
            let (low, high) = (Vec3::new(x - 3.6, y, z - 1.6), Vec3::new(x + 2.4, y + 5.0, z + 1.6));
            if (storey == 0 || rng.random_bool((share + from).min(1.0))) && space.free(low, high) {
                space.take(low, high);
                towers.push(put(x, y, z, 0));
            }
        }
    }
    out.push(part("stairs", towers, steel::stairs));
}

/// Machines in the bays that are free.
fn bays(out: &mut Vec<Placed>, space: &mut Space, share: f64, rng: &mut ChaCha8Rng) {
    let mut kinds: [Vec<DAffine3>; 8] = Default::default();
    let mut floors = vec![];
    for storey in 0..STOREYS - 1 {
        for i in 0..BAYS {
            for j in 0..BAYS {
                let (x, z, y) = (line(i) + 5.8, line(j) + 5.8, floor_of(storey));
                let (low, high) = (Vec3::new(x - 3.4, y, z - 3.4), Vec3::new(x + 3.4, y + 4.0, z + 3.4));
                let (kind, quarters) = (rng.random_range(0..11), rng.random_range(0..4));
                // Near the boiler and on the route's storey machines are denser.
                let near = (x - BOILER.x).abs().max((z - BOILER.z).abs()) < 20.0 && (storey - ROUTE_STOREY).abs() < 3;
                let keep = if near { share.powf(0.6) } else { share };
                if !rng.random_bool(keep) || kind >= kinds.len() || !space.free(low, high) {
                    continue;
                }
                let tall = kind == 1 && space.free(low, high + Vec3::Y * 5.0) && storey + 2 < STOREYS;
                let top = if tall { high + Vec3::Y * 5.0 } else { high };
                space.take(low - Vec3::Y * 0.3, top);
                if storey > 0 {
                    floors.push(put(x, y, z, 0));
                }
                let kind = if kind == 1 && !tall { 0 } else { kind };
                kinds[kind].push(put(x, y, z, quarters));
            }
        }
    }
    out.push(part("floor", floors, |s, level| steel::floor(s, level, 7.4)));
    let [low, high, exchangers, pumps, banks, headers, cabinets, fans] = kinds;
    out.push(part("tank", low, |s, l| machines::tank(s, l, 2.2, 3.9, [206, 206, 200])));
    out.push(part("tall tank", high, |s, l| machines::tank(s, l, 2.4, 8.4, [120, 156, 140])));
    out.push(part("heat exchanger", exchangers, machines::exchanger));
    out.push(part("pumps", pumps, machines::pumps));
    out.push(part("tube bank", banks, machines::bank));
    out.push(part("headers", headers, machines::headers));
    out.push(part("cabinets", cabinets, machines::cabinets));
    out.push(part("fan", fans, machines::fan));
}

/// A closed way along the corridors of the route's storey: beside the boiler, through the densest bays, and along the perimeter.
pub(super) const ROUTE: [[f32; 2]; 10] = [
    [1.0, -9.0],
    [1.0, 11.0],
    [11.0, 11.0],
    [11.0, 1.0],
    [21.0, 1.0],
    [21.0, -19.0],
    [-29.0, -19.0],
    [-29.0, 11.0],
    [-19.0, 11.0],
    [-19.0, -9.0],
];
