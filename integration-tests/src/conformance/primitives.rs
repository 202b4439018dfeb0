//! Points and lines: which pixels they cover, against every pixel's centre; what hides them and what they hide; their sides, the near
//! distance, the picture's edges; what is refused.
//!
//! Pixels whose centre lies closer than [`EDGE_PX`] to the edge of what covers them are asked nothing.

use farfield_core::backend::{Backend, BlockData, Counted, upload_scene};
use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::draw::{Draw, DrawList};
use farfield_core::id::Block;
use farfield_core::image::SurfaceImage;
use farfield_core::payload::{LinesPart, Part, Payload, PointsPart};
use farfield_core::scene::{Scene, SceneBuilder};
use farfield_core::{Aabb, Camera, Fault};
use farfield_cpu::{CpuBackend, CpuOptions};
use glam::{DAffine3, DVec3, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Make;
use super::fixture::*;

/// How near to an edge nothing is asked, pixels: numbers of 32 bits place points to a ten-thousandth of a pixel here.
const EDGE_PX: f32 = 0.01;

pub(super) fn all(make: Make<'_>) {
    sizes(make);
    depth_order(make);
    sides(make);
    near_and_beside(make);
    many_in_shared_pages(make);
    one_line(make);
    lines_before_the_eye(make);
    nothing_and_nonsense(make);
    cloud(make);
}

const COLOR: [u8; 4] = [200, 100, 50, 255];

fn payload_of(origin: DVec3, parts: Vec<Part>) -> Payload {
    Payload { origin, bounds: Aabb::EMPTY, parts }
}

fn upload(backend: &mut dyn Backend, id: u32, p: &Payload) {
    backend.upload(Block::Payload(payload(id)), &BlockData::Payload(p)).expect("a payload is uploaded");
}

/// Points of one colour and one normal.
fn points(positions: Vec<Vec3>, normal: Vec3, radius: f32, two_sided: bool) -> PointsPart {
    let n = positions.len();
    PointsPart { positions, normals: vec![normal; n], albedo: vec![COLOR; n], radius, two_sided }
}

/// Lines between pairs, of one colour, normals towards +z.
fn lines(pairs: &[[Vec3; 2]]) -> LinesPart {
    let positions = pairs.concat();
    let n = positions.len();
    LinesPart { positions, normals: vec![Vec3::Z; n], albedo: vec![COLOR; n], indices: (0..n as u32).collect() }
}

fn seen(normal: Vec3, depth: f32, object: u32) -> Expected {
    Expected { albedo: [COLOR[0], COLOR[1], COLOR[2]], normal, depth, object }
}

fn nothing() -> Scene {
    SceneBuilder::default().build().expect("an empty scene")
}

/// An off-axis camera at the origin that looks along -z, with pixels that are not square.
fn off_axis(size: [u32; 2]) -> Camera {
    let mut c = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, size, 0.05);
    (c.left, c.top) = (c.left * 1.3, c.top * 0.7);
    c
}

/// Draws one part of payload 0, which stands at the origin.
fn shoot_part(backend: &mut dyn Backend, camera: &Camera, part_of: Part) -> (SurfaceImage, Counted) {
    upload(backend, 0, &payload_of(DVec3::ZERO, vec![part_of]));
    render(backend, camera, vec![part(0, 0, 77)])
}

