//! The house without its furniture: walls, floors, ceilings, joinery, roof, each room's an object of its own.
//!
//! Walls are slabs with both faces and the reveals of their openings; all walls' faces together are closed. Each face
//! belongs to the room that it is seen from. Faces are cut into squares whose vertices hold baked light: dark in corners, bright
//! where a window or a door lets light in. The heights at which walls are cut are the same in all, so that outside corners have no
//! T-junctions. O(area / step^2).

use glam::{Affine3A, DAffine3, Vec2, Vec3};

use super::plan::{DOOR, GROUND, HIGH, Opening, Room, SIZE, Wall, walls};
use super::stuff::{Model, Stuff, Thing, thing, tint};
use crate::generate::noise::fbm;
use crate::generate::solid::{Paint, Solid};

/// Walls start below the floor and end above the ceiling.
const FOOT: f32 = -0.3;
const TOP: f32 = 2.72;
/// Thickness and height of a skirting board.
const SKIRTING: [f32; 2] = [0.014, 0.09];
/// Width of door and window frames.
const FRAME: f32 = 0.05;
/// Lacquer of doors, frames and skirting.
const WHITE: Paint = [236, 234, 226];
const BRICK: Paint = [250, 246, 240];

/// Edge of the squares that surfaces are cut into, metres.
fn step(level: u32) -> f32 {
    (1.5 / level as f32).max(0.04)
}

/// A room's paint on walls.
fn walls_of(room: Room) -> (Stuff, Paint) {
    match room {
        Room::Kitchen => (Stuff::Plaster, [244, 232, 206]),
        Room::Bath => (Stuff::Tiles, [214, 232, 236]),
        Room::Bedroom => (Stuff::Plaster, [214, 222, 232]),
        Room::Nursery => (Stuff::Plaster, [226, 236, 208]),
        Room::Hall => (Stuff::Plaster, [240, 236, 226]),
        Room::Living => (Stuff::Plaster, [238, 226, 208]),
        Room::Study => (Stuff::Plaster, [196, 212, 200]),
        Room::Music => (Stuff::Plaster, [232, 208, 196]),
    }
}

/// A room's floor.
fn floor_of(room: Room) -> (Stuff, Paint) {
    match room {
        Room::Kitchen => (Stuff::Tiles, [214, 192, 166]),
        Room::Bath => (Stuff::Tiles, [128, 152, 164]),
        Room::Bedroom => (Stuff::Carpet, [204, 194, 178]),
        Room::Nursery => (Stuff::Carpet, [150, 178, 200]),
        Room::Hall | Room::Living | Room::Music => (Stuff::Planks, [255, 250, 244]),
        Room::Study => (Stuff::Planks, [214, 196, 176]),
    }
}

/// Squares cut out of a range, with `marks` in it kept.
fn cuts([from, to]: [f32; 2], marks: impl IntoIterator<Item = f32>, step: f32) -> Vec<f32> {
    let mut marks: Vec<f32> = marks.into_iter().filter(|m| from < *m && *m < to).chain([from, to]).collect();
    marks.sort_by(f32::total_cmp);
    marks.dedup();
    let mut out = vec![from];
    for w in marks.windows(2) {
        let n = ((w[1] - w[0]) / step).ceil().max(1.0) as u32;
        out.extend((1..n).map(|k| w[0] + (w[1] - w[0]) * k as f32 / n as f32));
        out.push(w[1]);
    }
    out
}

/// How much light the vertex at `p` with normal `n` has baked in, 0..1, seen from a room.
fn light(room: Room, windows: &[(Vec3, f32)], p: Vec3, n: Vec3) -> f32 {
    let [low, high] = room.inside();
    let near = |d: f32, plane: Vec3| if plane.dot(n).abs() > 0.5 { 0.0 } else { (-d.max(0.0) / 0.28).exp() };
    let dark = near(p.y, Vec3::Y) * 0.30
        + near(HIGH - p.y, Vec3::Y) * 0.24
        + (near(p.x - low.x, Vec3::X) + near(high.x - p.x, Vec3::X)) * 0.22
        + (near(p.z - low.y, Vec3::Z) + near(high.y - p.z, Vec3::Z)) * 0.22;
    let sky: f32 = windows
        .iter()
        .map(|&(c, area)| {
            let d = c - p;
            0.55 * area * (d.dot(n) / d.length().max(0.2)).max(0.0) / (d.length_squared() + 0.7)
        })
        .sum();
    ((0.74 + sky.min(0.26)) * (1.0 - dark.min(0.5))).min(1.0)
}

