//! The steps from a sample to a mesh, on a room whose every ray has a closed form.

use farfield_core::Camera;
use farfield_core::collapse::LiveMesh;
use farfield_core::image::{SurfaceImage, octahedral};
use farfield_core::panorama::{Joined, Panorama, SkinTests, Surface};
use glam::{DVec3, Vec3};

use crate::dense::Dense;
use crate::redundancy::kept;
use crate::simplify::{Extremes, Limits, Simplified, simplify};
use crate::texels::patches;

const HALF: Vec3 = Vec3::new(4.0, 2.0, 3.0);
const LIMITS: Limits = Limits { border_px: 0.5, interior_px: 0.5, tree_triangles: 50 };

/// Pictures from within a box, with a square screen of side 2 at x = 2 where it is asked for.
fn room(eye: DVec3, screen: bool, n: u32) -> Vec<(Camera, SurfaceImage)> {
    let shoot = |c: Camera| {
        let mut image = SurfaceImage { size: [n, n], ..Default::default() };
        for i in 0..n * n {
            let (ray, e) = (c.ray((i % n) as f32 + 0.5, (i / n) as f32 + 0.5), eye.as_vec3());
            let side = |k: usize| (HALF[k] * ray[k].signum() - e[k]) / ray[k];
            let room = (0..3).map(side).filter(|t| *t > 0.0).fold(f32::INFINITY, f32::min);
            let s = (2.0 - e.x) / ray.x;
            let at = e + ray * s;
            let hidden = screen && s > 0.0 && s < room && at.y.abs() < 1.0 && at.z.abs() < 1.0;
            image.depth.push(if hidden { s } else { room });
            image.object.push(if hidden { 2 } else { 1 });
            image.albedo.push([9, 9, 9, 255]);
            image.normal.push(octahedral(-ray));
        }
        (c, image)
    };
    Camera::cube(eye, n, 0.01).map(shoot).to_vec()
}

fn tests() -> SkinTests {
    SkinTests { far: f32::INFINITY, alpha_rad: 8f32.to_radians() }
}

fn dense(p: &Panorama<'_>, keep: &[bool]) -> Dense {
    Dense::new(p, &Surface::new(p, &Joined::new(p, &tests())), keep)
}

fn extremes(n: u32) -> Extremes {
    let eyes = [(0.0, 0.0), (0.3, 0.0), (-0.3, 0.2), (0.0, -0.3)].map(|(x, z)| Vec3::new(x, 0.0, z)).to_vec();
    Extremes { eyes, px_per_tan: 0.5 * n as f32 }
}

/// Edges with one triangle.
fn border(mesh: &[u32]) -> Vec<[u32; 2]> {
    let edges = || mesh.as_chunks::<3>().0.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
    let all: std::collections::BTreeSet<[u32; 2]> = edges().collect();
    edges().filter(|[a, b]| !all.contains(&[*b, *a])).collect()
}

#[test]
fn a_room_seen_again_is_redundant_and_what_a_screen_hid_is_kept() {
    let n = 64;
    let (a, b) = (room(DVec3::ZERO, true, n), room(DVec3::new(0.5, 0.3, 1.2), true, n));
    let (first, second) = (Panorama::new(&a), Panorama::new(&b));
    let keep = kept(&second, &[&first], 2.0);
    let (mut behind, mut rest, mut kept_rest) = (0, 0, 0);
    for (i, keep) in keep.iter().enumerate() {
        let p = second.point(i as u32) + Vec3::new(0.5, 0.3, 1.2);
        // The screen's shadow from the origin on the wall x = 4 is twice as large as the screen.
        let shadow = p.x > 3.99 && p.y.abs().max(p.z.abs()) < 1.9;
        if shadow {
            behind += 1;
            assert!(*keep, "{p} was hidden from the first sample");
        } else {
            rest += 1;
            kept_rest += usize::from(*keep);
        }
    }
    assert!(behind > 200, "{behind}");
    assert!(kept_rest * 20 < rest, "{kept_rest} of {rest} points are kept though the first sample has them");
    assert!(kept(&first, &[], 2.0).iter().all(|k| *k), "an intra sample keeps all");
}

#[test]
fn a_dense_mesh_is_closed_around_the_eye_and_faces_it() {
    let views = room(DVec3::new(0.4, 0.2, -0.3), false, 24);
    let p = Panorama::new(&views);
    let mesh = dense(&p, &vec![true; p.pixels() as usize]);
    assert_eq!(mesh.triangles(), 2 * 6 * 24 * 24);
    assert!(border(&mesh.indices).is_empty());
    for t in mesh.indices.as_chunks::<3>().0 {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        assert!(a.dot(b.cross(c)) < 0.0, "seen from the eye, counter-clockwise triangles turn their front to it");
    }
}

#[test]
fn a_room_becomes_a_few_triangles_that_stay_in_their_pictures_and_within_the_limits() {
    let n = 64;
    let views = room(DVec3::ZERO, true, n);
    let p = Panorama::new(&views);
    let mesh = dense(&p, &vec![true; p.pixels() as usize]);
    let extremes = extremes(n);
    let out = simplify(&mesh, &extremes, &LIMITS).unwrap();
    assert!(out.views.len() * 20 < mesh.triangles(), "{} of {}", out.views.len(), mesh.triangles());
    let cameras: Vec<Camera> = views.iter().map(|v| v.0).collect();
    for (t, view) in out.indices.as_chunks::<3>().0.iter().zip(&out.views) {
        for v in t {
            let px = cameras[*view as usize].project(out.positions[*v as usize]).unwrap();
            let within = |v: f32| (-0.01..=n as f32 + 0.01).contains(&v);
            assert!(within(px.x) && within(px.y), "{px} lies outside its picture");
        }
    }
    let (old, new) = (border(&mesh.indices), border(&out.indices));
    assert!(!new.is_empty() && new.len() * 2 < old.len(), "{} of {}", new.len(), old.len());
    let off = border_off(&mesh, &out, &extremes);
    assert!(off <= LIMITS.border_px + 0.01, "a border moved by {off} px");
}

