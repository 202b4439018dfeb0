//! How original geometry looks before light, vertex by vertex: for bakes that carry looks over to other meshes. Backends do the same pixel
//! by pixel.

use glam::{DMat3, Vec2, Vec3};

use super::{Material, Texture};
use crate::color::linear_of_byte;
use crate::mesh::ChunkMesh;

/// The linear albedo of a chunk's vertex: base colour x texture x vertex colour.
pub fn vertex_albedo(chunk: &ChunkMesh, vertex: usize, material: &Material, texture: Option<&Texture>) -> Vec3 {
    let tint = vertex_tint(chunk, vertex, material);
    match (texture, chunk.uvs.get(vertex)) {
        (Some(t), Some(&uv)) => tint * texture_at(t, uv),
        _ => tint,
    }
}

/// What a vertex's texture is multiplied by: base colour x vertex colour, linear.
pub fn vertex_tint(chunk: &ChunkMesh, vertex: usize, material: &Material) -> Vec3 {
    let base = Vec3::new(material.base_color[0], material.base_color[1], material.base_color[2]);
    chunk.colors.get(vertex).map_or(base, |c| base * linear(*c))
}

fn linear(c: [u8; 4]) -> Vec3 {
    Vec3::new(linear_of_byte(c[0]), linear_of_byte(c[1]), linear_of_byte(c[2]))
}

/// A texture's linear colour: bilinear, texel centres at halves, repeated outside 0..1; white where it has no texels or `uv` is
/// not finite.
pub fn texture_at(t: &Texture, uv: Vec2) -> Vec3 {
    let [w, h] = t.size;
    if w == 0 || h == 0 || t.rgba.len() < w as usize * h as usize || !uv.is_finite() {
        return Vec3::ONE;
    }
    let at = Vec2::new(uv.x.rem_euclid(1.0) * w as f32, uv.y.rem_euclid(1.0) * h as f32) - 0.5;
    let (base, f) = (at.floor(), at - at.floor());
    let texel = |dx: i32, dy: i32| {
        let (x, y) = ((base.x as i32 + dx).rem_euclid(w as i32), (base.y as i32 + dy).rem_euclid(h as i32));
        linear(t.rgba[(y as u32 * w + x as u32) as usize])
    };
    let top = texel(0, 0).lerp(texel(1, 0), f.x);
    top.lerp(texel(0, 1).lerp(texel(1, 1), f.x), f.y)
}

/// What turns normals when `m` turns positions: the cofactors, so that stretched objects keep normals at right angles; signed so
/// that mirroring keeps them outside.
pub fn normal_matrix(m: &DMat3) -> DMat3 {
    let cofactors = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { cofactors * -1.0 } else { cofactors }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_repeat_and_mix_linear_light() {
        let t = Texture { name: String::new(), size: [2, 1], rgba: vec![[0, 0, 0, 255], [255, 255, 255, 255]] };
        let at = |u: f32| texture_at(&t, Vec2::new(u, 0.3)).x;
        assert_eq!([at(0.25), at(0.75), at(0.5), at(0.0), at(-0.25), at(7.25)], [0.0, 1.0, 0.5, 0.5, 1.0, 0.0]);
        assert_eq!(at(f32::NAN), 1.0);
    }

    #[test]
    fn turned_normals_stay_at_right_angles_and_outside() {
        for m in [DMat3::from_diagonal(glam::DVec3::new(1.0, 5.0, -2.0)), DMat3::from_rotation_x(0.7) * 3.0] {
            let (a, b) = (glam::DVec3::new(1.0, 0.4, 0.2), glam::DVec3::new(-0.3, 1.0, 0.5));
            let n = normal_matrix(&m) * a.cross(b);
            assert!(n.dot(m * a).abs() < 1e-9 && n.dot(m * b).abs() < 1e-9);
            assert!(n.dot(m * a.cross(b)) > 0.0);
        }
    }
}
