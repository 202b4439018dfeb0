//! The floor plan: rooms, walls with their doors and windows, and the light that windows let in.
//!
//! x goes east, z south, y up; metres; the floor is y = 0. Rooms are bounded by the walls' middle lines. A wall that ends at
//! another ends inside it, or, outside corners, exactly at its face, so that no two faces lie in one plane.

use glam::{Vec2, Vec3};

/// Height of rooms.
pub(super) const HIGH: f32 = 2.6;
/// Thickness of outside walls and of those between rooms.
pub(super) const THICK: [f32; 2] = [0.3, 0.12];
/// East and south walls' middle lines; the others are at 0.
pub(super) const SIZE: Vec2 = Vec2::new(15.0, 11.0);
/// Height of door openings.
pub(super) const DOOR: f32 = 2.08;
/// Doors' openings start below the floor, so that no part of the wall lies in the floor's plane.
const SUNK: f32 = -0.05;
/// The ground outside.
pub(super) const GROUND: f32 = -0.15;

/// A room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Room {
    /// Kitchen and dining table, north-west.
    Kitchen,
    /// Bathroom.
    Bath,
    /// The parents' bedroom.
    Bedroom,
    /// The child's bedroom, north-east.
    Nursery,
    /// From the front door in the east to the kitchen.
    Hall,
    /// Living room, south-west.
    Living,
    /// Study.
    Study,
    /// Music room, south-east.
    Music,
}

impl Room {
    /// All.
    pub(super) const ALL: [Room; 8] =
        [Room::Kitchen, Room::Bath, Room::Bedroom, Room::Nursery, Room::Hall, Room::Living, Room::Study, Room::Music];

    /// Lowest and highest (x, z), to the walls' middle lines.
    pub(super) fn extent(self) -> [Vec2; 2] {
        let [a, b, c, d] = match self {
            Room::Kitchen => [0.0, 0.0, 4.6, 6.0],
            Room::Bath => [4.6, 0.0, 7.2, 4.4],
            Room::Bedroom => [7.2, 0.0, 11.2, 4.4],
            Room::Nursery => [11.2, 0.0, 15.0, 4.4],
            Room::Hall => [4.6, 4.4, 15.0, 6.0],
            Room::Living => [0.0, 6.0, 8.4, 11.0],
            Room::Study => [8.4, 6.0, 11.6, 11.0],
            Room::Music => [11.6, 6.0, 15.0, 11.0],
        };
        [Vec2::new(a, b), Vec2::new(c, d)]
    }

    /// Lowest and highest (x, z) inside its walls.
    pub(super) fn inside(self) -> [Vec2; 2] {
        let [low, high] = self.extent();
        let off = |v: f32, rim: f32| 0.5 * if v == 0.0 || v == rim { THICK[0] } else { THICK[1] };
        [
            low + Vec2::new(off(low.x, SIZE.x), off(low.y, SIZE.y)),
            high - Vec2::new(off(high.x, SIZE.x), off(high.y, SIZE.y)),
        ]
    }

    /// The room at a point; `None` outside.
    pub(super) fn at(p: Vec2) -> Option<Room> {
        Room::ALL.into_iter().find(|r| {
            let [low, high] = r.extent();
            p.cmpge(low).all() && p.cmple(high).all()
        })
    }

    /// Its name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Room::Kitchen => "kitchen",
            Room::Bath => "bathroom",
            Room::Bedroom => "bedroom",
            Room::Nursery => "nursery",
            Room::Hall => "hall",
            Room::Living => "living room",
            Room::Study => "study",
            Room::Music => "music room",
        }
    }
}

/// A hole in a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Opening {
    /// From and to along the wall's axis.
    pub(super) span: [f32; 2],
    /// Lowest and highest y.
    pub(super) rise: [f32; 2],
}

impl Opening {
    /// Whether one walks through.
    pub(super) fn door(&self) -> bool {
        self.rise[0] < 0.0
    }
}

/// A wall.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wall {
    /// Whether it runs along x; else along z.
    pub(super) along_x: bool,
    /// Its middle line: z, or x.
    pub(super) line: f32,
    /// From and to along its axis.
    pub(super) span: [f32; 2],
    /// Its thickness.
    pub(super) thick: f32,
    /// Its doors and windows.
    pub(super) openings: Vec<Opening>,
}