/// The middles and areas of the openings to the outside of a room.
fn windows(room: Room) -> Vec<(Vec3, f32)> {
    let [low, high] = room.extent();
    let of = |w: &Wall| {
        let middle = |o: &Opening| {
            let c = w.point(0.5 * (o.span[0] + o.span[1]), 0.5 * (o.rise[0] + o.rise[1]), 0.0);
            (c, (o.span[1] - o.span[0]) * (o.rise[1] - o.rise[0]))
        };
        w.openings.iter().map(middle).collect::<Vec<_>>()
    };
    let touches = |c: &Vec3| c.x >= low.x && c.x <= high.x && c.z >= low.y && c.z <= high.y;
    walls().iter().filter(|w| w.outside()).flat_map(of).filter(|o| touches(&o.0)).collect()
}

/// A rectangle of squares at the given cuts: `point` puts them, `normal` faces them; they are counter-clockwise where
/// u x v is the normal.
fn patch(s: &mut Solid, us: &[f32], vs: &[f32], normal: Vec3, paint: Paint, point: impl Fn(f32, f32) -> Vec3) {
    let first = s.mesh.positions.len() as u32;
    for &v in vs {
        us.iter().for_each(|&u| _ = s.vertex(point(u, v), normal, paint));
    }
    let width = us.len() as u32;
    let turned = {
        let (o, u, v) = (point(us[0], vs[0]), point(us[1], vs[0]), point(us[0], vs[1]));
        (u - o).cross(v - o).dot(normal) < 0.0
    };
    for j in 0..vs.len() as u32 - 1 {
        for i in 0..width - 1 {
            let [a, b, c, d] = [0, 1, width + 1, width].map(|k| first + j * width + i + k);
            s.mesh.indices.extend(if turned { [a, c, b, a, d, c] } else { [a, b, c, a, c, d] });
        }
    }
}

/// A face of a wall for each square: emits those that are seen from `room` (`None`: from outside).
fn wall_faces(s: &mut Solid, wall: &Wall, heights: &[f32], step: f32, room: Option<Room>, paint: Paint) {
    let marks = wall.openings.iter().flat_map(|o| o.span).chain(crossings(wall));
    let along = cuts(wall.span, marks, step);
    let half = 0.5 * wall.thick;
    let hole =
        |u: f32, v: f32| wall.openings.iter().any(|o| o.span[0] < u && u < o.span[1] && o.rise[0] < v && v < o.rise[1]);
    // The floor of a door's opening is the room's; walls run on below it.
    let seen = |p: Vec3| Room::at(Vec2::new(p.x, p.z)) == room;
    let (axis, across) = if wall.along_x { (Vec3::X, Vec3::Z) } else { (Vec3::Z, Vec3::X) };
    for u in along.windows(2) {
        for v in heights.windows(2) {
            let (mu, mv) = (0.5 * (u[0] + u[1]), 0.5 * (v[0] + v[1]));
            if hole(mu, mv) {
                continue;
            }
            for sign in [-1.0, 1.0] {
                if seen(wall.point(mu, mv, sign * (half + 0.01))) {
                    patch(s, u, v, across * sign, paint, |a, b| wall.point(a, b, sign * half));
                }
            }
            // Reveals and ends: where the next square is a hole or the wall is over.
            let offs = [-half, half];
            for (at, to, normal) in [(u[0], mu - (u[1] - u[0]), -axis), (u[1], mu + (u[1] - u[0]), axis)] {
                let open = hole(at + (to - at).signum() * 1e-3, mv) || at == wall.span[0] || at == wall.span[1];
                if open && seen(wall.point(at, mv, 0.02 * half) + normal * 0.01) {
                    patch(s, &offs, v, normal, paint, |o, b| wall.point(at, b, o));
                }
            }
            for (at, normal) in [(v[0], Vec3::NEG_Y), (v[1], Vec3::Y)] {
                let open = hole(mu, at + normal.y * 1e-3) || at == FOOT || at == TOP;
                if open && seen(wall.point(mu, at, 0.02 * half)) {
                    patch(s, u, &offs, normal, paint, |a, o| wall.point(a, at, o));
                }
            }
        }
    }
}

