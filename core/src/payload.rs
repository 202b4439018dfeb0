//! Payloads: what bakes write, stores keep, backends upload and draw lists name.

use glam::{DVec3, Mat4, Vec3};
use serde::{Deserialize, Serialize};

use crate::Aabb;
use crate::id::LocalPayload;
use crate::layered::LayeredPart;

/// The unit of loading: a bundle of parts that come and go together. Positions in its parts are relative to `origin`, so
/// that they keep their precision wherever the payload stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Payload {
    /// Where its positions start from, local frame.
    pub origin: DVec3,
    /// Its box in the local frame.
    pub bounds: Aabb,
    /// What it holds.
    pub parts: Vec<Part>,
}

/// A part of a payload. A closed list: a backend draws every kind. Parts hold albedo and normals, never lit colour.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Part {
    /// Plain triangles.
    Mesh(MeshPart),
    /// Triangles textured by projection.
    Projected(ProjectedPart),
    /// Texels for projected parts.
    Atlas(AtlasPart),
    /// A layered depth image, warped to the eye.
    Layered(LayeredPart),
    /// Points, each a square splat.
    Points(PointsPart),
    /// Lines, one pixel wide.
    Lines(LinesPart),
}

/// Points that stand for small pieces of surface: squares of the picture, of one size in the scene. Which pixels one covers, at what
/// depth, and which way it faces says [`crate::covered`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointsPart {
    /// Positions relative to the payload's origin; finite.
    pub positions: Vec<Vec3>,
    /// Unit normals, local frame. Backends keep them as [`crate::image::octahedral`] does, and decide by what is kept.
    pub normals: Vec<Vec3>,
    /// sRGB albedo.
    pub albedo: Vec<[u8; 4]>,
    /// Half the edge of every splat, scene units: finite, not negative. A splat is never smaller than a pixel, so that 0 makes each
    /// point one pixel.
    pub radius: f32,
    /// Drawn from behind too, with the normal turned to the eye.
    pub two_sided: bool,
}

/// Lines, drawn one pixel wide however far away they are, from all sides: they close cracks between surfaces. Which pixels one covers,
/// and at what depth, says [`crate::covered`].
///
/// Their normals stay as they are when seen from behind, as those of the one-sided surfaces beside them do: turned, they
/// would light up along silhouettes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinesPart {
    /// Positions relative to the payload's origin; finite.
    pub positions: Vec<Vec3>,
    /// Unit normals, local frame. Backends keep them as [`crate::image::octahedral`] does.
    pub normals: Vec<Vec3>,
    /// sRGB albedo, mixed in linear light along a line.
    pub albedo: Vec<[u8; 4]>,
    /// Two indices a line.
    pub indices: Vec<u32>,
}

/// Triangles with an albedo and a normal a vertex.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshPart {
    /// Positions relative to the payload's origin.
    pub positions: Vec<Vec3>,
    /// Unit normals, local frame.
    pub normals: Vec<Vec3>,
    /// sRGB albedo.
    pub albedo: Vec<[u8; 4]>,
    /// Three indices a triangle, counter-clockwise seen from in front.
    pub indices: Vec<u32>,
    /// Drawn from behind too, with the normal turned to the eye.
    pub two_sided: bool,
}

/// A mesh whose triangles take albedo and normal from the projectors that see them.
///
/// Of a triangle's set of projectors the drawing backend takes, pixel by pixel, none (then the vertices' attributes serve),
/// the one, or the two whose directions from the surface point come nearest to the eye's, blended (see
/// [`ProjectedPart::blend`]).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProjectedPart {
    /// The mesh, with attributes for triangles that no projector sees.
    pub mesh: MeshPart,
    /// One bit set a triangle, bit i for `projectors[i]`; at most 32 projectors.
    pub views: Vec<u32>,
    /// Where its texels come from.
    pub projectors: Vec<Projector>,
}

/// A slide projector: it throws a rectangle of an atlas layer from a point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Projector {
    /// From positions relative to the payload's origin to (u w, v w, depth, w), u and v in texels of the layer.
    pub matrix: Mat4,
    /// Where it stands, relative to the payload's origin.
    pub eye: Vec3,
    /// The payload of the same asset whose first part is the atlas.
    pub atlas: LocalPayload,
    /// The atlas layer.
    pub layer: u32,
    /// The rectangle of texels it owns: x, y, width, height. Look-ups are kept half a texel within it.
    pub rect: [u32; 4],
}

