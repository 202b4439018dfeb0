//! Binary little-endian PLY: all placements as one mesh in world space. Base colours are multiplied into the vertex colours,
//! in linear light; textures are not held by the format and are left out.

use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::mesh::TriangleMesh;
use glam::DAffine3;

use super::Export;
use crate::load::merge;

/// The file. `Err` where it would have more than 2^31 vertices.
pub(super) fn bytes(scene: &Export) -> Result<Vec<u8>, String> {
    let placed: Vec<(&TriangleMesh, DAffine3)> =
        scene.placements.iter().map(|(i, t)| (&scene.meshes[*i].1, *t)).collect();
    let total: usize = placed.iter().map(|(m, _)| m.positions.len()).sum();
    if total > i32::MAX as usize {
        return Err(format!("{total} vertices are more than a PLY face can name"));
    }
    let mut mesh = merge(&placed);
    if !scene.materials.is_empty() {
        bake_base_colors(&mut mesh, scene);
    }
    let mut head = String::from("ply\nformat binary_little_endian 1.0\ncomment farfield\n");
    let property =
        |kind: &str, names: &[&str]| names.iter().map(|n| format!("property {kind} {n}\n")).collect::<String>();
    head += &format!("element vertex {}\n", mesh.positions.len());
    head += &property("float", &["x", "y", "z"]);
    if !mesh.normals.is_empty() {
        head += &property("float", &["nx", "ny", "nz"]);
    }
    if !mesh.colors.is_empty() {
        head += &property("uchar", &["red", "green", "blue"]);
    }
    head += &format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", mesh.triangles());
    let mut out = head.into_bytes();
    for (i, p) in mesh.positions.iter().enumerate() {
        out.extend_from_slice(bytemuck::bytes_of(p));
        if let Some(n) = mesh.normals.get(i) {
            out.extend_from_slice(bytemuck::bytes_of(n));
        }
        if let Some(c) = mesh.colors.get(i) {
            out.extend_from_slice(&c[..3]);
        }
    }
    for t in mesh.indices.chunks_exact(3) {
        out.push(3);
        t.iter().for_each(|&v| out.extend((v as i32).to_le_bytes()));
    }
    Ok(out)
}

/// Vertex colour x base colour. A vertex that two materials share takes the last one's.
fn bake_base_colors(mesh: &mut TriangleMesh, scene: &Export) {
    let own = if mesh.colors.is_empty() { vec![[255; 4]; mesh.positions.len()] } else { mesh.colors.clone() };
    mesh.colors.clone_from(&own);
    for (range, material) in &mesh.sections {
        let [r, g, b, _] = scene.materials[material.index()].base_color;
        for &v in &mesh.indices[range.start as usize..range.end as usize] {
            let c = own[v as usize];
            let times = |k: usize, f: f32| byte_of_linear(linear_of_byte(c[k]) * f);
            mesh.colors[v as usize] = [times(0, r), times(1, g), times(2, b), 255];
        }
    }
}
