//! The kinds of parts and their meshes: each is made once and placed many times.
//!
//! Six systems of pipes, each of two bores, a wide and a narrow one; each bore has three lengths of tube, a bend, a flanged joint,
//! a gate valve, a tee, a blind end and, from wide to narrow, a reducer. Besides them steel beams, and vessels. A part's frame is that
//! of [`super::solid`]; lengths are in cells. Number of triangles: O(sides) for tubes, O(sides^2) for bends and valves.

use std::f32::consts::TAU;

use farfield_core::mesh::TriangleMesh;
use glam::{Affine3A, Vec3};

use crate::generate::solid::{Knot, Paint, Solid, frame};

/// What flows in a pipe: its paint, and radii of the wide and the narrow bore.
pub(super) struct System {
    /// Name in meshes.
    pub(super) name: &'static str,
    /// Radii, scene units.
    pub(super) radii: [f32; 2],
    /// How often it is chosen.
    pub(super) share: u32,
    /// Most pipes of a bundle.
    pub(super) bundle: i32,
    paint: Paint,
    wheel: Paint,
}

const fn system(
    name: &'static str,
    radii: [f32; 2],
    (share, bundle): (u32, i32),
    paint: Paint,
    wheel: Paint,
) -> System {
    System { name, radii, share, bundle, paint, wheel }
}

/// The systems, widest first.
pub(super) const SYSTEMS: [System; 6] = [
    system("steam", [0.36, 0.24], (2, 1), [206, 209, 213], [176, 40, 34]),
    system("process", [0.30, 0.18], (2, 2), [164, 104, 66], [40, 44, 50]),
    system("cooling", [0.24, 0.14], (3, 3), [72, 138, 98], [34, 70, 150]),
    system("fire", [0.17, 0.11], (2, 4), [186, 46, 40], [232, 232, 226]),
    system("gas", [0.14, 0.09], (2, 4), [226, 182, 52], [36, 38, 42]),
    system("air", [0.11, 0.07], (1, 5), [82, 132, 190], [186, 46, 40]),
];

const STEEL: Paint = [118, 121, 126];
const BOLT: Paint = [74, 76, 80];
const BEAM: Paint = [96, 104, 112];
const SHELL: Paint = [224, 220, 206];

/// The pieces that a pipe is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::generate) enum Piece {
    /// Straight, so many cells long, 1 to [`LONGEST`].
    Tube(u8),
    /// From -x to +y.
    Bend,
    /// Two flanges and their bolts.
    Joint,
    /// Its stem along y.
    Valve,
    /// A narrow branch along y.
    Tee,
    /// A blind flange that looks along x.
    End,
    /// From the wide bore to the narrow one, along x.
    Reducer,
}

/// The longest tube or beam, cells.
pub(super) const LONGEST: u8 = 3;

/// A kind of part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::generate) enum Part {
    /// A piece of pipe.
    Pipe {
        /// Index into [`SYSTEMS`].
        system: u8,
        /// Whether it is of the narrow bore.
        narrow: bool,
        /// Which piece.
        piece: Piece,
    },
    /// A double-T beam along x, so many cells long.
    Beam(u8),
    /// A vessel on two saddles: along x, down is -y, 4 x 3 x 3 cells.
    Drum,
    /// A vessel on a skirt at -x, 4 x 3 x 3 cells.
    Tower,
}

/// Families of parts that share their number of sides, so that tubes meet without steps: two bores of each system, and the rest.
pub(super) const FAMILIES: usize = 2 * SYSTEMS.len() + 1;

/// Fewest sides around a pipe.
const FEWEST_SIDES: u32 = 5;

/// Sides of a family at a level of detail: as many as the level says for a pipe of radius 0.2, fewer on narrower ones, so
/// that edges are about as conspicuous on all.
pub(super) fn sides(family: usize, level: u32) -> u32 {
    let radius = SYSTEMS.get(family / 2).map_or(0.36, |s| s.radii[family % 2]);
    ((level as f32 * (radius / 0.2).powf(0.45)).round() as u32).max(FEWEST_SIDES)
}

