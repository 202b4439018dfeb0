//! The least movement of a viewer after which a box may be seen: by turning alone, and by going somewhere without turning.
//!
//! *May be seen* is what culling says, [`Camera::may_see`]: the box does not lie wholly outside one side plane. O(1): about 80 distances of
//! a direction to an arc, and 14 small linear systems.

use farfield_core::{Aabb, Camera};
use glam::{DMat3, DVec3};

/// Corners of a box that an edge joins: they differ in one axis (see [`Aabb::corners`]).
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// The least angle by which the camera has to turn about its eye, about whatever axis, radians; 0 for what it may see already and infinite
/// for an empty box.
///
/// A rotation by an angle moves no direction by more, and one about the axis perpendicular to two directions moves the first onto the
/// second by the angle between them. So it is the least angle between a direction of the frustum and one of the box. Both sets are convex
/// on the sphere and a side plane parts them: the least angle is between a corner of one and an edge of the other (of two great circles
/// only crossings are nearest).
pub(crate) fn turn_rad(camera: &Camera, bounds: &Aabb) -> f64 {
    if bounds.is_empty() {
        return f64::INFINITY;
    }
    if camera.may_see(bounds) {
        return 0.0;
    }
    let corners = bounds.corners().map(|c| (c.as_dvec3() - camera.eye).normalize_or_zero());
    let ray = |x: f32, y: f32| (camera.forward + camera.right * x + camera.up * y).as_dvec3().normalize();
    let (left, right, bottom, top) = (camera.left, camera.right_tan, camera.bottom, camera.top);
    let rays = [ray(left, bottom), ray(right, bottom), ray(right, top), ray(left, top)];
    let mut least = f64::INFINITY;
    for c in corners {
        (0..4).for_each(|k| least = least.min(to_arc(c, rays[k], rays[(k + 1) % 4])));
    }
    for r in rays {
        EDGES.iter().for_each(|&[a, b]| least = least.min(to_arc(r, corners[a], corners[b])));
    }
    least
}

/// The angle between two unit vectors, exact for small ones too, radians.
fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// The angle between a direction and the shorter arc between two others, radians.
fn to_arc(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let normal = a.cross(b).normalize_or_zero();
    let foot = p - normal * p.dot(normal);
    if normal != DVec3::ZERO && a.cross(foot).dot(normal) >= 0.0 && foot.cross(b).dot(normal) >= 0.0 {
        return p.dot(normal).abs().atan2(foot.length());
    }
    angle(p, a).min(angle(p, b))
}

/// The least way that the camera has to go, in whatever direction and without turning, scene units; 0 for what it may see already and
/// infinite for an empty box.
///
/// With a box's largest height h_i = max n_i . (p - eye) over a side plane of unit normal n_i, a way t brings it over the plane when
/// n_i . t <= h_i. The shortest such t lies on one, two or three of the planes; of those that fulfil all four the shortest counts.
pub(crate) fn way(camera: &Camera, bounds: &Aabb) -> f64 {
    if bounds.is_empty() {
        return f64::INFINITY;
    }
    if camera.may_see(bounds) {
        return 0.0;
    }
    let normals = camera.side_planes().map(|n| n.as_dvec3().normalize_or_zero());
    let corners = bounds.corners().map(|c| c.as_dvec3() - camera.eye);
    let heights = normals.map(|n| corners.iter().map(|c| n.dot(*c)).fold(f64::NEG_INFINITY, f64::max));
    let size = heights.iter().fold(0.0, |a: f64, h| a.max(h.abs()));
    let mut least = f64::INFINITY;
    for planes in 1..16usize {
        let on: Vec<usize> = (0..4).filter(|i| planes >> i & 1 == 1).collect();
        let Some(t) = shortest(&on, &normals, &heights) else { continue };
        let fulfils = (0..4).all(|i| normals[i].dot(t) <= heights[i] + 1e-9 * size);
        if fulfils {
            least = least.min(t.length());
        }
    }
    least
}

