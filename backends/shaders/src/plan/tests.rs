use super::*;
use crate::pool::PageSizes;
use farfield_core::Aabb;
use farfield_core::backend::BlockData;
use farfield_core::draw::Shading;
use farfield_core::id::MaterialId;
use farfield_core::layered::LayeredPart;
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::{Part, Payload};
use farfield_core::scene::{Light, Material, Placement, Scene, SceneBuilder, Texture};
use glam::DAffine3;

const LIMITS: Limits = Limits { target_px: 4096, storage_bytes: 1 << 20 };

/// Two meshes, one textured with texture coordinates, placed by turns `n` times.
fn scene(n: u32) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials = vec![Material::default(), Material { texture: Some(TextureId(0)), ..Material::default() }];
    b.textures = vec![Texture { name: "t".into(), size: [1, 1], rgba: vec![[5; 4]] }];
    let triangle = |material, uvs| TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        uvs,
        indices: vec![0, 1, 2],
        sections: vec![(0..3, MaterialId(material))],
        ..TriangleMesh::default()
    };
    let meshes = [triangle(0, vec![]), triangle(1, vec![glam::Vec2::ZERO; 3])].map(|m| b.mesh("m", m).unwrap());
    for i in 0..n {
        let transform = DAffine3::from_translation(DVec3::X * f64::from(i));
        b.place(Placement { mesh: meshes[i as usize % 2], transform });
    }
    b.build().unwrap()
}

fn resident(scene: &Scene) -> Residency {
    let mut r = Residency::new(PageSizes::for_device(1 << 28), 1 << 27);
    for id in scene.mesh_chunk_ids() {
        let place = &mut |c: &farfield_core::mesh::ChunkMesh| {
            r.place(Block::Chunk(id), &BlockData::Chunk(c)).unwrap();
        };
        scene.geometry.with(id, place).unwrap();
    }
    r
}

fn surface_pass(scene: &Scene, writes: u32) -> Pass {
    let what = DrawWhat::Chunks(scene.all_chunks());
    let camera = Camera::looking(DVec3::new(0.0, 0.0, 5.0), -Vec3::Z, Vec3::Y, 1.0, [64, 48], 0.1);
    let draws = vec![Draw { what, bounds: Aabb::EMPTY, error_px: 0.0 }];
    Pass { kind: PassKind::Surface, camera, writes: TargetId(writes), draws }
}

fn shade_pass(scene: &Scene, reads: u32, lights: usize) -> Pass {
    let kind = LightKind::Directional { to_light: Vec3::Y, angle_rad: 0.0 };
    let light = Light { kind, color: Vec3::ONE, moves: false };
    let shading = Shading { ambient: Vec3::ONE, lights: vec![light; lights], sky: [1; 3], ground: [2; 3] };
    let kind = PassKind::Shade { surface: TargetId(reads), shading };
    Pass { kind, draws: vec![], ..surface_pass(scene, 9) }
}

fn planned(scene: &Scene, passes: Vec<Pass>) -> Result<FramePlan, Fault> {
    let list = DrawList { passes };
    plan(&list, &SceneTable::new(scene), &resident(scene), &Written::default(), LIMITS)
}

fn refusal(scene: &Scene, passes: Vec<Pass>) -> String {
    planned(scene, passes).unwrap_err().to_string()
}

#[test]
fn placed_chunks_that_share_their_texture_share_a_batch() {
    let scene = scene(9);
    let p = planned(&scene, vec![surface_pass(&scene, 0)]).unwrap();
    let Work::Surface(batches) = &p.passes[0].work else { panic!("a surface pass") };
    assert_eq!(batches.iter().map(|b| b.commands.len()).collect::<Vec<_>>(), [5, 4]);
    assert_eq!(batches[1].key.bind, Bind::Texture(Some(TextureId(0))));
    assert_eq!((p.near_triangles, p.far_triangles, p.records.len()), (9, 0, 9));
    for c in &p.commands {
        // The record that a command names is that of an object at its place: x of the translation, relative to the eye.
        let record = &p.records[c.first_instance as usize];
        let object = &scene.objects[record.object as usize - 1];
        assert_eq!(record.to_eye[0][3], object.placement.translation.x as f32);
        assert_eq!(record.to_eye[2][3], object.placement.translation.z as f32 - 5.0);
    }
}

#[test]
fn the_same_list_is_the_same_plan() {
    let scene = scene(40);
    let passes = || vec![surface_pass(&scene, 0), shade_pass(&scene, 0, 2), surface_pass(&scene, 3)];
    let (a, b) = (planned(&scene, passes()).unwrap(), planned(&scene, passes()).unwrap());
    assert_eq!(a, b);
    assert!(a.passes.iter().all(|p| (p.uniform_offset as usize).is_multiple_of(UNIFORM_ALIGN)));
}