/// Splats from a tenth of a pixel to more than the picture, within it, across its edges and outside.
fn sizes(make: Make<'_>) {
    let mut backend = make(&nothing());
    for (size, centre, z, radius) in [
        ([32, 24], Vec2::new(16.3, 12.6), 3.0, 0.0),
        ([32, 24], Vec2::new(16.3, 12.6), 3.0, 0.01),
        ([32, 24], Vec2::new(5.1, 20.2), 3.0, 0.35),
        ([33, 47], Vec2::new(20.7, 9.4), 8.0, 2.0),
        ([32, 24], Vec2::new(-2.3, 11.2), 2.0, 0.3),
        ([32, 24], Vec2::new(34.4, 26.1), 2.0, 0.4),
        ([32, 24], Vec2::new(-4.0, 11.2), 2.0, 0.0),
        ([1, 1], Vec2::new(0.5, 0.5), 5.0, 0.1),
        ([40, 40], Vec2::new(-300.0, 20.0), 5.0, 1e9),
        ([40, 40], Vec2::new(20.0, 20.0), 1e6, 3e4),
    ] {
        let camera = off_axis(size);
        let at = camera.ray(centre.x, centre.y) * z;
        let (image, counted) =
            shoot_part(&mut *backend, &camera, Part::Points(points(vec![at], Vec3::Z, radius, false)));
        assert_eq!((counted.points, counted.lines, counted.far_triangles, counted.samples), (1, 0, 0, 0));
        let px_per_tan =
            Vec2::new(size[0] as f32 / (camera.right_tan - camera.left), size[1] as f32 / (camera.top - camera.bottom));
        let half = (radius / z * px_per_tan).max(Vec2::splat(0.5));
        let what = format!("a splat of {half} px at {centre} of {size:?}");
        let mut covered = 0;
        for (p, c) in pixels(size) {
            let inside = (half - (c - centre).abs()).min_element();
            if inside > EDGE_PX {
                check(&what, &image, p, Some(seen(Vec3::Z, z, 77)), 1);
                covered += 1;
            } else if inside < -EDGE_PX {
                check(&what, &image, p, None, 0);
            }
        }
        assert_eq!(covered == 0, centre.x + half.x < 0.5, "{what}: {covered} pixels asked");
    }
}

/// Points and lines before, behind and beside a square; of points at one depth the first; a far origin.
fn depth_order(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::from_translation(DVec3::new(1e6, 0.0, 3e6))]);
    let mut backend = make(&scene);
    upload_scene(&mut *backend, &scene).expect("the scene is uploaded");
    let origin = DVec3::new(1e6, 0.0, 3e6) - scene.origin;
    let camera = Camera { eye: origin + DVec3::Z * 4.0, ..ahead(&scene, DVec3::ZERO, [64, 64]) };
    let px = |p: Vec3| {
        let px = camera.project(p - Vec3::Z * 4.0).expect("ahead");
        [px.x as u32, px.y as u32]
    };
    let at = |x: f32, z: f32| Vec3::new(x, 0.03, z);
    let spots = [at(-0.8, 0.5), at(-0.5, -0.5), at(1.4, -1.0)];
    let strokes = [[at(-0.2, 0.5), at(0.0, 0.5)], [at(0.2, -0.5), at(0.4, -0.5)], [at(1.8, -1.0), at(1.9, -1.0)]];
    let square = Expected { albedo: [255; 3], normal: Vec3::Z, depth: 4.0, object: 1 };
    let both = payload_of(
        origin,
        vec![Part::Points(points(spots.to_vec(), Vec3::Z, 0.05, false)), Part::Lines(lines(&strokes))],
    );
    upload(&mut *backend, 0, &both);
    // Whatever the order of the draws.
    let draws = || [everything(&scene), vec![part(0, 0, 5)], vec![part(0, 1, 6)]];
    for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
        let (image, counted) = render(&mut *backend, &camera, order.iter().flat_map(|&i| draws()[i].clone()).collect());
        assert_eq!((counted.near_triangles, counted.far_triangles, counted.points, counted.lines), (2, 0, 3, 3));
        check("a point before the square", &image, px(spots[0]), Some(seen(Vec3::Z, 3.5, 5)), 1);
        check("a point behind it", &image, px(spots[1]), Some(square), 1);
        check("a point beside it", &image, px(spots[2]), Some(seen(Vec3::Z, 5.0, 5)), 1);
        let middle = |i: usize| px((strokes[i][0] + strokes[i][1]) * 0.5);
        check("a line before the square", &image, middle(0), Some(seen(Vec3::Z, 3.5, 6)), 1);
        check("a line behind it", &image, middle(1), Some(square), 1);
        check("a line beside it", &image, middle(2), Some(seen(Vec3::Z, 5.0, 6)), 1);
    }
    let mut same = points(vec![Vec3::ZERO; 2], Vec3::Z, 0.2, false);
    same.albedo[0] = [1, 2, 3, 255];
    upload(&mut *backend, 0, &payload_of(origin, vec![Part::Points(same)]));
    let first = Expected { albedo: [1, 2, 3], ..seen(Vec3::Z, 4.0, 9) };
    let (image, _) = render(&mut *backend, &camera, vec![part(0, 0, 9)]);
    check("of two at one depth the first", &image, [32, 32], Some(first), 1);
}

