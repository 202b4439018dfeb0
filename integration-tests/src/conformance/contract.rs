//! Blocks come and go, passes write and read targets, and what cannot be served is refused.

use farfield_core::Fault;
use farfield_core::backend::{BlockData, upload_scene};
use farfield_core::draw::{DrawList, Pass, PassKind, Shading};
use farfield_core::id::{Block, MeshChunkId, MeshId, TargetId};
use farfield_core::mesh::ChunkMesh;
use farfield_core::payload::{AtlasPart, MeshPart, Part, Payload, ProjectedPart, Projector};
use farfield_core::scene::{ChunkSet, SceneBuilder};
use farfield_core::{Aabb, Camera};
use glam::{DAffine3, DVec3, Mat4, Vec3};

use super::Make;
use super::fixture::*;

pub(super) fn all(make: Make<'_>) {
    nothing_to_draw(make);
    blocks(make);
    refusals(make);
    targets(make);
}

fn one(part: Part) -> Payload {
    Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![part] }
}

fn refused(what: &str, r: Result<impl Sized, Fault>) {
    match r {
        Err(Fault::Refused(cause)) => assert!(!cause.is_empty(), "{what}: refused without a cause"),
        Err(other) => panic!("{what}: {other} instead of a refusal"),
        Ok(_) => panic!("{what}: served instead of refused"),
    }
}

fn nothing_to_draw(make: Make<'_>) {
    let empty = SceneBuilder::default().build().expect("an empty scene");
    let camera = ahead(&empty, DVec3::ZERO, [17, 9]);
    let mut backend = make(&empty);
    assert!(!backend.info().backend.is_empty() && !backend.info().device.is_empty());
    backend.render(&DrawList::default()).expect("an empty list is drawn");
    let (image, counted) = render(&mut *backend, &camera, vec![]);
    assert_eq!((counted.near_triangles, counted.far_triangles), (0, 0));
    pixels(camera.size).for_each(|(p, _)| check("no draws", &image, p, None, 0));
    let (image, _) = render(&mut *backend, &camera, chunks(ChunkSet::default()));
    pixels(camera.size).for_each(|(p, _)| check("no chunks", &image, p, None, 0));
    backend
        .upload(Block::Payload(payload(0)), &BlockData::Payload(&one(Part::Mesh(MeshPart::default()))))
        .expect("a mesh without triangles is no error");
    let (image, counted) = render(&mut *backend, &camera, vec![part(0, 0, 1)]);
    assert_eq!(counted.far_triangles, 0);
    pixels(camera.size).for_each(|(p, _)| check("no triangles", &image, p, None, 0));
}

fn blocks(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let camera = ahead(&scene, DVec3::Z * 2.0, [16, 16]);
    let chunk = Block::Chunk(MeshChunkId { mesh: MeshId(0), chunk: 0 });
    let mut backend = make(&scene);
    let frame = DrawList { passes: vec![surface_pass(&camera, 0, everything(&scene))] };

    refused("a chunk that was not uploaded", backend.render(&frame));
    let bytes = upload_scene(&mut *backend, &scene).expect("the scene is uploaded");
    assert!(bytes > 0, "a chunk takes no bytes");
    let counted = backend.render(&frame).expect("the frame is drawn");
    assert_eq!((counted.near_triangles, counted.far_triangles), (2, 0));
    assert!(counted.wall_ms > 0.0 && counted.gpu_ms.is_none_or(|t| t >= 0.0));

    backend.release(chunk);
    backend.release(chunk);
    refused("a chunk that was released", backend.render(&frame));
    upload_scene(&mut *backend, &scene).expect("the scene is uploaded again");
    backend.render(&frame).expect("a chunk that came back is drawn");

    let block = Block::Payload(payload(7));
    let colors = [[250, 10, 10, 255], [10, 250, 10, 255]];
    for color in colors {
        let p = one(Part::Mesh(quad_part(color)));
        backend.upload(block, &BlockData::Payload(&p)).expect("a payload is uploaded, again too");
        let (image, counted) = render(&mut *backend, &camera, vec![part(7, 0, 4_000_000_000)]);
        assert_eq!((counted.near_triangles, counted.far_triangles), (0, 2));
        let depth = (camera.eye.z) as f32;
        let [r, g, b, _] = color;
        let e = Expected { albedo: [r, g, b], normal: Vec3::Z, depth, object: 4_000_000_000 };
        check("a payload that was replaced", &image, [8, 8], Some(e), 0);
    }
    backend.release(block);
    let gone = DrawList { passes: vec![surface_pass(&camera, 0, vec![part(7, 0, 1)])] };
    refused("a payload that was released", backend.render(&gone));
    // A refusal leaves the backend as it was.
    backend.render(&frame).expect("the frame after a refusal is drawn");
}

