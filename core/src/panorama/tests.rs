//! A box room seen from within: its walls are planes, so that everything has an exact value.

use super::*;
use crate::image::octahedral;

/// Pictures of the inside of a box, and optionally of a square screen that stands at x = `screen` before the right wall.
fn room(eye: DVec3, half: Vec3, screen: Option<f32>, n: u32) -> Vec<(Camera, SurfaceImage)> {
    let shoot = |c: Camera| {
        let mut image = SurfaceImage { size: [n, n], ..Default::default() };
        for i in 0..n * n {
            let ray = c.ray((i % n) as f32 + 0.5, (i / n) as f32 + 0.5);
            let e = eye.as_vec3();
            let to_side = |k: usize| ((half[k] * ray[k].signum()) - e[k]) / ray[k];
            let mut t = (0..3).map(to_side).filter(|t| t.is_finite() && *t > 0.0).fold(f32::INFINITY, f32::min);
            if let Some(x) = screen
                && ray.x > 0.0
            {
                let s = (x - e.x) / ray.x;
                let hit = e + ray * s;
                if s > 0.0 && hit.y.abs() < 0.5 && hit.z.abs() < 0.5 {
                    t = t.min(s);
                }
            }
            image.depth.push(t);
            image.object.push(1);
            image.albedo.push([255; 4]);
            image.normal.push(octahedral(-ray));
        }
        (c, image)
    };
    Camera::cube(eye, n, 0.01).map(shoot).to_vec()
}

fn tests() -> SkinTests {
    SkinTests { far: f32::INFINITY, alpha_rad: 3f32.to_radians() }
}

const HALF: Vec3 = Vec3::new(4.0, 2.0, 3.0);

#[test]
fn every_pixel_of_a_cube_has_eight_neighbours_and_seven_at_its_corners() {
    let views = room(DVec3::ZERO, HALF, None, 6);
    let p = Panorama::new(&views);
    let mut missing = 0;
    for a in 0..p.pixels() {
        let around: Vec<u32> = (0..8).map(|k| p.neighbour(a, k)).filter(|&b| b != NONE).collect();
        missing += 8 - around.len();
        for &b in &around {
            assert!((0..8).any(|k| p.neighbour(b, k) == a), "{a} is a neighbour of {b} only one way");
            let (pa, pb) = (p.place(a), p.place(b));
            let ray = |at: Place| p.views()[at.view].0.ray(at.x as f32 + 0.5, at.y as f32 + 0.5).normalize();
            assert!(ray(pa).dot(ray(pb)) > 0.75, "{pa:?} and {pb:?} are not side by side");
        }
        let mut unique = around.clone();
        unique.sort_unstable();
        unique.dedup();
        assert_eq!(unique.len(), around.len());
    }
    assert_eq!(missing, 6 * 4, "each face has four corners, each of which lacks one");
}

#[test]
fn a_lone_window_ends_at_its_border() {
    let views = room(DVec3::ZERO, HALF, None, 5);
    let p = Panorama::new(&views[..1]);
    assert_eq!((p.neighbour(0, 4), p.neighbour(0, 2), p.neighbour(0, 0)), (NONE, NONE, 1));
    assert!(p.look(-Vec3::X).is_none() && p.look(Vec3::X).is_some());
}

#[test]
fn the_surface_of_a_room_is_its_walls_without_a_wall_between() {
    for eye in [DVec3::ZERO, DVec3::new(1.0, -0.5, 0.25)] {
        let views = room(eye, HALF, None, 32);
        let p = Panorama::new(&views);
        let joined = Joined::new(&p, &tests());
        assert_eq!(joined.skins(&p), 0);
        let s = Surface::new(&p, &joined);
        // Closed: V - E + F = 2 with F quads and 2 F edges.
        assert_eq!(s.points.len(), s.quads.len() + 2);
        let mut walls = 0;
        s.walls(&p, 100.0, |_| walls += 1);
        assert_eq!(walls, 0);
        // On the room's walls, but where a pixel lies across an edge of the room.
        let off = |v: &Vec3| {
            let w = *v + eye.as_vec3();
            (0..3).map(|k| (w[k].abs() - HALF[k]).abs()).fold(f32::INFINITY, f32::min)
        };
        let exact = s.points.iter().filter(|v| off(v) < 1e-4).count();
        assert!(exact * 10 > s.points.len() * 8, "{exact} of {}", s.points.len());
    }
}

#[test]
fn a_step_in_depth_is_a_closed_ring_of_walls_without_area_for_its_own_eye() {
    let views = room(DVec3::ZERO, HALF, Some(2.0), 64);
    let p = Panorama::new(&views);
    let joined = Joined::new(&p, &SkinTests { alpha_rad: 8f32.to_radians(), ..tests() });
    assert!(joined.skins(&p) > 0);
    let s = Surface::new(&p, &joined);
    let mut length = 0.0;
    s.walls(&p, 100.0, |[a, b, c, d]| {
        // From the screen (x = 2) to the wall (x = 4) along the rays.
        let (near, far) = if a.x < b.x { ([a, d], [b, c]) } else { ([b, c], [a, d]) };
        for (n, f) in near.iter().zip(far) {
            assert!((n.x - 2.0).abs() < 0.05 && (f.x - 4.0).abs() < 0.1, "{n} {f}");
            assert!(n.normalize().distance(f.normalize()) < 1e-5);
        }
        length += near[0].distance(near[1]);
    });
    assert!((length - 4.0).abs() < 0.2, "the screen's outline is 4 long: {length}");
}