/// Where other walls end at this one.
fn crossings(wall: &Wall) -> Vec<f32> {
    walls().iter().filter(|w| w.along_x != wall.along_x).map(|w| w.line).collect()
}

/// The heights at which all walls are cut.
fn heights(step: f32) -> Vec<f32> {
    let all = walls();
    let marks = all.iter().flat_map(|w| w.openings.iter().flat_map(|o| o.rise));
    cuts([FOOT, TOP], marks.chain([GROUND]), step)
}

fn here() -> Vec<DAffine3> {
    vec![DAffine3::IDENTITY]
}

/// A room's surface with its light baked in.
fn baked(name: String, room: Room, make: impl Fn(&mut Model) + Send + Sync + 'static) -> Thing {
    let windows = windows(room);
    let make = move |level| {
        let mut model = Model::new(level);
        make(&mut model);
        let mut mesh = model.bare();
        for ((p, n), c) in mesh.positions.iter().zip(&mesh.normals).zip(&mut mesh.colors) {
            tint(c, light(room, &windows, *p, *n));
        }
        mesh
    };
    Thing { name, make: Box::new(make), at: here() }
}

/// A room's walls, floor, ceiling and skirting.
fn room(room: Room, out: &mut Vec<Thing>) {
    out.push(baked(format!("{} walls", room.name()), room, move |m| {
        let step = step(m.level());
        let (stuff, paint) = walls_of(room);
        m.part(stuff, |s| {
            walls().iter().for_each(|w| wall_faces(s, w, &heights(step), step, Some(room), paint));
        });
    }));
    let slab = |name: &str, stuff: Stuff, paint: Paint, [low, high]: [f32; 2], up: bool| {
        baked(format!("{} {name}", room.name()), room, move |m| {
            let [a, b] = room.extent();
            let fine = step(m.level());
            let (xs, zs) = (cuts([a.x, b.x], [], fine), cuts([a.y, b.y], [], fine));
            m.part(stuff, |s| {
                let y = if up { high } else { low };
                let normal = if up { Vec3::Y } else { Vec3::NEG_Y };
                patch(s, &xs, &zs, normal, paint, |x, z| Vec3::new(x, y, z));
                for (z, n) in [(a.y, Vec3::NEG_Z), (b.y, Vec3::Z)] {
                    patch(s, &xs, &[low, high], n, paint, |x, y| Vec3::new(x, y, z));
                }
                for (x, n) in [(a.x, Vec3::NEG_X), (b.x, Vec3::X)] {
                    patch(s, &zs, &[low, high], n, paint, |z, y| Vec3::new(x, y, z));
                }
                patch(s, &xs, &zs, -normal, paint, |x, z| Vec3::new(x, low + high - y, z));
            });
        })
    };
    let (stuff, paint) = floor_of(room);
    out.push(slab("floor", stuff, paint, [-0.25, 0.0], true));
    out.push(slab("ceiling", Stuff::Plaster, [248, 246, 240], [HIGH, 2.7], false));
    if room != Room::Bath {
        out.push(thing(&format!("{} skirting", room.name()), here(), move |m| {
            m.part(Stuff::Paint, |s| skirting(s, room));
        }));
    }
}

/// Boards along a room's walls, between its doors.
fn skirting(s: &mut Solid, room: Room) {
    let [low, high] = room.inside();
    let [t, h] = SKIRTING;
    let [a, b] = room.extent();
    for wall in walls() {
        let k = usize::from(!wall.along_x);
        let other = 1 - k;
        let side = if wall.line == a[other] {
            1.0
        } else if wall.line == b[other] {
            -1.0
        } else {
            continue;
        };
        // Boards along z stop at those along x.
        let rim = if wall.along_x { 0.0 } else { t };
        let ends = [low[k] + rim, high[k] - rim];
        let mut from = ends[0];
        let mut doors: Vec<[f32; 2]> = wall.openings.iter().filter(|o| o.door()).map(|o| o.span).collect();
        doors.retain(|d| d[0] > ends[0] && d[1] < ends[1]);
        doors.push([ends[1] + FRAME, f32::MAX]);
        for d in doors {
            let to = (d[0] - FRAME).min(ends[1]);
            let middle = wall.point(0.5 * (from + to), 0.5 * h - 0.005, side * 0.5 * (wall.thick + t));
            let along = 0.5 * (to - from);
            let half =
                if wall.along_x { Vec3::new(along, 0.5 * h, 0.5 * t) } else { Vec3::new(0.5 * t, 0.5 * h, along) };
            s.block(Affine3A::from_translation(middle), half, WHITE);
            from = d[1] + FRAME;
        }
    }
}

