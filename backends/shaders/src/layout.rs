//! Plain data as it lies in device memory: vertices, records, uniforms; formats of targets and textures; bindings.
//!
//! Bindings. Surface shaders: group 0 holds [`ViewUniform`] (binding 0, dynamic offset into the frame's uniforms) and the
//! frame's [`Record`]s (binding 1); group 1 holds, for chunks, the texture (0) and a repeating linear sampler (1); for
//! projected parts, a page of [`GpuProjector`]s (0), a clamping linear sampler (1) and [`ATLAS_SLOTS`] pairs of albedo and
//! normal arrays (2, 3), (4, 5), ...; for points and lines, the page of [`GpuPoint`]s or [`GpuLine`]s (0) that the vertex stage pulls its
//! vertices out of; plain meshes have no group 1. The shading shader: group 0 holds [`ShadeUniform`]
//! (binding 0, dynamic offset), group 1 the albedo, normal, depth and object planes (0 to 3). The shaders of layered depth images:
//! group 0 holds [`WarpUniform`] (binding 0, dynamic offset), a page of [`GpuSample`]s (1) and the pass's splats (2), 8 bytes a
//! pixel, written by the warp and read by what resolves it.
//!
//! Formats, in wgpu's names. Surface target: albedo Rgba8UnormSrgb, normal R32Uint (octahedral), linear depth R32Float, object
//! R32Uint, all cleared to 0, and a depth buffer Depth32Float, reversed: cleared to 0, passes where Greater. Picture:
//! Rgba8Unorm (the shader encodes sRGB, so that the background keeps its exact bytes). Scene textures and atlas albedo:
//! Rgba8UnormSrgb; atlas normals: Rgba8Unorm. Atlases are 2d arrays, scene textures plain; one level each.

use bytemuck::{Pod, Zeroable};

use crate::Shader;

/// How many atlases a projected part can draw from.
pub const ATLAS_SLOTS: usize = 4;

/// Offsets into the frame's uniforms are multiples of this, bytes; no device asks for more.
pub const UNIFORM_ALIGN: usize = 256;

/// A vertex of a chunk.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ChunkVertex {
    /// Mesh space.
    pub position: [f32; 3],
    /// Octahedral, mesh space.
    pub normal: u32,
    /// Texture coordinates; 0 where the chunk has none.
    pub uv: [f32; 2],
    /// sRGB; white where the chunk has none.
    pub color: [u8; 4],
}

/// A vertex of a plain payload mesh.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MeshVertex {
    /// Relative to the payload's origin.
    pub position: [f32; 3],
    /// Octahedral, local frame.
    pub normal: u32,
    /// sRGB.
    pub color: [u8; 4],
}

/// A vertex of a projected payload mesh. Triangles share a vertex only where they share the set of projectors.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ProjectedVertex {
    /// Relative to the payload's origin.
    pub position: [f32; 3],
    /// Octahedral, local frame.
    pub normal: u32,
    /// sRGB.
    pub color: [u8; 4],
    /// The triangle's set of projectors.
    pub views: u32,
}

/// A point, or an end of a line, as the shaders read it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GpuPoint {
    /// Relative to the payload's origin.
    pub position: [f32; 3],
    /// Octahedral, local frame.
    pub normal: u32,
    /// sRGB.
    pub color: [u8; 4],
}

/// A line as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GpuLine {
    /// Its ends.
    pub ends: [GpuPoint; 2],
}

/// A projector as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GpuProjector {
    /// Column by column: positions relative to the payload's origin to (u w, v w, depth, w), u and v in texels.
    pub matrix: [[f32; 4]; 4],
    /// Relative to the payload's origin.
    pub eye: [f32; 3],
    /// Which of the bound atlases.
    pub slot: u32,
    /// The least texel coordinates looked up.
    pub low: [f32; 2],
    /// The greatest texel coordinates looked up.
    pub high: [f32; 2],
    /// The atlas layer.
    pub layer: u32,
    /// Nothing.
    pub unused: [u32; 3],
}

