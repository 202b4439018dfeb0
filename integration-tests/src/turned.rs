//! Meshes turned on a lathe: vases, leaves, bowls, of as many triangles as are asked for.

use farfield_core::id::MaterialId;
use farfield_core::mesh::TriangleMesh;
use glam::{Vec2, Vec3};

/// A shape of rings round an axis, 2 (rings - 1) segments triangles, whose radius `radius` gives at height 0..1.
pub fn turned(
    rings: u32,
    segments: u32,
    colors: bool,
    material: u32,
    radius: impl Fn(f32, f32) -> f32,
) -> TriangleMesh {
    let n = segments + 1;
    let uv = |i: u32| Vec2::new((i % n) as f32 / segments as f32, (i / n) as f32 / (rings - 1) as f32);
    let place = |i: u32| {
        let angle = uv(i).x * std::f32::consts::TAU;
        let r = radius(uv(i).y, angle);
        Vec3::new(r * angle.cos(), uv(i).y * 2.0 - 1.0, -r * angle.sin())
    };
    let indices: Vec<u32> = (0..(rings - 1) * segments)
        .flat_map(|q| {
            let i = q / segments * n + q % segments;
            [i, i + 1, i + n, i + n, i + 1, i + n + 1]
        })
        .collect();
    TriangleMesh {
        positions: (0..rings * n).map(place).collect(),
        uvs: (0..rings * n).map(|i| uv(i) * 3.0 - 1.0).collect(),
        colors: if colors {
            (0..rings * n).map(|i| [(37 * i % 200 + 50) as u8, (91 * i % 200 + 50) as u8, 200, 255]).collect()
        } else {
            vec![]
        },
        sections: vec![(0..indices.len() as u32, MaterialId(material))],
        indices,
        ..TriangleMesh::default()
    }
}