/// A box by ranges along a wall, in height, and across it.
fn bar(s: &mut Solid, wall: &Wall, u: [f32; 2], v: [f32; 2], w: [f32; 2], paint: Paint) {
    let middle = wall.point(0.5 * (u[0] + u[1]), 0.5 * (v[0] + v[1]), 0.5 * (w[0] + w[1]));
    let (du, dv, dw) = (0.5 * (u[1] - u[0]), 0.5 * (v[1] - v[0]), 0.5 * (w[1] - w[0]));
    let half = if wall.along_x { Vec3::new(du, dv, dw) } else { Vec3::new(dw, dv, du) };
    s.block(Affine3A::from_translation(middle), half, paint);
}

/// The frame of a door: jambs a little thicker than the wall, a lintel on them, a threshold.
fn door_frame(m: &mut Model, wall: &Wall, o: Opening) {
    let w = 0.5 * wall.thick + 0.016;
    let [a, b] = o.span;
    m.part(Stuff::Paint, |s| {
        for [from, to] in [[a - FRAME, a + 0.03], [b - 0.03, b + FRAME]] {
            bar(s, wall, [from, to], [-0.01, DOOR - 0.03], [-w, w], WHITE);
        }
        bar(s, wall, [a - FRAME, b + FRAME], [DOOR - 0.03, DOOR + FRAME], [-w, w], WHITE);
    });
    let half = 0.5 * wall.thick;
    m.part(Stuff::Wood, |s| bar(s, wall, [a + 0.03, b - 0.03], [-0.06, 0.008], [-half, half], [150, 112, 78]));
}

/// The frame of a window in the middle of the wall, cross bars, a board inside and a sill outside.
fn window_frame(m: &mut Model, wall: &Wall, o: Opening, inward: f32) {
    let ([a, b], [low, high]) = (o.span, o.rise);
    let half = 0.5 * wall.thick;
    let f = 0.055;
    m.part(Stuff::Paint, |s| {
        let deep = [-0.035, 0.035];
        for [from, to] in [[a, a + f], [b - f, b]] {
            bar(s, wall, [from, to], [low, high], deep, WHITE);
        }
        for [from, to] in [[low, low + f], [high - f, high]] {
            bar(s, wall, [a + f, b - f], [from, to], deep, WHITE);
        }
        let panes = ((b - a) / 0.75).round().max(1.0) as u32;
        for k in 1..panes {
            let c = a + (b - a) * k as f32 / panes as f32;
            bar(s, wall, [c - 0.03, c + 0.03], [low + f, high - f], [-0.03, 0.03], WHITE);
        }
        let c = low + 0.68 * (high - low);
        bar(s, wall, [a + f, b - f], [c - 0.018, c + 0.018], [-0.02, 0.02], WHITE);
    });
    let across = |from: f32, to: f32| if inward > 0.0 { [from, to] } else { [-to, -from] };
    m.part(Stuff::Wood, |s| {
        bar(s, wall, [a - 0.06, b + 0.06], [low - 0.03, low + 0.005], across(0.035, half + 0.1), [232, 222, 204]);
    });
    m.part(Stuff::Paint, |s| {
        bar(s, wall, [a - 0.04, b + 0.04], [low - 0.05, low + 0.004], across(-half - 0.05, -0.035), [176, 172, 164]);
    });
}

