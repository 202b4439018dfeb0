//! Parts textured by projection.

use farfield_core::backend::{Backend, BlockData};
use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::id::Block;
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::payload::{AtlasPart, MeshPart, Part, Payload, ProjectedPart, Projector};
use farfield_core::{Aabb, Camera};
use glam::{DAffine3, DVec3, Mat4, Vec3, Vec4};

use super::Make;
use super::fixture::*;

pub(super) fn all(make: Make<'_>) {
    from_the_projector_itself(make);
    between_two(make);
    rectangles(make);
}

/// The projector that throws what `camera` saw, from a rectangle at `corner` of a layer.
fn projector(camera: &Camera, origin: DVec3, atlas: u32, layer: u32, corner: [u32; 2]) -> Projector {
    let [w, h] = camera.size.map(|v| v as f32);
    let [x, y] = corner.map(|v| v as f32);
    // u w = ((clip.x / w + 1) / 2 * width + x) w, and so on; rows count from the top.
    let texels = Mat4::from_cols(
        Vec4::new(0.5 * w, 0.0, 0.0, 0.0),
        Vec4::new(0.0, -0.5 * h, 0.0, 0.0),
        Vec4::new(0.0, 0.0, 1.0, 0.0),
        Vec4::new(0.5 * w + x, 0.5 * h + y, 0.0, 1.0),
    );
    let eye = (camera.eye - origin).as_vec3();
    Projector {
        matrix: texels * camera.projection() * Mat4::from_translation(-eye),
        eye,
        atlas: payload(atlas).id,
        layer,
        rect: [corner[0], corner[1], camera.size[0], camera.size[1]],
    }
}

fn byte(n: Vec3) -> [u8; 4] {
    let b = |v: f32| ((v * 0.5 + 0.5) * 255.0 + 0.5) as u8;
    [b(n.x), b(n.y), b(n.z), 255]
}

fn upload(backend: &mut dyn Backend, id: u32, origin: DVec3, part: Part) {
    let p = Payload { origin, bounds: Aabb::EMPTY, parts: vec![part] };
    backend.upload(Block::Payload(payload(id)), &BlockData::Payload(&p)).expect("a payload");
}

/// A bumpy square of 12 x 12 cells with a colour a vertex, at a place far from the frame's origin.
fn bumpy() -> MeshPart {
    let mut m = MeshPart::default();
    let n = 13u32;
    for j in 0..n {
        for i in 0..n {
            let (x, y) = (i as f32 / 6.0 - 1.0, j as f32 / 6.0 - 1.0);
            m.positions.push(Vec3::new(x, y, 0.15 * (5.0 * x).sin() * (4.0 * y).cos()));
            m.normals.push(Vec3::new((i % 3) as f32 - 1.0, (j % 3) as f32 - 1.0, 2.0).normalize());
            m.albedo.push([(60 + 37 * i % 190) as u8, (60 + 53 * j % 190) as u8, (60 + 29 * (i + j) % 190) as u8, 255]);
        }
    }
    for j in 0..n - 1 {
        for i in 0..n - 1 {
            let a = j * n + i;
            m.indices.extend([a, a + 1, a + n + 1, a, a + n + 1, a + n]);
        }
    }
    m
}

