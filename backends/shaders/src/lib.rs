//! What every GPU backend shares, so that their pictures are equal byte for byte: the WGSL, its SPIR-V by way of naga, the
//! plain data that goes with it, and the way a draw list becomes batches of draws.
//!
//! A backend that is built on this keeps buffers and textures and carries out; nothing that decides a byte is left to it.
//! The order of work:
//!
//! 1. [`residency::Residency::place`] packs a block and says which pages to make and what to write where;
//! 2. [`plan::plan`] turns a draw list into passes of batches, draw records, commands and uniforms;
//! 3. the backend uploads those three arrays, and per batch binds pipeline, pages and textures and draws its commands; before
//!    them it warps a pass's layered depth images in compute, behind them it composes each ([`warp`]);
//! 4. [`readback`] makes images of the planes that came back.
//!
//! Limits: a projected part draws from at most [`layout::ATLAS_SLOTS`] atlases, since binding arrays do not exist on every
//! device.

pub mod layout;
pub mod pack;
pub mod plan;
pub mod pool;
pub mod quads;
pub mod readback;
pub mod records;
pub mod residency;
pub mod spirv;
pub mod warp;

use pool::Stream;
use spirv::Stage;

/// The vertex stage's entry point, in every shader.
pub const VERTEX_ENTRY: &str = "vertex";

/// The fragment stage's entry point, in every shader.
pub const FRAGMENT_ENTRY: &str = "fragment";

/// The compute stage's entry point, in every shader that has one.
pub const COMPUTE_ENTRY: &str = "compute";

/// A shader: one WGSL module with a vertex and a fragment stage, or with a compute stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Shader {
    /// The surface pass for chunks of original geometry.
    Chunk,
    /// The surface pass for plain payload meshes.
    Mesh,
    /// The surface pass for payload meshes textured by projection.
    Projected,
    /// The surface pass for points.
    Points,
    /// The surface pass for lines.
    Lines,
    /// The shading pass.
    Shade,
    /// Throws the samples of a layered depth image, with one 64-bit atomic a pixel.
    Warp,
    /// The same with two of 32 bits, in two phases.
    WarpHalves,
    /// The surface pass for layered depth images: takes the pixels that the warp gave to an image.
    Resolve,
}

impl Shader {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Chunk,
        Self::Mesh,
        Self::Projected,
        Self::Points,
        Self::Lines,
        Self::Shade,
        Self::Warp,
        Self::WarpHalves,
        Self::Resolve,
    ];

    /// Its stages.
    pub fn stages(self) -> &'static [Stage] {
        match self {
            Self::Warp | Self::WarpHalves => &[Stage::Compute],
            _ => &[Stage::Vertex, Stage::Fragment],
        }
    }

    /// The stream that its vertices come from; `None` where it has no vertices: compute, and triangles that cover the picture, or
    /// pulls them.
    pub fn vertices(self) -> Option<Stream> {
        match self {
            Self::Chunk => Some(Stream::ChunkVertices),
            Self::Mesh => Some(Stream::MeshVertices),
            Self::Projected => Some(Stream::ProjectedVertices),
            Self::Points | Self::Lines | Self::Shade | Self::Warp | Self::WarpHalves | Self::Resolve => None,
        }
    }

    /// The stream of elements that its vertex stage pulls its vertices out of, four an element in the order of [`quads`].
    pub fn pulled(self) -> Option<Stream> {
        match self {
            Self::Points => Some(Stream::Points),
            Self::Lines => Some(Stream::Lines),
            _ => None,
        }
    }

    /// Its WGSL source, complete.
    pub fn wgsl(self) -> &'static str {
        match self {
            Self::Chunk => concat!(
                include_str!("wgsl/common.wgsl"),
                include_str!("wgsl/surface.wgsl"),
                include_str!("wgsl/chunk.wgsl")
            ),
            Self::Mesh => concat!(
                include_str!("wgsl/common.wgsl"),
                include_str!("wgsl/surface.wgsl"),
                include_str!("wgsl/mesh.wgsl")
            ),
            Self::Projected => concat!(
                include_str!("wgsl/common.wgsl"),
                include_str!("wgsl/surface.wgsl"),
                include_str!("wgsl/projected.wgsl")
            ),
            Self::Points => concat!(
                include_str!("wgsl/common.wgsl"),
                include_str!("wgsl/surface.wgsl"),
                include_str!("wgsl/covered.wgsl"),
                include_str!("wgsl/points.wgsl")
            ),
            Self::Lines => concat!(
                include_str!("wgsl/common.wgsl"),
                include_str!("wgsl/surface.wgsl"),
                include_str!("wgsl/covered.wgsl"),
                include_str!("wgsl/lines.wgsl")
            ),
            Self::Shade => concat!(
                include_str!("wgsl/common.wgsl"),
                include_str!("wgsl/cover.wgsl"),
                include_str!("wgsl/shade.wgsl")
            ),
            Self::Warp => concat!(
                include_str!("wgsl/common.wgsl"),
                include_str!("wgsl/layered.wgsl"),
                include_str!("wgsl/keep_whole.wgsl"),
                include_str!("wgsl/warp.wgsl")
            ),
            Self::WarpHalves => concat!(
                include_str!("wgsl/common.wgsl"),
                include_str!("wgsl/layered.wgsl"),
                include_str!("wgsl/keep_halves.wgsl"),
                include_str!("wgsl/warp.wgsl")
            ),
            Self::Resolve => concat!(
                include_str!("wgsl/common.wgsl"),
                include_str!("wgsl/layered.wgsl"),
                include_str!("wgsl/cover.wgsl"),
                include_str!("wgsl/resolve.wgsl")
            ),
        }
    }

    /// What it is called in messages and debuggers.
    pub fn label(self) -> &'static str {
        match self {
            Self::Chunk => "surface of chunks",
            Self::Mesh => "surface of payload meshes",
            Self::Projected => "surface of projected meshes",
            Self::Points => "surface of points",
            Self::Lines => "surface of lines",
            Self::Shade => "shading",
            Self::Warp => "warp of layered depth images",
            Self::WarpHalves => "warp of layered depth images, in halves",
            Self::Resolve => "surface of layered depth images",
        }
    }
}