/// Doors' and windows' frames, one object an opening.
fn joinery(out: &mut Vec<Thing>) {
    for wall in walls() {
        let inward = if wall.line == 0.0 { 1.0 } else { -1.0 };
        for (i, &o) in wall.openings.iter().enumerate() {
            let (own, axis) = (wall.clone(), if wall.along_x { "z" } else { "x" });
            let what = if o.door() { "door frame" } else { "window" };
            out.push(thing(&format!("{what} {axis} {} {i}", wall.line), here(), move |m| {
                if o.door() { door_frame(m, &own, o) } else { window_frame(m, &own, o, inward) }
            }));
        }
    }
}

/// The gabled roof: tiles above, boards below and in the gables, and a chimney.
fn roof(m: &mut Model) {
    let (low, rim, ridge) = (2.7, 2.86, 5.7);
    let (x, z) = ([-0.7, SIZE.x + 0.7], [-0.8, SIZE.y + 0.8]);
    let middle = 0.5 * SIZE.y;
    let fine = 2.0 * step(m.level());
    let along = cuts(x, [], fine);
    let n = |side: f32| Vec3::new(0.0, z[1] - middle, side * (ridge - rim)).normalize();
    let slope = cuts([0.0, 1.0], [], fine / (z[1] - middle));
    m.part(Stuff::Roof, |s| {
        for (side, from) in [(-1.0, z[0]), (1.0, z[1])] {
            patch(s, &along, &slope, n(side), [255; 3], |a, t| {
                Vec3::new(a, rim + (ridge - rim) * t, from + (middle - from) * t)
            });
        }
    });
    m.part(Stuff::Wood, |s| {
        let board = [206, 196, 180];
        patch(s, &along, &[z[0], z[1]], Vec3::NEG_Y, board, |a, b| Vec3::new(a, low, b));
        for (side, at) in [(-1.0, z[0]), (1.0, z[1])] {
            patch(s, &along, &[low, rim], Vec3::Z * side, board, |a, y| Vec3::new(a, y, at));
        }
        for (side, at) in [(-1.0, x[0]), (1.0, x[1])] {
            let normal = Vec3::X * side;
            patch(s, &[z[0], z[1]], &[low, rim], normal, board, |b, y| Vec3::new(at, y, b));
            // The gable: the slopes' points from one eave over the ridge to the other, in pairs of equal height.
            for w in slope.windows(2) {
                let y = |t: f32| rim + (ridge - rim) * t;
                let across = |t: f32| [z[0], z[1]].map(|f| f + (middle - f) * t);
                let corners = [across(w[0])[0], across(w[0])[1], across(w[1])[1], across(w[1])[0]];
                let ids = [0, 1, 2, 3].map(|k| {
                    let p = Vec3::new(at, y(w[usize::from(k > 1)]), corners[k]);
                    s.vertex(p, normal, board)
                });
                let [a, b, c, d] = ids;
                let faces = if side > 0.0 { [a, c, b, a, d, c] } else { [a, b, c, a, c, d] };
                let top = w[1] == 1.0;
                s.mesh.indices.extend(if top { &faces[..3] } else { &faces[..] });
            }
        }
    });
    m.part(Stuff::Brick, |s| {
        s.block(Affine3A::from_translation(Vec3::new(4.4, 5.2, 4.2)), Vec3::new(0.35, 1.2, 0.35), BRICK);
        s.block(Affine3A::from_translation(Vec3::new(4.4, 6.44, 4.2)), Vec3::new(0.41, 0.05, 0.41), BRICK);
    });
}

/// All of it.
pub(super) fn shell() -> Vec<Thing> {
    let mut out = vec![];
    Room::ALL.into_iter().for_each(|r| room(r, &mut out));
    out.push(Thing {
        name: "outside walls".into(),
        make: Box::new(|level| {
            let mut m = Model::new(level);
            let step = step(level);
            m.part(Stuff::Brick, |s| {
                walls().iter().for_each(|w| wall_faces(s, w, &heights(step), step, None, BRICK));
            });
            let mut mesh = m.bare();
            for (p, c) in mesh.positions.iter().zip(&mut mesh.colors) {
                let near = ((p.y - GROUND) / 0.5).clamp(0.0, 1.0).sqrt();
                tint(c, (0.76 + 0.24 * near) * (0.97 + 0.12 * fbm(*p, 2.5, 3, 0.0, 5)));
            }
            mesh
        }),
        at: here(),
    });
    joinery(&mut out);
    out.push(thing("roof", here(), roof));
    out
}