/// A sample of a layered depth image as the shaders read it. Behind an image's samples lie its objects, four in the room of one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GpuSample {
    /// Linear, along the image's forward axis.
    pub depth: f32,
    /// Its pixel in the image.
    pub pixel: [u16; 2],
    /// Octahedral bytes, local frame.
    pub normal: [i8; 2],
    /// An index into the image's objects.
    pub object: u16,
    /// sRGB; the fourth byte is nothing.
    pub albedo: [u8; 4],
}

/// What is the same for all samples of an image that is warped in a pass: [`farfield_core::layered::Warp`] and where things lie.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct WarpUniform {
    /// The image's eye relative to the viewer's.
    pub offset: [f32; 4],
    /// From the image's eye to the centre of its first pixel, one unit ahead.
    pub corner: [f32; 4],
    /// From a pixel's ray to that of its right neighbour.
    pub step_x: [f32; 4],
    /// From a pixel's ray to that of the one below.
    pub step_y: [f32; 4],
    /// The viewer's right.
    pub right: [f32; 4],
    /// The viewer's up.
    pub up: [f32; 4],
    /// The viewer's forward.
    pub forward: [f32; 4],
    /// The viewer's tangents at the left and the top, pixels a unit tangent across and down.
    pub picture: [f32; 4],
    /// The viewer's width and height, pixels.
    pub size: [u32; 2],
    /// The viewer's near distance.
    pub near: f32,
    /// 1 where the image is drawn smoothed.
    pub smoothed: u32,
    /// The index of the first sample in its page.
    pub first: u32,
    /// How many samples there are.
    pub samples: u32,
    /// The index of the page's element at which the objects start.
    pub objects: u32,
    /// 255 for the first image of a pass, 254 for the next; never 0.
    pub ordinal: u32,
    /// See [`crate::warp::Atomics::phases`].
    pub phase: u32,
    /// Nothing.
    pub unused: [u32; 3],
}

/// What a draw needs to know of what it draws; one per placed chunk or payload part of a frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Record {
    /// Rows of the affine map from stored positions to positions relative to the eye.
    pub to_eye: [[f32; 4]; 3],
    /// Rows of the map from stored normals to the local frame; the fourth lane is 0.
    pub normal: [[f32; 4]; 3],
    /// Linear base colour.
    pub base_color: [f32; 4],
    /// Object number + 1.
    pub object: u32,
    /// 1 where the normal is turned to the eye.
    pub two_sided: u32,
    /// The index of the part's first projector in its page.
    pub first_projector: u32,
    /// Half the edge of a splat, scene units; of points only.
    pub radius: f32,
}

/// A surface pass's camera: [`farfield_core::Camera::projection`], and [`farfield_core::covered::Screen`] for points and lines.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ViewUniform {
    /// `Camera::projection`, column by column.
    pub projection: [[f32; 4]; 4],
    /// `Screen::across`, and pixels a unit tangent across.
    pub across: [f32; 4],
    /// `Screen::down`, and pixels a unit tangent down.
    pub down: [f32; 4],
    /// `Screen::ahead`, and the near distance.
    pub ahead: [f32; 4],
    /// Width and height, pixels.
    pub size: [f32; 2],
    /// Nothing.
    pub unused: [f32; 2],
}

/// A light of a shading pass.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct GpuLight {
    /// The unit vector to the light (w = 0) or its place relative to the eye (w = 1).
    pub place: [f32; 4],
    /// Linear.
    pub color: [f32; 4],
}