/// Which sides of points are drawn, by each one's own direction to the eye; lines from all sides with their own normals.
fn sides(make: Make<'_>) {
    let mut backend = make(&nothing());
    let camera = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.5, [64, 64], 0.05);
    // Far left and far right of the picture a normal along +x faces the eye on the left only, though the camera's axis is at right
    // angles to it.
    let [left, right] = [Vec3::new(-2.0, 0.0, -3.0), Vec3::new(2.0, 0.0, -3.0)];
    let pixel = |p: Vec3| {
        let px = camera.project(p).expect("ahead");
        [px.x as u32, px.y as u32]
    };
    for two_sided in [false, true] {
        let part = points(vec![left, right], Vec3::X, 0.3, two_sided);
        let (image, _) = shoot_part(&mut *backend, &camera, Part::Points(part));
        let what = format!("two-sided: {two_sided}");
        check(&what, &image, pixel(left), Some(seen(Vec3::X, 3.0, 77)), 1);
        check(&what, &image, pixel(right), Some(seen(-Vec3::X, 3.0, 77)).filter(|_| two_sided), 1);
    }
    for normal in [Vec3::Z, -Vec3::Z, Vec3::new(0.6, -0.8, 0.0)] {
        let mut part = lines(&[[left, right]]);
        part.normals = vec![normal; 2];
        let (image, _) = shoot_part(&mut *backend, &camera, Part::Lines(part));
        check("a line keeps its normal", &image, [32, 32], Some(seen(normal, 3.0, 77)), 1);
    }
}

/// The near distance counts for a point's own depth, and cuts lines; what stands behind the eye is not seen.
fn near_and_beside(make: Make<'_>) {
    let mut backend = make(&nothing());
    let camera = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [24, 24], 2.0);
    for (z, drawn) in [(2.01, true), (1.99, false), (0.5, false), (0.0, false), (-3.0, false)] {
        let part = points(vec![Vec3::new(0.01, 0.02, -z)], Vec3::Z, 1.0, true);
        let (image, counted) = shoot_part(&mut *backend, &camera, Part::Points(part));
        assert_eq!(counted.points, 1, "what is submitted is counted");
        check(&format!("a point at depth {z}"), &image, [12, 12], drawn.then(|| seen(Vec3::Z, z, 77)), 1);
    }
    // Far beside the picture, on all sides, and through all of it.
    for (a, b) in [(-1e4, -9e3), (9e3, 1e4)] {
        for turn in [Vec3::X, Vec3::Y, Vec3::new(0.7, 0.7, 0.0)] {
            let ends = [turn * a - Vec3::Z * 5.0, turn * b - Vec3::Z * 5.0];
            let (image, _) = shoot_part(&mut *backend, &camera, Part::Lines(lines(&[ends])));
            pixels(camera.size).for_each(|(p, _)| check("a line beside the picture", &image, p, None, 0));
        }
    }
    let across = [Vec3::new(-1e5, 0.05, -5.0), Vec3::new(1e5, 0.05, -5.0)];
    let (image, _) = shoot_part(&mut *backend, &camera, Part::Lines(lines(&[across])));
    for (p, _) in pixels(camera.size) {
        check("a line through the picture", &image, p, (p[1] == 11).then(|| seen(Vec3::Z, 5.0, 77)), 1);
    }
}