impl Part {
    /// Its family, below [`FAMILIES`].
    pub(super) fn family(self) -> usize {
        match self {
            Part::Pipe { system, narrow, .. } => 2 * usize::from(system) + usize::from(narrow),
            Part::Beam(_) | Part::Drum | Part::Tower => FAMILIES - 1,
        }
    }

    /// Its mesh's name.
    pub(in crate::generate) fn name(self) -> String {
        match self {
            Part::Pipe { system, narrow, piece } => {
                let bore = if narrow { "narrow" } else { "wide" };
                let piece = match piece {
                    Piece::Tube(cells) => format!("tube {cells}"),
                    Piece::Bend => "bend".into(),
                    Piece::Joint => "joint".into(),
                    Piece::Valve => "valve".into(),
                    Piece::Tee => "tee".into(),
                    Piece::End => "end".into(),
                    Piece::Reducer => "reducer".into(),
                };
                format!("{} {bore} {piece}", SYSTEMS[usize::from(system)].name)
            }
            Part::Beam(cells) => format!("beam {cells}"),
            Part::Drum => "drum".into(),
            Part::Tower => "tower".into(),
        }
    }

    /// Its mesh with `sides` sides around a pipe.
    pub(super) fn mesh(self, sides: u32) -> TriangleMesh {
        let mut solid = Solid::default();
        match self {
            Part::Pipe { system, narrow, piece } => {
                let s = &SYSTEMS[usize::from(system)];
                let pipe = Pipe { radius: s.radii[usize::from(narrow)], sides, paint: s.paint };
                match piece {
                    Piece::Tube(cells) => pipe.tube(&mut solid, f32::from(cells)),
                    Piece::Bend => pipe.bend(&mut solid),
                    Piece::Joint => pipe.joint(&mut solid),
                    Piece::Valve => pipe.valve(&mut solid, s.wheel),
                    Piece::Tee => pipe.tee(&mut solid, s.radii[1]),
                    Piece::End => pipe.end(&mut solid),
                    Piece::Reducer => pipe.reducer(&mut solid, s.radii[1]),
                }
            }
            Part::Beam(cells) => beam(&mut solid, 0.5 * f32::from(cells)),
            Part::Drum => {
                vessel(&mut solid, sides);
                for x in [-1.0, 1.0] {
                    let at = Affine3A::from_translation(Vec3::new(x, -1.15, 0.0));
                    solid.block(at, Vec3::new(0.12, 0.35, 0.85), BEAM);
                }
            }
            Part::Tower => {
                vessel(&mut solid, sides);
                solid.lathe(Affine3A::IDENTITY, sides, BEAM, &[[-2.0, 0.0], [-2.0, 0.9], [-1.4, 0.9]]);
            }
        }
        solid.finish()
    }
}

fn darker(paint: Paint, by: f32) -> Paint {
    paint.map(|c| (f32::from(c) * by) as u8)
}

struct Pipe {
    radius: f32,
    sides: u32,
    paint: Paint,
}

impl Pipe {
    fn tube(&self, out: &mut Solid, cells: f32) {
        let r = self.radius;
        self.lathe(out, self.paint, &[[-0.5 * cells, r], [0.5 * cells, r]]);
    }

    fn lathe(&self, out: &mut Solid, paint: Paint, profile: &[Knot]) {
        out.lathe(Affine3A::IDENTITY, self.sides, paint, profile);
    }

    /// Outer radius of a flange: joints in neighbouring cells stay apart.
    fn flange(&self) -> f32 {
        (1.45 * self.radius + 0.035).min(0.49)
    }

    /// A socket about the end of a pipe of radius `r`, which looks out of the cell along x of `at`: a collar, or a bell where
    /// there are few sides.
    fn socket(&self, out: &mut Solid, at: Affine3A, r: f32) {
        let (low, high) = (0.97 * r, 1.1 * r + 0.01);
        let collar = [[-0.09, low], [-0.09, high], [0.05, high], [0.05, low]];
        let bell = [[-0.12, low], [0.05, high], [0.05, low]];
        let profile: &[Knot] = if self.sides < 14 { &bell } else { &collar };
        out.lathe(at, self.sides, darker(self.paint, 0.86), profile);
    }