impl Wall {
    /// A point by distance along the wall, height, and distance from the middle line to higher z or x.
    pub(super) fn point(&self, s: f32, y: f32, off: f32) -> Vec3 {
        if self.along_x { Vec3::new(s, y, self.line + off) } else { Vec3::new(self.line + off, y, s) }
    }

    /// Whether it is an outside wall.
    pub(super) fn outside(&self) -> bool {
        self.thick == THICK[0]
    }
}

fn door(from: f32, width: f32) -> Opening {
    Opening { span: [from, from + width], rise: [SUNK, DOOR] }
}

fn window(from: f32, to: f32, sill: f32) -> Opening {
    Opening { span: [from, to], rise: [sill, 2.14] }
}

/// The walls.
pub(super) fn walls() -> Vec<Wall> {
    let [out, inner] = THICK;
    let half = 0.5 * out;
    let wall = |along_x, line, span: [f32; 2], thick, openings: &[Opening]| Wall {
        along_x,
        line,
        span,
        thick,
        openings: openings.to_vec(),
    };
    let (w, d) = (SIZE.x, SIZE.y);
    vec![
        wall(
            true,
            0.0,
            [-half, w + half],
            out,
            &[window(1.5, 3.1, 1.08), window(5.5, 6.3, 1.45), window(8.3, 10.1, 0.9), window(12.2, 14.0, 0.9)],
        ),
        wall(
            true,
            d,
            [-half, w + half],
            out,
            &[door(2.9, 2.0), window(6.0, 7.8, 0.5), window(9.2, 10.8, 0.9), window(12.3, 14.1, 0.9)],
        ),
        wall(false, 0.0, [half, d - half], out, &[window(3.6, 5.2, 0.9), window(7.5, 9.7, 0.5)]),
        wall(false, w, [half, d - half], out, &[window(1.4, 2.8, 0.9), door(4.75, 0.95), window(7.6, 9.4, 0.9)]),
        wall(true, 4.4, [4.6, w], inner, &[door(5.45, 0.9), door(8.7, 0.9), door(12.4, 0.9)]),
        wall(true, 6.0, [0.0, w], inner, &[door(1.4, 1.6), door(5.9, 1.5), door(9.6, 0.9), door(12.8, 0.9)]),
        wall(false, 4.6, [0.0, 6.0], inner, &[door(4.75, 0.95)]),
        wall(false, 7.2, [0.0, 4.4], inner, &[]),
        wall(false, 11.2, [0.0, 4.4], inner, &[]),
        wall(false, 8.4, [6.0, d], inner, &[]),
        wall(false, 11.6, [6.0, d], inner, &[]),
    ]
}

/// A closed walk through all rooms, corners (x, z): free of furniture by at least 0.2 m, at eye height.
pub(super) const ROUTE: [[f32; 2]; 38] = [
    [6.65, 5.2],
    [6.65, 6.9],
    [6.3, 8.0],
    [5.9, 9.9],
    [3.9, 10.2],
    [1.6, 9.9],
    [1.2, 8.2],
    [2.2, 7.0],
    [2.2, 5.2],
    [1.2, 4.6],
    [1.0, 2.6],
    [1.9, 1.35],
    [3.2, 1.5],
    [3.9, 2.6],
    [3.9, 4.6],
    [4.9, 5.2],
    [5.9, 5.1],
    [5.9, 3.6],
    [5.6, 2.6],
    [6.2, 2.6],
    [5.95, 3.7],
    [6.3, 5.2],
    [8.4, 5.2],
    [9.15, 4.9],
    [9.15, 3.4],
    [8.2, 3.2],
    [9.1, 3.7],
    [9.4, 5.15],
    [10.05, 5.5],
    [10.05, 6.9],
    [10.4, 7.8],
    [10.0, 7.2],
    [10.1, 5.3],
    [12.85, 4.9],
    [12.85, 3.3],
    [13.3, 5.2],
    [13.25, 7.0],
    [12.4, 5.2],
];