/// More elements than any draw takes at once, in two parts that share pages: every one is drawn, with its own colour, in its own
/// pixel. The first part goes and another one takes its place.
fn many_in_shared_pages(make: Make<'_>) {
    let mut backend = make(&nothing());
    let size = [220, 160];
    let camera = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, size, 0.05);
    let color = |i: usize| [(i % 251) as u8, (i / 251) as u8, 7, 255];
    let place = |i: usize| camera.ray((i % 220) as f32 + 0.5, (i / 220) as f32 + 0.5) * (2.0 + (i % 5) as f32);
    let n = 220 * 160;
    let of = |all: std::ops::Range<usize>, as_lines: bool| {
        let (positions, albedo): (Vec<_>, Vec<_>) = all.map(|i| (place(i), color(i))).unzip();
        let n = positions.len();
        let normals = vec![Vec3::Z; n];
        // A line of no length is a pixel, as is a point of no size.
        let indices = (0..n as u32).flat_map(|i| [i, i]).collect();
        payload_of(
            DVec3::ZERO,
            vec![match as_lines {
                true => Part::Lines(LinesPart { positions, normals, albedo, indices }),
                false => Part::Points(PointsPart { positions, normals, albedo, radius: 0.0, two_sided: false }),
            }],
        )
    };
    for as_lines in [false, true] {
        let cut = 17_003;
        upload(&mut *backend, 0, &of(0..cut, as_lines));
        upload(&mut *backend, 1, &of(cut..n, as_lines));
        for again in [false, true] {
            if again {
                backend.release(Block::Payload(payload(0)));
                upload(&mut *backend, 2, &of(0..5, as_lines));
                upload(&mut *backend, 0, &of(0..cut, as_lines));
            }
            let (image, counted) = render(&mut *backend, &camera, vec![part(1, 0, 2), part(0, 0, 1)]);
            let expected = if as_lines { (0, n as u64) } else { (n as u64, 0) };
            assert_eq!((counted.points, counted.lines), expected);
            for (p, _) in pixels(size) {
                let i = (p[1] * size[0] + p[0]) as usize;
                let [r, g, b, _] = color(i);
                let object = if i < cut { 1 } else { 2 };
                let e = Expected { albedo: [r, g, b], ..seen(Vec3::Z, 2.0 + (i % 5) as f32, object) };
                check(&format!("many, lines: {as_lines}"), &image, p, Some(e), 1);
            }
        }
    }
}