    fn bend(&self, out: &mut Solid) {
        out.bend(self.sides, (self.sides / 3).max(2), self.paint, 0.5, self.radius);
        self.socket(out, frame(Vec3::X * -0.5, Vec3::NEG_X, Vec3::Y), self.radius);
        self.socket(out, frame(Vec3::Y * 0.5, Vec3::Y, Vec3::NEG_X), self.radius);
    }

    /// Bolts through two flanges about x = `at`, half a length of `half`.
    fn bolts(&self, out: &mut Solid, at: f32, half: f32) {
        let number = match (self.sides, self.radius) {
            (..8, _) => 0,
            (_, ..0.15) => 4,
            (..12, _) => 6,
            (_, ..0.25) => 8,
            _ => 12,
        };
        let corners = if self.sides < 14 { 4 } else { 6 };
        let ring = 0.5 * (self.radius + self.flange());
        let r = 0.2 * (self.flange() - self.radius).min(0.22);
        for i in 0..number {
            let (s, c) = (TAU * (i as f32 + 0.5) / number as f32).sin_cos();
            let centre = Vec3::new(at, ring * c, ring * s);
            let profile = [[-half, 0.0], [-half, r], [half, r], [half, 0.0]];
            out.lathe(Affine3A::from_translation(centre), corners, BOLT, &profile);
        }
    }

    fn joint(&self, out: &mut Solid) {
        let (r, f) = (self.radius, self.flange());
        let t = 0.03 + 0.12 * r;
        self.tube(out, 1.0);
        let paint = darker(self.paint, 0.72);
        for [a, b] in [[-t, -0.006], [0.006, t]] {
            self.lathe(out, paint, &[[a, 0.97 * r], [a, f], [b, f], [b, 0.97 * r]]);
        }
        self.bolts(out, 0.0, t + 0.035);
    }

    fn end(&self, out: &mut Solid) {
        let (r, f) = (self.radius, self.flange());
        let t = 0.03 + 0.12 * r;
        self.lathe(out, self.paint, &[[-0.5, r], [0.0, r]]);
        self.lathe(out, darker(self.paint, 0.72), &[[-t, 0.97 * r], [-t, f], [-0.006, f], [-0.006, 0.97 * r]]);
        self.lathe(
            out,
            STEEL,
            &[[0.006, 0.97 * r], [0.006, f], [t, f], [t, 0.5 * r], [t + 0.03, 0.4 * r], [t + 0.03, 0.0]],
        );
        self.bolts(out, 0.0, t + 0.035);
    }

    fn tee(&self, out: &mut Solid, narrow: f32) {
        let r = self.radius;
        self.tube(out, 1.0);
        let up = frame(Vec3::ZERO, Vec3::Y, Vec3::NEG_X);
        let collar = (1.25 * narrow).min(1.05 * r);
        out.lathe(
            up,
            self.sides,
            self.paint,
            &[[0.5 * r, collar], [r + 0.03, collar], [r + 0.08, narrow], [0.5, narrow]],
        );
        self.socket(out, frame(Vec3::X * -0.5, Vec3::NEG_X, Vec3::Y), r);
        self.socket(out, frame(Vec3::X * 0.5, Vec3::X, Vec3::Y), r);
        self.socket(out, frame(Vec3::Y * 0.5, Vec3::Y, Vec3::NEG_X), narrow);
    }

    fn reducer(&self, out: &mut Solid, narrow: f32) {
        let r = self.radius;
        self.lathe(out, self.paint, &[[-0.5, r], [-0.28, r], [0.28, narrow], [0.5, narrow]]);
        self.socket(out, frame(Vec3::X * -0.5, Vec3::NEG_X, Vec3::Y), r);
        self.socket(out, frame(Vec3::X * 0.5, Vec3::X, Vec3::Y), narrow);
    }

