//! Small scenes, cameras and draw lists, and what is asked of their planes.

use farfield_core::backend::{Backend, Counted, upload_scene};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::{AssetId, LocalPayload, MaterialId, PayloadRef, TargetId};
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::MeshPart;
use farfield_core::scene::{ChunkSet, Material, Placement, Scene, SceneBuilder, Texture};
use farfield_core::{Aabb, Camera};
use glam::{DAffine3, DVec3, Vec2, Vec3};

/// The square -1..1 in the plane z = 0, facing +z, uv (0, 0) at its top left.
pub(super) fn quad() -> TriangleMesh {
    TriangleMesh {
        positions: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
        normals: vec![Vec3::Z; 4],
        uvs: [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)].map(|(u, v)| Vec2::new(u, v)).to_vec(),
        colors: vec![],
        indices: vec![0, 1, 2, 0, 2, 3],
        sections: vec![(0..6, MaterialId(0))],
    }
}

/// The same square as a payload's mesh, of one colour.
pub(super) fn quad_part(color: [u8; 4]) -> MeshPart {
    let q = quad();
    MeshPart {
        positions: q.positions,
        normals: q.normals,
        albedo: vec![color; 4],
        indices: q.indices,
        two_sided: false,
    }
}

/// A material of one linear colour.
pub(super) fn plain(color: [f32; 3], two_sided: bool) -> Material {
    let [r, g, b] = color;
    Material { name: "plain".into(), base_color: [r, g, b, 1.0], texture: None, two_sided }
}

/// A builder with materials and textures.
pub(super) fn builder(materials: Vec<Material>, textures: Vec<Texture>) -> SceneBuilder {
    let mut b = SceneBuilder::default();
    (b.materials, b.textures) = (materials, textures);
    b
}

/// The scene of one mesh placed at each of `places`.
pub(super) fn scene(mesh: TriangleMesh, material: Material, places: &[DAffine3]) -> Scene {
    let mut b = builder(vec![material], vec![]);
    let mesh = b.mesh("mesh", mesh).expect("a sound mesh");
    places.iter().for_each(|&transform| b.place(Placement { mesh, transform }));
    b.build().expect("a sound scene")
}

/// A camera at `eye`, world coordinates of `scene`, that looks along -z.
pub(super) fn ahead(scene: &Scene, eye: DVec3, size: [u32; 2]) -> Camera {
    Camera::looking(eye - scene.origin, -Vec3::Z, Vec3::Y, 1.0, size, 0.01)
}

/// A draw of anything; nothing that a backend does may depend on bounds or error.
pub(super) fn draw(what: DrawWhat) -> Draw {
    Draw { what, bounds: Aabb::of([Vec3::ZERO]), error_px: 0.0 }
}

/// A draw of every chunk of the scene.
pub(super) fn everything(scene: &Scene) -> Vec<Draw> {
    chunks(scene.all_chunks())
}

/// A draw of some chunks.
pub(super) fn chunks(set: ChunkSet) -> Vec<Draw> {
    vec![draw(DrawWhat::Chunks(set))]
}

/// A draw of a payload's part.
pub(super) fn part(id: u32, part: u16, object: u32) -> Draw {
    draw(DrawWhat::Payload { id: payload(id), part, object })
}

/// Payload `id` of asset 3.
pub(super) fn payload(id: u32) -> PayloadRef {
    PayloadRef { asset: AssetId(3), id: LocalPayload(id) }
}

/// A surface pass.
pub(super) fn surface_pass(camera: &Camera, writes: u32, draws: Vec<Draw>) -> Pass {
    Pass { kind: PassKind::Surface, camera: *camera, writes: TargetId(writes), draws }
}

/// Renders one surface pass and reads it.
pub(super) fn render(backend: &mut dyn Backend, camera: &Camera, draws: Vec<Draw>) -> (SurfaceImage, Counted) {
    let list = DrawList { passes: vec![surface_pass(camera, 0, draws)] };
    let counted = backend.render(&list).expect("the frame is drawn");
    let image = backend.read_surface(TargetId(0)).expect("the surface is read");
    assert_eq!(image.size, camera.size);
    let n = (camera.size[0] * camera.size[1]) as usize;
    assert_eq!([image.albedo.len(), image.normal.len(), image.depth.len(), image.object.len()], [n; 4]);
    (image, counted)
}

/// Makes a backend for the scene, uploads everything and renders all of it.
pub(super) fn shoot(make: super::Make<'_>, scene: &Scene, camera: &Camera) -> SurfaceImage {
    let mut backend = make(scene);
    upload_scene(&mut *backend, scene).expect("the scene is uploaded");
    render(&mut *backend, camera, everything(scene)).0
}

/// What a pixel should hold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    pub(super) albedo: [u8; 3],
    pub(super) normal: Vec3,
    pub(super) depth: f32,
    pub(super) object: u32,
}

/// Holds pixel (x, y) against what it should hold; `None`: nothing. Colours may differ by `levels`, depths by 1e-4 of
/// themselves, normals by half a degree.
pub(super) fn check(what: &str, image: &SurfaceImage, [x, y]: [u32; 2], expected: Option<Expected>, levels: u8) {
    let i = image.at(x, y);
    let (albedo, object, depth) = (image.albedo[i], image.object[i], image.depth[i]);
    let Some(e) = expected else {
        assert_eq!((object, albedo, image.normal[i]), (0, [0; 4], 0), "{what}: pixel {x}, {y} should be empty");
        assert_eq!(depth, f32::INFINITY, "{what}: depth at {x}, {y}");
        return;
    };
    assert_eq!(object, e.object, "{what}: object at {x}, {y}");
    assert!((depth - e.depth).abs() <= 1e-4 * e.depth, "{what}: depth {depth} for {} at {x}, {y}", e.depth);
    let off = (0..3).map(|k| albedo[k].abs_diff(e.albedo[k])).max().unwrap_or(0);
    assert!(off <= levels && albedo[3] == 255, "{what}: albedo {albedo:?} for {:?} at {x}, {y}", e.albedo);
    let normal = from_octahedral(image.normal[i]);
    let degrees = normal.distance(e.normal).to_degrees();
    assert!(degrees < 0.5, "{what}: normal {normal} for {} at {x}, {y}", e.normal);
}

/// Every pixel of a picture, as its indices and its centre.
pub(super) fn pixels(size: [u32; 2]) -> impl Iterator<Item = ([u32; 2], Vec2)> {
    (0..size[1])
        .flat_map(move |y| (0..size[0]).map(move |x| [x, y]))
        .map(|p| (p, Vec2::new(p[0] as f32 + 0.5, p[1] as f32 + 0.5)))
}

/// The distance in pixels, on the worse axis, from a point to the edge of the rectangle with corners `a` and `b`; negative outside.
pub(super) fn inside_px(p: Vec2, a: Vec2, b: Vec2) -> f32 {
    (p - a.min(b)).min(a.max(b) - p).min_element()
}