/// The pixels of single lines in all directions, one a step along the longer axis, with depth, colour and normal from their place.
fn one_line(make: Make<'_>) {
    let mut backend = make(&nothing());
    let camera = off_axis([48, 40]);
    let (red, blue) = ([250, 20, 40, 255], [10, 40, 220, 255]);
    let (one, other) = (Vec3::new(0.0, 0.6, 0.8), Vec3::new(0.8, 0.0, 0.6));
    for i in 0..24 {
        let angle = 0.1 + i as f32 * std::f32::consts::TAU / 24.0;
        let (a, b) = (Vec2::new(23.3, 19.6), Vec2::new(23.3, 19.6) + 15.3 * Vec2::from_angle(angle));
        let (near, far) = (2.0, 9.0);
        let mut part = lines(&[[camera.ray(a.x, a.y) * near, camera.ray(b.x, b.y) * far]]);
        part.albedo = vec![red, blue];
        part.normals = vec![one, other];
        let (image, counted) = shoot_part(&mut *backend, &camera, Part::Lines(part));
        assert_eq!((counted.lines, counted.points, counted.far_triangles), (1, 0, 0));
        let d = b - a;
        let steep = d.y.abs() > d.x.abs();
        for (p, c) in pixels(camera.size) {
            let t = if steep { (c.y - a.y) / d.y } else { (c.x - a.x) / d.x };
            let off = (c - a - d * t).abs().max_element();
            let what = format!("line {i}, {t} along, {off} px off");
            // Steps that hold an end are the line's too: how far they reach beyond it is asked below.
            if off > 0.5 + EDGE_PX {
                check(&what, &image, p, None, 0);
            } else if off < 0.5 - EDGE_PX && (0.0..=1.0).contains(&t) {
                // 1 / depth is linear in the picture; attributes in the scene, where the place is s along.
                let depth = 1.0 / ((1.0 - t) / near + t / far);
                let s = (depth - near) / (far - near);
                let mix = |k: usize| {
                    let (a, b): (f32, f32) = (linear_of_byte(red[k]), linear_of_byte(blue[k]));
                    byte_of_linear(a + (b - a) * s)
                };
                let normal = one.lerp(other, s).normalize();
                check(&what, &image, p, Some(Expected { albedo: [0, 1, 2].map(mix), normal, depth, object: 77 }), 2);
            }
        }
        for (end, depth) in [(a, near), (b, far)] {
            let hit = (0..9).map(|k| (end.x as u32 + k % 3 - 1, end.y as u32 + k / 3 - 1)).map(|(x, y)| image.at(x, y));
            let depths: Vec<f32> = hit.filter(|&k| image.hit(k)).map(|k| image.depth[k]).collect();
            assert!(
                !depths.is_empty() && depths.iter().all(|d| *d > 1.999 && *d < 9.001),
                "line {i}: {depths:?} by {depth}"
            );
        }
        let steps = if steep { (a.y.floor() - b.y.floor()).abs() } else { (a.x.floor() - b.x.floor()).abs() } + 1.0;
        let hits = image.object.iter().filter(|&&o| o != 0).count();
        assert_eq!(hits, steps as usize, "line {i}: a pixel a step, both ends included");
    }
}

/// A line from behind the eye to far ahead is cut at the near distance.
fn lines_before_the_eye(make: Make<'_>) {
    let mut backend = make(&nothing());
    let mut camera = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [32, 64], 0.05);
    camera.near = 2.5;
    let part = lines(&[[Vec3::new(0.03, -1.0, 5.0), Vec3::new(0.03, -1.0, -80.0)]]);
    let (image, _) = shoot_part(&mut *backend, &camera, Part::Lines(part));
    for y in 0..64 {
        let ray = camera.ray(16.5, y as f32 + 0.5);
        let depth = -1.0 / ray.y;
        let hit: Vec<u32> = (0..32).filter(|&x| image.hit(image.at(x, y))).collect();
        if ray.y < 0.0 && depth > 2.6 && depth < 75.0 {
            assert_eq!(hit, [16], "row {y}");
            check("a line under the eye", &image, [16, y], Some(seen(Vec3::Z, depth, 77)), 1);
        } else if ray.y > 0.0 || depth < 2.4 {
            assert!(hit.is_empty(), "row {y}: {hit:?}");
        }
    }
}