/// The shortest t with n . t = h on one to three planes; `None` of more or where planes are parallel.
fn shortest(on: &[usize], normals: &[DVec3; 4], heights: &[f64; 4]) -> Option<DVec3> {
    match *on {
        [i] => Some(normals[i] * heights[i]),
        [i, j] => {
            // t = x n_i + y n_j.
            let (a, b, c) = (normals[i], normals[j], normals[i].dot(normals[j]));
            let free = 1.0 - c * c;
            let (x, y) = (heights[i] - c * heights[j], heights[j] - c * heights[i]);
            (free > 1e-12).then(|| (a * x + b * y) / free)
        }
        [i, j, k] => {
            let rows = DMat3::from_cols(normals[i], normals[j], normals[k]).transpose();
            let right = DVec3::new(heights[i], heights[j], heights[k]);
            (rows.determinant().abs() > 1e-12).then(|| rows.inverse() * right)
        }
        _ => None,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use glam::{DQuat, Quat, Vec3};
    use proptest::prelude::*;

    fn camera() -> Camera {
        let mut c =
            Camera::looking(DVec3::new(1.0, -2.0, 0.5), Vec3::new(0.4, 0.1, -1.0), Vec3::Y, 0.9, [320, 240], 0.1);
        (c.left, c.top) = (1.2 * c.left, 0.7 * c.top);
        c
    }

    fn boxed(centre: [f32; 3], half: [f32; 3]) -> Aabb {
        let (c, h) = (Vec3::from_array(centre), Vec3::from_array(half));
        Aabb { min: c - h, max: c + h }
    }

    /// Points of a box's surface on a lattice of n steps an edge.
    fn spread(b: &Aabb, n: u32) -> Vec<Vec3> {
        let lattice = (0..=n).flat_map(|i| (0..=n).flat_map(move |j| (0..=n).map(move |k| [i, j, k])));
        let surface = lattice.filter(|x| x.iter().any(|&i| i == 0 || i == n));
        surface.map(|x| b.min + b.size() * Vec3::from_array(x.map(|i| i as f32 / n as f32))).collect()
    }

    /// The least angle between directions of the picture's border and of the box's surface on lattices, radians: of a box beside the
    /// frustum.
    pub(crate) fn tried_turn_rad(c: &Camera, b: &Aabb) -> f64 {
        let [width, height] = c.size.map(|n| n as f32);
        let border = (0..=150).map(|i| i as f32 / 150.0).flat_map(|t| [(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)]);
        let rays: Vec<DVec3> = border.map(|(x, y)| c.ray(width * x, height * y).as_dvec3().normalize()).collect();
        let points = spread(b, 12).into_iter().map(|p| (p.as_dvec3() - c.eye).normalize());
        points.flat_map(|p| rays.iter().map(move |r| angle(p, *r))).fold(f64::INFINITY, f64::min)
    }

    /// The least way along some of many directions after which culling lets the box through, scene units.
    pub(crate) fn tried_way(c: &Camera, b: &Aabb, most: f64) -> f64 {
        let seen = |to: DVec3| Camera { eye: c.eye + to, ..*c }.may_see(b);
        let first = |direction: DVec3| {
            let mut steps = (1..=400).map(|k| most * f64::from(k) / 400.0);
            let Some(mut far) = steps.find(|&way| seen(direction * way)) else { return f64::INFINITY };
            let mut near = far - most / 400.0;
            for _ in 0..40 {
                let middle = 0.5 * (near + far);
                if seen(direction * middle) { far = middle } else { near = middle }
            }
            far
        };
        // Directions on a spiral by the golden angle; then ever closer around the best.
        let spiral = |i: u32, n: u32| {
            let (z, a) = (1.0 - f64::from(2 * i + 1) / f64::from(n), 2.399_963 * f64::from(i));
            DVec3::new((1.0 - z * z).sqrt() * a.cos(), (1.0 - z * z).sqrt() * a.sin(), z)
        };
        let all = (0..1000).map(|i| spiral(i, 1000)).map(|d| (first(d), d));
        let shorter = |a: (f64, DVec3), b: (f64, DVec3)| if b.0 < a.0 { b } else { a };
        let mut best = all.reduce(shorter).unwrap();
        for round in 0..14 {
            let (reach, around) = (0.2 * 0.7f64.powi(round), best.1);
            let near = (0..40).map(|i| (around + spiral(i, 40) * reach).normalize());
            best = near.map(|d| (first(d), d)).fold(best, shorter);
        }
        best.0
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn turning_is_the_least_angle_between_any_two_directions(
            centre in prop::array::uniform3(-9f32..9.0),
            half in prop::array::uniform3(0.05f32..3.0),
        ) {
            let (c, b) = (camera(), boxed(centre, half));
            let told = turn_rad(&c, &b);
            let tried = tried_turn_rad(&c, &b);
            prop_assert!(told <= tried + 1e-6, "{told} against {tried}");
            // Neighbouring samples are that far apart, at most.
            let nearest = b.distance(c.eye.as_vec3()).max(1e-3);
            let coarse = 0.06 + f64::from(b.size().max_element() / 12.0 / nearest);
            prop_assert!(c.may_see(&b) || told >= tried - coarse, "{told} against {tried}");
        }

        #[test]
        fn no_lesser_turn_shows_a_point_of_it_and_one_a_little_larger_does(
            centre in prop::array::uniform3(-9f32..9.0),
            half in prop::array::uniform3(0.05f32..2.0),
            turns in prop::collection::vec((prop::array::uniform3(-1f64..1.0), 0.0f64..1.0), 200),
        ) {
            let (c, b) = (camera(), boxed(centre, half));
            let told = turn_rad(&c, &b);
            let turned = |q: DQuat| {
                let turn = |v: Vec3| (q * v.as_dvec3()).as_vec3();
                Camera { right: turn(c.right), up: turn(c.up), forward: turn(c.forward), ..c }
            };
            let points = spread(&b, 6);
            let shown = |c: &Camera| {
                let planes = c.side_planes();
                points.iter().any(|p| planes.iter().all(|n| n.dot((p.as_dvec3() - c.eye).as_vec3()) > 1e-4))
            };
            for (axis, share) in turns {
                let axis = DVec3::from_array(axis).normalize_or(DVec3::Y);
                prop_assert!(told == 0.0 || !shown(&turned(DQuat::from_axis_angle(axis, 0.999 * share * told))));
            }
        }

        #[test]
        fn the_way_is_the_shortest_after_which_culling_lets_it_through(
            centre in prop::array::uniform3(-9f32..9.0),
            half in prop::array::uniform3(0.05f32..2.0),
            ways in prop::collection::vec((prop::array::uniform3(-1f64..1.0), 0.0f64..1.0), 300),
        ) {
            let (c, b) = (camera(), boxed(centre, half));
            let told = way(&c, &b);
            let seen = |to: DVec3| Camera { eye: c.eye + to, ..c }.may_see(&b);
            for (direction, share) in ways {
                let direction = DVec3::from_array(direction).normalize_or(DVec3::Y);
                prop_assert!(told == 0.0 || !seen(direction * share * told * 0.999));
            }
            let shortest = tried_way(&c, &b, 40.0);
            prop_assert!(told <= shortest + 1e-5, "{told} against {shortest}");
            prop_assert!(shortest <= 1.01 * told + 1e-3, "{told} against {shortest}");
        }
    }

    #[test]
    fn what_is_behind_beside_and_inside() {
        let c = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, std::f32::consts::FRAC_PI_2, [100, 100], 0.1);
        let at = |p: Vec3| Aabb { min: p - 1e-3, max: p + 1e-3 };
        // A frustum of 90 degrees: straight behind is acos(-1 / sqrt 3) from its corners, to the side 45 degrees from its plane.
        let behind = turn_rad(&c, &at(Vec3::Z * 5.0)).to_degrees();
        let beside = turn_rad(&c, &at(Vec3::X * 5.0)).to_degrees();
        assert!((behind - 125.26).abs() < 0.1, "{behind}");
        assert!((beside - 45.0).abs() < 0.1, "{beside}");
        assert!((way(&c, &at(Vec3::X * 5.0)) - 5.0 / 2f64.sqrt()).abs() < 0.01);
        assert!((way(&c, &at(Vec3::Z * 5.0)) - 5.0).abs() < 0.01, "{}", way(&c, &at(Vec3::Z * 5.0)));
        let around = Aabb { min: Vec3::splat(-1.0), max: Vec3::ONE };
        assert_eq!((turn_rad(&c, &around), way(&c, &around)), (0.0, 0.0));
        assert_eq!((turn_rad(&c, &Aabb::EMPTY), way(&c, &Aabb::EMPTY)), (f64::INFINITY, f64::INFINITY));
        let tilted = Camera {
            forward: Quat::from_rotation_y(0.2) * c.forward,
            right: Quat::from_rotation_y(0.2) * c.right,
            ..c
        };
        assert!((turn_rad(&tilted, &at(Vec3::X * 5.0)) - turn_rad(&c, &at(Vec3::X * 5.0)) - 0.2).abs() < 1e-3);
    }
}