fn refusals(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let camera = ahead(&scene, DVec3::Z * 2.0, [8, 8]);
    let mut backend = make(&scene);
    upload_scene(&mut *backend, &scene).expect("the scene is uploaded");
    let surface = |draws| DrawList { passes: vec![surface_pass(&camera, 0, draws)] };

    refused("a surface that no pass wrote", backend.read_surface(TargetId(5)));
    refused("a picture that no pass wrote", backend.read_picture(TargetId(5)));
    let shading = Shading { ambient: Vec3::ONE, lights: vec![], sky: [0; 3], ground: [0; 3] };
    let kind = PassKind::Shade { surface: TargetId(5), shading };
    let shade = Pass { kind, camera, writes: TargetId(6), draws: vec![] };
    refused("light on a surface that no pass wrote", backend.render(&DrawList { passes: vec![shade] }));
    refused("a placed chunk that the scene has not", backend.render(&surface(chunks(ChunkSet::from_range(0..9)))));

    let atlas = AtlasPart { size: [2, 2], layers: 1, albedo: vec![[9; 4]; 4], normal: vec![[128; 4]; 4] };
    backend.upload(Block::Payload(payload(0)), &BlockData::Payload(&one(Part::Atlas(atlas)))).expect("an atlas");
    refused("drawing an atlas", backend.render(&surface(vec![part(0, 0, 1)])));
    refused("drawing a part that is not there", backend.render(&surface(vec![part(0, 1, 1)])));
    let projector =
        Projector { matrix: Mat4::IDENTITY, eye: Vec3::Z, atlas: payload(1).id, layer: 0, rect: [0, 0, 2, 2] };
    let projected = ProjectedPart { mesh: quad_part([9; 4]), views: vec![1; 2], projectors: vec![projector] };
    backend
        .upload(Block::Payload(payload(2)), &BlockData::Payload(&one(Part::Projected(projected))))
        .expect("the atlas may come later");
    refused("a projector without its atlas", backend.render(&surface(vec![part(2, 0, 1)])));

    let data = |what: &str, r: Result<u64, Fault>| match r {
        Err(Fault::Data { place, cause }) => assert!(!place.is_empty() && !cause.is_empty(), "{what}: no words"),
        Err(other) => panic!("{what}: {other} instead of a fault in the data"),
        Ok(_) => panic!("{what}: taken"),
    };
    let mut bad = quad_part([1; 4]);
    bad.indices[4] = 4;
    data(
        "an index out of range",
        backend.upload(Block::Payload(payload(3)), &BlockData::Payload(&one(Part::Mesh(bad)))),
    );
    let chunk = ChunkMesh { positions: vec![Vec3::ZERO; 3], indices: vec![0, 1, 2], ..ChunkMesh::default() };
    let place = Block::Chunk(MeshChunkId { mesh: MeshId(0), chunk: 0 });
    data("a chunk without normals", backend.upload(place, &BlockData::Chunk(&chunk)));
}

fn targets(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let mut backend = make(&scene);
    upload_scene(&mut *backend, &scene).expect("the scene is uploaded");
    let near = ahead(&scene, DVec3::Z * 2.0, [24, 16]);
    let far = Camera { eye: near.eye + DVec3::Z, size: [16, 24], ..near };
    let list = DrawList {
        passes: vec![surface_pass(&near, 1, everything(&scene)), surface_pass(&far, 2, everything(&scene))],
    };
    backend.render(&list).expect("two surfaces in one frame");
    let depth = |b: &mut dyn farfield_core::backend::Backend, t: u32, c: &Camera| {
        let image = b.read_surface(TargetId(t)).expect("the surface is read");
        assert_eq!(image.size, c.size);
        image.depth[image.at(c.size[0] / 2, c.size[1] / 2)]
    };
    assert!((depth(&mut *backend, 1, &near) - near.eye.z as f32).abs() < 1e-3);
    assert!((depth(&mut *backend, 2, &far) - far.eye.z as f32).abs() < 1e-3);
    // Targets are cleared and may change their size.
    let list = DrawList { passes: vec![surface_pass(&far, 1, vec![])] };
    backend.render(&list).expect("a surface without draws");
    assert_eq!(depth(&mut *backend, 1, &far), f32::INFINITY);
}