/// Seen from where the projector stands, through its own picture, a projected part looks as what was captured.
fn from_the_projector_itself(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let origin = DVec3::new(3e6, -2e5, 1e6);
    let mut backend = make(&scene);
    upload(&mut *backend, 0, origin, Part::Mesh(bumpy()));
    let mut camera = ahead(&scene, DVec3::ZERO, [64, 48]);
    camera.eye = origin + DVec3::new(0.5, 0.3, 3.0);
    let (direct, _) = render(&mut *backend, &camera, vec![part(0, 0, 1)]);

    // The capture as layer 1 of an atlas of larger layers, its background filled with what must not show.
    let (size, corner) = ([100, 70], [20, 11]);
    let mut atlas = AtlasPart { size, layers: 2, albedo: vec![[255, 0, 255, 0]; 14000], normal: vec![[0; 4]; 14000] };
    for (p, _) in pixels(camera.size) {
        let (i, at) = (direct.at(p[0], p[1]), (7000 + (p[1] + corner[1]) * size[0] + p[0] + corner[0]) as usize);
        if direct.hit(i) {
            (atlas.albedo[at], atlas.normal[at]) = (direct.albedo[i], byte(from_octahedral(direct.normal[i])));
        }
    }
    upload(&mut *backend, 1, DVec3::ZERO, Part::Atlas(atlas));
    // Vertices of another colour: where the projector does not serve, it shows.
    let mesh = MeshPart { albedo: vec![[0, 0, 0, 255]; 169], ..bumpy() };
    let views = vec![1; mesh.indices.len() / 3];
    let projectors = vec![projector(&camera, origin, 1, 1, corner)];
    upload(&mut *backend, 2, origin, Part::Projected(ProjectedPart { mesh, views, projectors }));
    let (again, counted) = render(&mut *backend, &camera, vec![part(2, 0, 1)]);
    assert_eq!(counted.far_triangles, 288);
    assert_eq!(direct.object, again.object, "projection changes what is covered");
    let mut seen = 0;
    for (p, _) in pixels(camera.size) {
        let i = direct.at(p[0], p[1]);
        // Texels are hit within a thousandth: only next to the background may a trace of it mix in.
        if direct.hit(i) && all_hit_around(&direct, p) {
            seen += 1;
            let a = direct.albedo[i];
            let normal = from_octahedral(direct.normal[i]);
            let e = Expected { albedo: [a[0], a[1], a[2]], normal, depth: direct.depth[i], object: 1 };
            check("seen from its projector", &again, p, Some(e), 2);
        }
    }
    assert!(seen > 200, "only {seen} pixels to judge");

    // Triangles that no projector sees keep their vertices' colour.
    let mesh = MeshPart { albedo: vec![[40, 50, 60, 255]; 169], ..bumpy() };
    let projectors = vec![projector(&camera, origin, 1, 1, corner)];
    upload(&mut *backend, 3, origin, Part::Projected(ProjectedPart { views: vec![0; 288], mesh, projectors }));
    let (blind, _) = render(&mut *backend, &camera, vec![part(3, 0, 1)]);
    for (p, _) in pixels(camera.size) {
        let i = direct.at(p[0], p[1]);
        if direct.hit(i) {
            let normal = from_octahedral(direct.normal[i]);
            let e = Expected { albedo: [40, 50, 60], normal, depth: direct.depth[i], object: 1 };
            check("seen by no projector", &blind, p, Some(e), 1);
        }
    }
}

fn all_hit_around(image: &SurfaceImage, [x, y]: [u32; 2]) -> bool {
    let [w, h] = image.size;
    x > 0
        && y > 0
        && x + 1 < w
        && y + 1 < h
        && (y - 1..=y + 1).all(|v| (x - 1..=x + 1).all(|u| image.hit(image.at(u, v))))
}