#[test]
fn wider_limits_leave_fewer_triangles_and_none_leaves_all() {
    let n = 48;
    let views = room(DVec3::new(0.4, 0.2, -0.3), true, n);
    let p = Panorama::new(&views);
    let mesh = dense(&p, &vec![true; p.pixels() as usize]);
    let count = |px: f32| {
        simplify(&mesh, &extremes(n), &Limits { border_px: px, interior_px: px, ..LIMITS }).unwrap().views.len()
    };
    let (tight, half, two) = (count(0.0), count(0.5), count(2.0));
    assert!(tight > half && half > two && two > 10, "{tight} {half} {two}");
}

/// The most that a vertex of the dense mesh's border is seen to be off the simplified mesh's, pixels, from any extreme viewpoint.
fn border_off(mesh: &Dense, out: &Simplified, extremes: &Extremes) -> f32 {
    let (old, new) = (border(&mesh.indices), border(&out.indices));
    let off = |w: &Vec3, at: Vec3| {
        let to = |[c, d]: &[u32; 2]| {
            let [c, d] = [c, d].map(|v| out.positions[*v as usize]);
            let t = ((at - c).dot(d - c) / (d - c).length_squared()).clamp(0.0, 1.0);
            let angle = (at - w).angle_between(c + (d - c) * t - w);
            // Borders stand all around: one on the other side is no near one.
            if angle < 1.5 { angle.tan() * extremes.px_per_tan } else { f32::INFINITY }
        };
        new.iter().map(to).fold(f32::INFINITY, f32::min)
    };
    let all = extremes.eyes.iter().flat_map(|w| old.iter().map(move |[a, _]| (w, mesh.positions[*a as usize])));
    all.map(|(w, at)| off(w, at)).fold(0.0, f32::max)
}

#[test]
fn borders_follow_their_own_limit_where_points_were_left_to_an_ancestor_too() {
    let n = 64;
    let (a, b) = (room(DVec3::ZERO, true, n), room(DVec3::new(0.5, 0.3, 1.2), true, n));
    let (first, second) = (Panorama::new(&a), Panorama::new(&b));
    // Beside what is kept, a corner of the floor like a chessboard, squares that meet in points, and a disc of the wall behind.
    let mut keep = kept(&second, &[&first], 2.0);
    for (i, keep) in keep.iter_mut().enumerate() {
        let at = second.place(i as u32);
        let chess = at.view == 3 && at.x.max(at.y) < 32 && (at.x / 8 + at.y / 8) % 2 == 0;
        let disc = at.view == 1 && (f64::from(at.x) - 31.5).hypot(f64::from(at.y) - 31.5) < 24.0;
        *keep |= chess || disc;
    }
    let mesh = dense(&second, &keep);
    assert!(mesh.knots().contains(&true), "no borders meet in a point: the test would not see them torn");
    let off = |border_px: f32, interior_px: f32| {
        let out = simplify(&mesh, &extremes(n), &Limits { border_px, interior_px, ..LIMITS }).unwrap();
        border_off(&mesh, &out, &extremes(n))
    };
    let (tight, wide) = (off(0.25, 8.0), off(8.0, 0.25));
    assert!(tight <= 0.26 && wide > 0.5, "{tight} {wide}");
}

#[test]
fn nothing_to_simplify_is_nothing() {
    assert!(LiveMesh::new(&[], &[], &[]).is_ok());
    assert_eq!(simplify(&Dense::default(), &extremes(8), &LIMITS).unwrap(), Simplified::default());
}

#[test]
fn every_triangle_has_its_texels_once_and_what_nobody_shows_is_not_stored() {
    let n = 128;
    let (a, b) = (room(DVec3::ZERO, true, n), room(DVec3::new(0.5, 0.3, 1.2), true, n));
    let (first, second) = (Panorama::new(&a), Panorama::new(&b));
    let cameras: Vec<Camera> = b.iter().map(|v| v.0).collect();
    let keep = kept(&second, &[&first], 2.0);
    for (keep, most) in [(vec![true; keep.len()], 1.4), (keep.clone(), 0.5)] {
        let mesh = simplify(&dense(&second, &keep), &extremes(n), &LIMITS).unwrap();
        let found = patches(&cameras, &mesh);
        let mut times = vec![0; mesh.views.len()];
        for patch in &found {
            let [x, y, w, h] = patch.rect.map(|v| v as f32);
            assert!(x + w <= n as f32 && y + h <= n as f32);
            for &t in &patch.triangles {
                times[t as usize] += 1;
                assert_eq!(mesh.views[t as usize] as usize, patch.view);
                for v in &mesh.indices[3 * t as usize..3 * t as usize + 3] {
                    let px = cameras[patch.view].project(mesh.positions[*v as usize]).unwrap();
                    let within = |v: f32, lo: f32, size: f32| (lo - 0.01..=lo + size + 0.01).contains(&v);
                    assert!(within(px.x, x, w) && within(px.y, y, h), "{px} in {:?}", patch.rect);
                }
            }
        }
        assert!(times.iter().all(|t| *t == 1));
        let texels: u32 = found.iter().map(|p| p.rect[2] * p.rect[3]).sum();
        assert!(f64::from(texels) < most * f64::from(6 * n * n), "{texels} texels");
    }
}