#[test]
fn another_sample_sees_past_a_step_that_one_sample_takes_for_a_surface() {
    // A screen so near to the wall that its edge's angle to the ray is over alpha.
    let (n, screen) = (128, Some(3.8));
    let views = room(DVec3::ZERO, HALF, screen, n);
    let aside = room(DVec3::new(3.0, 0.0, 2.5), HALF, screen, n);
    let (p, other) = (Panorama::new(&views), Panorama::new(&aside));
    let alone = Joined::new(&p, &tests());
    assert_eq!(alone.skins(&p), 0);
    let mut both = alone.clone();
    both.see_past(&p, &other);
    assert!(both.skins(&p) > 10, "{}", both.skins(&p));
    // Nothing else was accused: every skin lies at the screen's outline.
    for a in 0..p.pixels() {
        for k in (0..8).filter(|&k| !both.towards(a, k)) {
            let b = p.neighbour(a, k);
            if b != NONE {
                let m = 0.5 * (p.point(a) + p.point(b));
                assert!(m.x > 3.5 && m.y.abs().max(m.z.abs()) > 0.3 && m.y.abs().max(m.z.abs()) < 0.7, "{m}");
            }
        }
    }
}

#[test]
fn asking_about_every_edge_accuses_none_more_but_planes() {
    let mut found = 0;
    for (eye, screen) in [(DVec3::ZERO, Some(3.8)), (DVec3::new(0.5, 0.2, -0.3), Some(3.7)), (DVec3::ZERO, Some(3.0))] {
        let views = room(eye, HALF, screen, 128);
        let others = [DVec3::new(3.0, 0.0, 2.5), DVec3::new(2.5, -1.5, -2.0), DVec3::new(-3.0, 1.0, 0.5)];
        let others = others.map(|e| room(e, HALF, screen, 128));
        let p = Panorama::new(&views);
        let others: Vec<Panorama<'_>> = others.iter().map(|v| Panorama::new(v)).collect();
        let alone = Joined::new(&p, &tests());
        let (mut bent, mut every) = (alone.clone(), alone.clone());
        bent.see_past_all(&p, &others);
        every.see_past_beyond(&p, &others, -1.0);
        found += every.skins(&p) - alone.skins(&p);
        // The plane that a point lies on: a wall of the room or the screen.
        let plane = |i: u32| {
            let w = p.point(i) + eye.as_vec3();
            let wall = |k: usize| (w[k].abs() - HALF[k]).abs() < 1e-3;
            if (w.x - screen.unwrap_or(0.0)).abs() < 1e-3 {
                Some((3, 1.0))
            } else {
                (0..3).find(|&k| wall(k)).map(|k| (k, w[k].signum()))
            }
        };
        for a in 0..p.pixels() {
            for k in (0..8).filter(|&k| bent.towards(a, k) != every.towards(a, k)) {
                assert!(bent.towards(a, k) && plane(a).is_some() && plane(a) == plane(p.neighbour(a, k)));
            }
        }
    }
    assert!(found > 20, "{found}");
}

#[test]
fn what_lies_beyond_the_far_threshold_joins_nothing() {
    let views = room(DVec3::ZERO, HALF, None, 8);
    let p = Panorama::new(&views);
    let joined = Joined::new(&p, &SkinTests { far: 3.5, ..tests() });
    for a in 0..p.pixels() {
        for k in 0..8 {
            let b = p.neighbour(a, k);
            let near = b != NONE && p.depth(a) <= 3.5 && p.depth(b) <= 3.5;
            assert_eq!(joined.towards(a, k), near);
        }
    }
}

#[test]
fn nothing_hit_is_no_surface_and_a_wall_to_the_far_end_beside_one() {
    let mut views = room(DVec3::ZERO, HALF, None, 4);
    let at = views[0].1.at(1, 1);
    views[0].1.depth[at] = f32::INFINITY;
    views[0].1.object[at] = 0;
    let p = Panorama::new(&views);
    let s = Surface::new(&p, &Joined::new(&p, &tests()));
    assert_eq!(s.quads.iter().filter(|q| q[0] == NONE).count(), 1);
    assert!(s.quad(at as u32).is_none());
    let mut walls = vec![];
    s.walls(&p, 50.0, |w| walls.push(w));
    assert_eq!(walls.len(), 4);
    for [a, b, c, d] in walls {
        assert!([[a, b], [d, c]].iter().all(|[u, v]| (u.length().max(v.length()) - 50.0).abs() < 1e-3));
    }
}