/// What a shading pass needs to know.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ShadeUniform {
    /// The camera's right.
    pub right: [f32; 4],
    /// The camera's up.
    pub up: [f32; 4],
    /// The camera's forward.
    pub forward: [f32; 4],
    /// Left, right, bottom, top.
    pub tangents: [f32; 4],
    /// Linear ambient light.
    pub ambient: [f32; 4],
    /// Encoded background above the horizon, 0..1.
    pub sky: [f32; 4],
    /// Encoded background below the horizon, 0..1.
    pub ground: [f32; 4],
    /// Width and height, pixels.
    pub size: [f32; 2],
    /// How many of the lights count.
    pub light_count: u32,
    /// Nothing.
    pub unused: u32,
    /// The lights.
    pub lights: [GpuLight; farfield_core::draw::Shading::MAX_LIGHTS],
}

/// An indexed draw, laid out as Vulkan and wgpu read it from an indirect buffer.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct DrawCommand {
    /// How many indices.
    pub index_count: u32,
    /// Always 1.
    pub instance_count: u32,
    /// The first index in its page.
    pub first_index: u32,
    /// Added to every index.
    pub base_vertex: i32,
    /// The index of the draw's [`Record`].
    pub first_instance: u32,
}

/// How a vertex attribute is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AttributeFormat {
    /// Two 32-bit floats.
    Float32x2,
    /// Three 32-bit floats.
    Float32x3,
    /// A 32-bit unsigned integer.
    Uint32,
    /// Four bytes as fractions of 255.
    Unorm8x4,
}

/// A vertex attribute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attribute {
    /// The shader's location.
    pub location: u32,
    /// Bytes from the vertex's start.
    pub offset: u32,
    /// How it is stored.
    pub format: AttributeFormat,
}

const fn at(location: u32, offset: u32, format: AttributeFormat) -> Attribute {
    Attribute { location, offset, format }
}

/// A shader's vertex attributes and the bytes of a vertex; shaders without vertices, and those that pull them, have none.
pub fn vertex_layout(shader: Shader) -> (u32, &'static [Attribute]) {
    use AttributeFormat::{Float32x2, Float32x3, Uint32, Unorm8x4};
    match shader {
        Shader::Chunk => {
            (28, const { &[at(0, 0, Float32x3), at(1, 12, Uint32), at(2, 16, Float32x2), at(3, 24, Unorm8x4)] })
        }
        Shader::Mesh => (20, const { &[at(0, 0, Float32x3), at(1, 12, Uint32), at(2, 16, Unorm8x4)] }),
        Shader::Projected => {
            (24, const { &[at(0, 0, Float32x3), at(1, 12, Uint32), at(2, 16, Unorm8x4), at(3, 20, Uint32)] })
        }
        Shader::Points | Shader::Lines | Shader::Shade | Shader::Warp | Shader::WarpHalves | Shader::Resolve => {
            (0, &[])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::size_of;

    #[test]
    fn structs_are_laid_out_as_the_shaders_say() {
        assert_eq!(vertex_layout(Shader::Chunk).0 as usize, size_of::<ChunkVertex>());
        assert_eq!(vertex_layout(Shader::Mesh).0 as usize, size_of::<MeshVertex>());
        assert_eq!(vertex_layout(Shader::Projected).0 as usize, size_of::<ProjectedVertex>());
        let sizes = [
            ("Record", size_of::<Record>()),
            ("Projector", size_of::<GpuProjector>()),
            ("View", size_of::<ViewUniform>()),
            ("Shade", size_of::<ShadeUniform>()),
            ("Light", size_of::<GpuLight>()),
            ("Warp", size_of::<WarpUniform>()),
            ("Vertex", size_of::<GpuPoint>()),
            ("Line", size_of::<GpuLine>()),
        ];
        for shader in Shader::ALL {
            let module = naga::front::wgsl::parse_str(shader.wgsl()).unwrap();
            for (_, ty) in module.types.iter() {
                if let (Some(name), naga::TypeInner::Struct { span, .. }) = (&ty.name, &ty.inner)
                    && let Some((_, size)) = sizes.iter().find(|(n, _)| n == name)
                {
                    assert_eq!(*span as usize, *size, "{name} in {shader:?}");
                }
            }
        }
    }
}