/// Parts without points and lines are no errors; places that are none, radii below 0 and object 0 are refused.
fn nothing_and_nonsense(make: Make<'_>) {
    let mut backend = make(&nothing());
    let camera = off_axis([9, 7]);
    for part in [Part::Points(PointsPart::default()), Part::Lines(LinesPart::default())] {
        let (image, counted) = shoot_part(&mut *backend, &camera, part);
        assert_eq!((counted.points, counted.lines), (0, 0));
        pixels(camera.size).for_each(|(p, _)| check("no points, no lines", &image, p, None, 0));
    }
    let good = points(vec![-Vec3::Z], Vec3::Z, 0.1, false);
    let no_place = PointsPart { positions: vec![Vec3::new(0.0, f32::NAN, -1.0)], ..good.clone() };
    let mut open = lines(&[[-Vec3::Z, Vec3::X]]);
    open.indices.push(0);
    let mut infinite = lines(&[[-Vec3::Z, Vec3::X]]);
    infinite.positions[1].x = f32::INFINITY;
    for (what, bad) in [
        ("lies at", Part::Points(no_place)),
        ("radius -1", Part::Points(PointsPart { radius: -1.0, ..good.clone() })),
        ("0 normals", Part::Points(PointsPart { normals: vec![], ..good.clone() })),
        ("whole lines", Part::Lines(open)),
        ("lies at", Part::Lines(infinite)),
    ] {
        let bad = payload_of(DVec3::ZERO, vec![bad]);
        match backend.upload(Block::Payload(payload(1)), &BlockData::Payload(&bad)) {
            Err(Fault::Data { cause, .. }) => assert!(cause.contains(what), "{cause}"),
            other => panic!("{what}: {other:?} instead of a fault in the data"),
        }
    }
    upload(&mut *backend, 2, &payload_of(DVec3::ZERO, vec![Part::Points(good)]));
    let list = DrawList { passes: vec![surface_pass(&camera, 0, vec![part(2, 0, 0)])] };
    assert!(matches!(backend.render(&list), Err(Fault::Refused(_))), "object 0 means nothing hit");
}

/// A cloud of points of two sizes and lines, through random triangles, against the reference: all planes agree but in a share of
/// pixels where rounding decides.
fn cloud(make: Make<'_>) {
    const MAX_SHARE: f32 = 0.001;
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let mut at = |s: f32| Vec3::new(rng.random_range(-s..s), rng.random_range(-s..s), rng.random_range(-s..s));
    let mut cloud = |radius, two_sided| {
        let positions: Vec<Vec3> = (0..900).map(|_| at(1.5)).collect();
        let normals = (0..900).map(|_| at(1.0).normalize_or(Vec3::Y)).collect();
        let albedo = (0..900).map(|i| [(i % 200) as u8 + 40, (i / 5) as u8 + 20, 90, 255]).collect::<Vec<_>>();
        PointsPart { positions, normals, albedo, radius, two_sided }
    };
    let (small, large) = (cloud(0.03, false), cloud(0.06, true));
    let PointsPart { positions, normals, albedo, .. } = cloud(0.0, false);
    let strokes = LinesPart { positions, normals, albedo, indices: (0..300).collect() };
    let payload = payload_of(DVec3::ZERO, vec![Part::Points(small), Part::Points(large), Part::Lines(strokes)]);
    let scene = scene(quad(), plain([0.4, 0.5, 0.6], true), &[DAffine3::IDENTITY]);
    let camera = Camera { eye: DVec3::new(0.7, 0.4, 2.2), ..off_axis([160, 120]) };
    let draws: Vec<Draw> =
        everything(&scene).into_iter().chain([part(0, 0, 10), part(0, 1, 11), part(0, 2, 12)]).collect();
    let of = |mut backend: Box<dyn Backend>| {
        upload_scene(&mut *backend, &scene).expect("the scene is uploaded");
        upload(&mut *backend, 0, &payload);
        render(&mut *backend, &camera, draws.clone())
    };
    let reference = of(Box::new(CpuBackend::new(&scene, CpuOptions::default()).expect("the reference")));
    let tried = of(make(&scene));
    assert_eq!((tried.1.points, tried.1.lines), (1800, 150));
    let n = reference.0.depth.len();
    let of_object = |o: u32| reference.0.object.iter().filter(|&&v| v == o).count();
    for (object, least) in [(1, 1000), (10, 200), (11, 1000), (12, 1000)] {
        assert!(of_object(object) > least, "object {object} is seen in {} of {n} pixels", of_object(object));
    }
    let differ = (0..n).filter(|&i| !super::reference::same(&reference.0, &tried.0, i)).count();
    println!("points and lines: {differ} of {n} pixels differ from the reference");
    assert!(differ as f32 <= MAX_SHARE * n as f32, "{differ} of {n} pixels differ from the reference");
}