    /// A gate valve: ball-shaped body between flanges, bonnet, stem, hand wheel with three spokes.
    fn valve(&self, out: &mut Solid, wheel: Paint) {
        let (r, f) = (self.radius, self.flange());
        let body = (1.4 * r + 0.03).min(0.46);
        let paint = darker(self.paint, 0.72);
        self.tube(out, 1.0);
        let arcs = (self.sides / 3).max(2);
        let ball: Vec<Knot> = (0..=arcs)
            .map(|i| {
                let (s, c) = (std::f32::consts::PI * (0.12 + 0.76 * i as f32 / arcs as f32)).sin_cos();
                [-c * body * 0.62, s * body]
            })
            .collect();
        self.lathe(out, paint, &ball);
        for [a, b] in [[-0.4, -0.34], [0.34, 0.4]] {
            self.lathe(out, paint, &[[a, 0.97 * r], [a, f], [b, f], [b, 0.97 * r]]);
        }
        let up = frame(Vec3::ZERO, Vec3::Y, Vec3::NEG_X);
        let neck = 0.55 * body;
        let top = body + 0.1 + 0.4 * r;
        let bonnet = [
            [0.7 * body, neck],
            [body + 0.03, neck],
            [body + 0.03, 1.35 * neck],
            [body + 0.07, 1.35 * neck],
            [body + 0.07, 0.8 * neck],
            [top, 0.45 * neck],
            [top, 0.0],
        ];
        out.lathe(up, self.sides, paint, &bonnet);
        let high = top + 0.12 + 0.2 * r;
        let stem = 0.02 + 0.06 * r;
        out.lathe(up, (self.sides / 2).max(4), STEEL, &[[top, stem], [high + 0.06, stem], [high + 0.06, 0.0]]);
        let round = 0.08 + 0.75 * r;
        let thick = 0.012 + 0.07 * r;
        let at = Affine3A::from_translation(Vec3::Y * high);
        out.ring_wheel(at, (self.sides / 3).max(3), self.sides + 2, wheel, [round, thick]);
        for i in 0..3 {
            let turned = at * Affine3A::from_rotation_y(TAU * i as f32 / 3.0);
            let spoke = turned * Affine3A::from_translation(Vec3::X * 0.5 * round);
            out.block(spoke, Vec3::new(0.5 * round, 0.6 * thick, 0.7 * thick), wheel);
        }
    }
}

/// Two flanges and a web, along x.
fn beam(out: &mut Solid, half: f32) {
    for y in [-0.12, 0.12] {
        out.block(Affine3A::from_translation(Vec3::Y * y), Vec3::new(half, 0.018, 0.11), BEAM);
    }
    out.block(Affine3A::IDENTITY, Vec3::new(half, 0.102, 0.014), BEAM);
}

/// Where the nozzles of a vessel are: x, in cells from its middle.
pub(super) const NOZZLE_X: f32 = -0.5;

/// A shell with dished ends, hoops, and nozzles along y and z, each ready for a pipe or closed.
fn vessel(out: &mut Solid, sides: u32) {
    let round = 2 * sides;
    let arcs = (sides / 3).max(2);
    let dish = |i: u32| {
        let (s, c) = (std::f32::consts::FRAC_PI_2 * i as f32 / arcs as f32).sin_cos();
        [1.25 + 0.55 * c, 1.2 * s]
    };
    let mut profile: Vec<Knot> = (0..=arcs)
        .map(|i| {
            let [x, r] = dish(i);
            [-x, r]
        })
        .collect();
    profile.extend((0..=arcs).rev().map(dish));
    out.lathe(Affine3A::IDENTITY, round, SHELL, &profile);
    for x in [-1.25, 0.35, 1.25] {
        let hoop = [[x - 0.05, 1.19], [x - 0.05, 1.24], [x + 0.05, 1.24], [x + 0.05, 1.19]];
        out.lathe(Affine3A::IDENTITY, round, STEEL, &hoop);
    }
    for d in [Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
        let at = frame(Vec3::X * NOZZLE_X, d, Vec3::X);
        let nozzle = [[1.1, 0.22], [1.4, 0.22], [1.4, 0.42], [1.5, 0.42], [1.5, 0.0]];
        out.lathe(at, sides, STEEL, &nozzle);
    }
}