/// Layers of texels, all of one size: albedo (sRGB, alpha 255 where a surface was captured) and normals (n / 2 + 1/2 in
/// rgb). Rows run from the top.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AtlasPart {
    /// Width and height of a layer, texels.
    pub size: [u32; 2],
    /// Number of layers.
    pub layers: u32,
    /// sRGB albedo, layer by layer.
    pub albedo: Vec<[u8; 4]>,
    /// Normals as n / 2 + 1/2, layer by layer.
    pub normal: Vec<[u8; 4]>,
}

impl MeshPart {
    /// Bytes in memory: position, normal and albedo a vertex, three indices a triangle.
    pub fn bytes(&self) -> u64 {
        28 * self.positions.len() as u64 + 4 * self.indices.len() as u64
    }
}

impl ProjectedPart {
    /// The two projectors that show a surface point to an eye, and the weight of the first: w = a2 / (a1 + a2), where a1 and
    /// a2 are 1 - cos of the angles at the point between the eye and each projector (so w is 1 where the eye stands in the
    /// first, 1/2 half-way; view-dependent texture mapping, Debevec et al. 1998). `None` when the set is empty.
    ///
    /// `point` and `eye` are relative to the payload's origin. The shaders do the same arithmetic.
    pub fn blend(projectors: &[Projector], set: u32, point: Vec3, eye: Vec3) -> Option<(usize, usize, f32)> {
        let to_eye = (eye - point).normalize_or_zero();
        let (mut best, mut second) = ((f32::INFINITY, 0), (f32::INFINITY, 0));
        for (i, p) in projectors.iter().enumerate().filter(|(i, _)| set >> i & 1 == 1) {
            let a = 1.0 - to_eye.dot((p.eye - point).normalize_or_zero());
            if a < best.0 {
                (best, second) = ((a, i), best);
            } else if a < second.0 {
                second = (a, i);
            }
        }
        match (best.0.is_finite(), second.0.is_finite()) {
            (false, _) => None,
            (true, false) => Some((best.1, best.1, 1.0)),
            (true, true) => Some((best.1, second.1, (second.0 + 1e-9) / (best.0 + second.0 + 2e-9))),
        }
    }
}

impl PointsPart {
    /// Bytes that it takes on a GPU: position 12, normal 4, albedo 4.
    pub fn bytes(&self) -> u64 {
        20 * self.positions.len() as u64
    }
}

impl LinesPart {
    /// How many lines there are.
    pub fn lines(&self) -> usize {
        self.indices.len() / 2
    }

    /// Bytes that it takes on a GPU, where each line has both its ends: twice those of a point.
    pub fn bytes(&self) -> u64 {
        40 * self.lines() as u64
    }
}

impl Payload {
    /// Triangles in all its parts.
    pub fn triangles(&self) -> u64 {
        self.parts
            .iter()
            .map(|p| match p {
                Part::Mesh(m) => m.indices.len() as u64 / 3,
                Part::Projected(m) => m.mesh.indices.len() as u64 / 3,
                Part::Atlas(_) | Part::Layered(_) | Part::Points(_) | Part::Lines(_) => 0,
            })
            .sum()
    }

    /// Points in all its parts; samples of layered depth images are counted apart.
    pub fn points(&self) -> u64 {
        self.parts.iter().map(|p| if let Part::Points(p) = p { p.positions.len() as u64 } else { 0 }).sum()
    }

    /// Lines in all its parts.
    pub fn lines(&self) -> u64 {
        self.parts.iter().map(|p| if let Part::Lines(l) = p { l.lines() as u64 } else { 0 }).sum()
    }

    /// Samples of its layered depth images.
    pub fn samples(&self) -> u64 {
        self.parts.iter().map(|p| if let Part::Layered(l) = p { l.samples() as u64 } else { 0 }).sum()
    }

    /// Bytes of its texels and samples.
    pub fn texture_bytes(&self) -> u64 {
        self.parts
            .iter()
            .map(|p| match p {
                Part::Atlas(a) => 4 * (a.albedo.len() + a.normal.len()) as u64,
                Part::Layered(l) => l.bytes(),
                _ => 0,
            })
            .sum()
    }
}