/// Three projectors of one colour each over a square: of those in a triangle's set the two nearest in angle mix by their
/// angles, in linear light, from two atlases.
fn between_two(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let mut backend = make(&scene);
    let at = |x: f32| Camera::looking(DVec3::new(f64::from(x), 0.0, 3.0), -Vec3::Z, Vec3::Y, 1.5, [8, 8], 0.01);
    let flat = |layers: &[[u8; 4]]| AtlasPart {
        size: [8, 8],
        layers: layers.len() as u32,
        albedo: layers.iter().flat_map(|&c| vec![c; 64]).collect(),
        normal: vec![byte(Vec3::Z); 64 * layers.len()],
    };
    let (red, blue, green) = ([250, 30, 60, 255], [40, 60, 240, 255], [10, 240, 20, 255]);
    upload(&mut *backend, 1, DVec3::ZERO, Part::Atlas(flat(&[green, red])));
    upload(&mut *backend, 2, DVec3::ZERO, Part::Atlas(flat(&[blue])));
    let projectors = vec![
        projector(&at(1.0), DVec3::ZERO, 2, 0, [0, 0]),
        projector(&at(-1.0), DVec3::ZERO, 1, 1, [0, 0]),
        projector(&at(0.0), DVec3::ZERO, 1, 0, [0, 0]),
    ];
    let colors = [blue, red, green];
    // The lower right triangle does not see the green one in the middle, the upper left sees all.
    let views = vec![0b011, 0b111];
    let part_of = ProjectedPart { mesh: quad_part([0; 4]), views: views.clone(), projectors: projectors.clone() };
    upload(&mut *backend, 3, DVec3::ZERO, Part::Projected(part_of));
    for x in [-1.0, -0.6, 0.0, 0.3, 2.0] {
        let camera = Camera { size: [64, 64], ..at(x) };
        let (image, _) = render(&mut *backend, &camera, vec![part(3, 0, 9)]);
        let mut seen = [0, 0];
        for (p, c) in pixels(camera.size) {
            let ray = camera.ray(c.x, c.y);
            let point = camera.eye.as_vec3() + ray * 3.0;
            let px = 2.0 * camera.px_per_tan().recip() * 3.0;
            // Away from the edges and the diagonal, and from where two projectors are equally near.
            if point.abs().max_element() > 1.0 - px || (point.x - point.y).abs() < px {
                continue;
            }
            let triangle = usize::from(point.y > point.x);
            let angle = |i: usize| {
                let to = |e: Vec3| (e - point).as_dvec3().normalize();
                1.0 - to(camera.eye.as_vec3()).dot(to(projectors[i].eye))
            };
            let mut order: Vec<usize> = (0..3).filter(|i| views[triangle] >> i & 1 == 1).collect();
            order.sort_by(|&i, &j| angle(i).total_cmp(&angle(j)));
            if order.len() > 2 && angle(order[2]) - angle(order[1]) < 1e-4 {
                continue;
            }
            let (a, b) = (angle(order[0]), angle(order[1]));
            if a + b < 1e-3 {
                continue;
            }
            let w = (b / (a + b)) as f32;
            let albedo = [0, 1, 2].map(|k| {
                let of = |i: usize| linear_of_byte(colors[order[i]][k]);
                byte_of_linear(of(0) * w + of(1) * (1.0 - w))
            });
            seen[triangle] += 1;
            check(
                &format!("between two, eye at {x}"),
                &image,
                p,
                Some(Expected { albedo, normal: Vec3::Z, depth: 3.0, object: 9 }),
                2,
            );
        }
        assert!(seen[0] > 20 && seen[1] > 20, "too few pixels to judge at {x}: {seen:?}");
    }
}

/// Look-ups stay half a texel within the projector's rectangle: its neighbours in the atlas never show.
fn rectangles(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let mut backend = make(&scene);
    // A projector whose picture covers the middle of the square only: outside, its border is drawn out.
    let small = Camera::looking(DVec3::Z * 3.0, -Vec3::Z, Vec3::Y, 0.2, [4, 4], 0.01);
    let (inner, outer) = ([90, 120, 150, 255], [255, 0, 255, 255]);
    let albedo = (0..144).map(|i| if (4..8).contains(&(i % 12)) && (4..8).contains(&(i / 12)) { inner } else { outer });
    let atlas = AtlasPart { size: [12, 12], layers: 1, albedo: albedo.collect(), normal: vec![byte(Vec3::Z); 144] };
    upload(&mut *backend, 1, DVec3::ZERO, Part::Atlas(atlas));
    let projectors = vec![projector(&small, DVec3::ZERO, 1, 0, [4, 4])];
    upload(
        &mut *backend,
        2,
        DVec3::ZERO,
        Part::Projected(ProjectedPart { mesh: quad_part([0; 4]), views: vec![1; 2], projectors }),
    );
    let camera = Camera { size: [32, 32], ..Camera::looking(DVec3::Z * 3.0, -Vec3::Z, Vec3::Y, 0.6, [32, 32], 0.01) };
    let (image, _) = render(&mut *backend, &camera, vec![part(2, 0, 1)]);
    for (p, c) in pixels(camera.size) {
        let on = camera.ray(c.x, c.y).truncate().abs().max_element() * 3.0;
        if on < 0.95 {
            let e = Expected { albedo: [90, 120, 150], normal: Vec3::Z, depth: 3.0, object: 1 };
            check("a rectangle", &image, p, Some(e), 1);
        }
    }
}