/// A residency of images with so many samples each, and draws of them.
fn images(samples: &[usize]) -> (Residency, Vec<Draw>) {
    let mut r = Residency::new(PageSizes::for_device(1 << 28), 1 << 27);
    let draw = |(i, &n): (u32, &usize)| {
        let part = LayeredPart {
            camera: Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [1, 1], 0.1),
            inverse_depth: [1.0, 0.5],
            counts: vec![n as u8],
            depth: vec![0; n],
            albedo: vec![[9; 3]; n],
            normal: vec![[0, 127]; n],
            object: vec![0; n],
            objects: vec![1],
            smooth: false,
        };
        let payload = Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![Part::Layered(part)] };
        let id = farfield_core::id::PayloadRef { asset: AssetId(0), id: LocalPayload(i) };
        r.place(Block::Payload(id), &BlockData::Payload(&payload)).unwrap();
        Draw { what: DrawWhat::Payload { id, part: 0, object: 0 }, bounds: Aabb::EMPTY, error_px: 0.0 }
    };
    let draws = (0u32..).zip(samples).map(draw).collect();
    (r, draws)
}

#[test]
fn images_are_numbered_down_in_the_order_of_their_draws() {
    let scene = scene(1);
    let (r, draws) = images(&[2, 0, 3]);
    let list = DrawList { passes: vec![Pass { draws, ..surface_pass(&scene, 0) }] };
    let p = plan(&list, &SceneTable::new(&scene), &r, &Written::default(), LIMITS).unwrap();
    assert_eq!((p.samples, p.splat_bytes(), p.passes[0].layered.len()), (5, 8 * 64 * 48, 2));
    let uniform =
        |at: u32| bytemuck::pod_read_unaligned::<WarpUniform>(&p.uniforms[at as usize..][..size_of::<WarpUniform>()]);
    for (draw, (ordinal, samples)) in p.passes[0].layered.iter().zip([(255, 2), (253, 3)]) {
        for phase in 0..2 {
            let u = uniform(draw.uniform_offset + phase * UNIFORM_ALIGN as u32);
            assert_eq!((u.ordinal, u.samples, u.phase, u.objects), (ordinal, samples, phase, u.first + samples));
        }
    }
}

#[test]
fn images_that_do_not_fit_are_refused_with_their_cause() {
    let scene = scene(1);
    let refusal = |r: &Residency, draws: Vec<Draw>, limits| {
        let list = DrawList { passes: vec![Pass { draws, ..surface_pass(&scene, 0) }] };
        plan(&list, &SceneTable::new(&scene), r, &Written::default(), limits).unwrap_err().to_string()
    };
    let (r, draws) = images(&[1; 256]);
    assert!(refusal(&r, draws.clone(), LIMITS).contains("more than 255 layered depth images"));
    let tight = Limits { storage_bytes: 8 * 64 * 48 - 1, ..LIMITS };
    assert!(refusal(&r, draws[..1].to_vec(), tight).contains("64 x 48 pixels need 24576 bytes of splats"));
    let DrawWhat::Payload { id, part, .. } = draws[0].what else { panic!("a payload") };
    let named = Draw { what: DrawWhat::Payload { id, part, object: 7 }, ..draws[0].clone() };
    assert!(refusal(&r, vec![named], LIMITS).contains("objects of their own"));
}

#[test]
fn what_cannot_be_drawn_is_refused_with_its_cause() {
    let scene = scene(4);
    assert!(refusal(&scene, vec![shade_pass(&scene, 0, 0)]).contains("reads target 0, which no surface pass wrote"));
    let nine = vec![surface_pass(&scene, 0), shade_pass(&scene, 0, 9)];
    assert!(refusal(&scene, nine).contains("9 lights; it takes 8"));
    let mut small = shade_pass(&scene, 0, 0);
    small.camera.size = [8, 8];
    assert!(refusal(&scene, vec![surface_pass(&scene, 0), small]).contains("8 x 8 pixels over target 0 of 64 x 48"));
    let mut flat = surface_pass(&scene, 0);
    flat.camera.size = [0, 5];
    assert!(refusal(&scene, vec![flat]).contains("0 x 5 pixels"));
    let list = DrawList { passes: vec![surface_pass(&scene, 0)] };
    let none = Residency::new(PageSizes::for_device(1 << 28), 1 << 27);
    let fault = plan(&list, &SceneTable::new(&scene), &none, &Written::default(), LIMITS).unwrap_err();
    assert!(fault.to_string().contains("which was not uploaded"), "{fault}");
    let tight = Limits { storage_bytes: 300, ..LIMITS };
    let fault = plan(&list, &SceneTable::new(&scene), &resident(&scene), &Written::default(), tight).unwrap_err();
    assert!(fault.to_string().contains("a frame of 4 draws needs 512 bytes"), "{fault}");
}
