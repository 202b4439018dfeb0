//! The backend trait: who carries draw lists out.

use serde::{Deserialize, Serialize};

use crate::Fault;
use crate::draw::DrawList;
use crate::extent::{Extent, Takes};
use crate::id::{Block, TargetId};
use crate::image::{Picture, SurfaceImage};
use crate::mesh::ChunkMesh;
use crate::payload::Payload;
use crate::scene::Scene;

/// What a block holds, for upload.
pub enum BlockData<'a> {
    /// A chunk of an original mesh.
    Chunk(&'a ChunkMesh),
    /// A payload.
    Payload(&'a Payload),
}

/// What a backend runs on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// The backend's registered name.
    pub backend: String,
    /// The device and driver, as they name themselves.
    pub device: String,
    /// What the device lacks and what is done instead, in words.
    pub degraded: Vec<String>,
}

/// What a frame cost, counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counted {
    /// Time on the device, milliseconds; `None` where it has no timestamps.
    pub gpu_ms: Option<f64>,
    /// Time from the call to the frame's end on this side, milliseconds.
    pub wall_ms: f64,
    /// Original triangles submitted.
    pub near_triangles: u64,
    /// Triangles of payloads submitted.
    pub far_triangles: u64,
    /// Samples of layered depth images warped.
    pub samples: u64,
    /// Points of payloads submitted.
    pub points: u64,
    /// Lines of payloads submitted.
    pub lines: u64,
    /// Primitives that reached the clipper, where the device counts them; a layered depth image adds one that covers the picture, a
    /// point or a line two.
    pub clipped_primitives: Option<u64>,
}

/// A renderer of draw lists.
///
/// Made for one scene: chunk tables, objects, materials and textures are its from the start; triangles and payloads come
/// and go as blocks. Rendering and reading back are apart, so that reading is never part of what is timed.
pub trait Backend {
    /// What it runs on.
    fn info(&self) -> &DeviceInfo;

    /// Makes a block drawable and returns the bytes that it takes on the device. A block that is there is replaced.
    ///
    /// # Errors
    /// [`Fault::Device`] where the device refuses the memory, [`Fault::Data`] where the block contradicts itself.
    fn upload(&mut self, block: Block, data: &BlockData<'_>) -> Result<u64, Fault>;

    /// What a block of this extent takes, never less than [`Backend::upload`] will take; known before it is read. By default that of a
    /// rasteriser: packed once on the device, and three copies on their way (packed, to be written, in the driver's hands).
    fn takes(&self, extent: &Extent) -> Takes {
        let resident_bytes = extent.packed_bytes();
        Takes { resident_bytes, passing_bytes: 3 * resident_bytes }
    }

    /// Waits until nothing of what was uploaded is on its way any more, so that only the blocks themselves take memory.
    ///
    /// # Errors
    /// [`Fault::Device`] where the device fails.
    fn settle(&mut self) -> Result<(), Fault> {
        Ok(())
    }

    /// Frees a block; one that is not there is no error.
    fn release(&mut self, block: Block);

    /// Carries out a frame and waits for its end.
    ///
    /// # Errors
    /// [`Fault::Refused`] where a draw names a block that was not uploaded.
    fn render(&mut self, list: &DrawList) -> Result<Counted, Fault>;

    /// The planes of a surface target.
    ///
    /// # Errors
    /// [`Fault::Refused`] where no surface pass wrote it.
    fn read_surface(&mut self, target: TargetId) -> Result<SurfaceImage, Fault>;

    /// The picture of a shaded target.
    ///
    /// # Errors
    /// [`Fault::Refused`] where no shading pass wrote it.
    fn read_picture(&mut self, target: TargetId) -> Result<Picture, Fault>;
}

/// Checks that a payload part is consistent: index ranges, lengths, projector and view counts, texel counts; that points and lines
/// are finite.
///
/// # Errors
/// [`Fault::Data`] naming the block and what is wrong.
pub fn validate(block: Block, data: &BlockData<'_>) -> Result<(), Fault> {
    use crate::payload::Part;
    let bad = |cause: String| Err(Fault::Data { place: format!("{block:?}"), cause });
    let indices = |ix: &[u32], n: usize| match ix.iter().find(|&&i| i as usize >= n) {
        Some(i) => bad(format!("index {i} of {n} vertices")),
        None if !ix.len().is_multiple_of(3) => bad(format!("{} indices are not whole triangles", ix.len())),
        None => Ok(()),
    };
    match data {
        BlockData::Chunk(c) => {
            let n = c.positions.len();
            let fits = |len: usize| len == 0 || len == n;
            if c.normals.len() != n || !fits(c.uvs.len()) || !fits(c.colors.len()) {
                return bad("vertex attributes differ in length".into());
            }
            indices(&c.indices, n)
        }
        BlockData::Payload(p) => p.parts.iter().try_for_each(|part| match part {
            Part::Atlas(a) => {
                let n = a.size[0] as usize * a.size[1] as usize * a.layers as usize;
                if a.albedo.len() != n || a.normal.len() != n {
                    return bad(format!("an atlas of {n} texels holds {} and {}", a.albedo.len(), a.normal.len()));
                }
                Ok(())
            }
            Part::Layered(l) => layered(l).map_or(Ok(()), bad),
            Part::Points(p) => points(p).map_or(Ok(()), bad),
            Part::Lines(l) => lines(l).map_or(Ok(()), bad),
            Part::Mesh(m) | Part::Projected(crate::payload::ProjectedPart { mesh: m, .. }) => {
                if let Part::Projected(q) = part {
                    if q.views.len() * 3 != m.indices.len() || q.projectors.len() > 32 {
                        return bad("one view set a triangle and at most 32 projectors".into());
                    }
                    let all = if q.projectors.len() == 32 { u32::MAX } else { (1 << q.projectors.len()) - 1 };
                    if q.views.iter().any(|v| v & !all != 0) {
                        return bad("a view set names a projector that is not there".into());
                    }
                }
                if m.normals.len() != m.positions.len() || m.albedo.len() != m.positions.len() {
                    return bad("vertex attributes differ in length".into());
                }
                indices(&m.indices, m.positions.len())
            }
        }),
    }
}

/// What is wrong with points.
fn points(p: &crate::payload::PointsPart) -> Option<String> {
    if !(p.radius >= 0.0 && p.radius.is_finite()) {
        return Some(format!("points of radius {}", p.radius));
    }
    vertices("point", &p.positions, p.normals.len(), p.albedo.len())
}

/// What is wrong with lines.
fn lines(l: &crate::payload::LinesPart) -> Option<String> {
    let n = l.positions.len();
    if !l.indices.len().is_multiple_of(2) {
        return Some(format!("{} indices are not whole lines", l.indices.len()));
    }
    let outside = l.indices.iter().find(|&&i| i as usize >= n).map(|i| format!("index {i} of {n} vertices"));
    outside.or_else(|| vertices("vertex", &l.positions, l.normals.len(), l.albedo.len()))
}

/// What is wrong with vertices of a kind: attributes that differ in length, a position that is no place.
fn vertices(kind: &str, positions: &[glam::Vec3], normals: usize, albedo: usize) -> Option<String> {
    let n = positions.len();
    if [normals, albedo] != [n; 2] {
        return Some(format!("{n} positions, but {normals} normals and {albedo} albedos"));
    }
    let lost = positions.iter().position(|p| !p.is_finite());
    lost.map(|i| format!("{kind} {i} of {n} lies at {}", positions[i]))
}

/// What is wrong with a layered depth image.
fn layered(l: &crate::layered::LayeredPart) -> Option<String> {
    let (pixels, n) = (u64::from(l.camera.size[0]) * u64::from(l.camera.size[1]), l.samples());
    if l.counts.len() as u64 != pixels {
        return Some(format!("{} sample counts for {pixels} pixels", l.counts.len()));
    }
    let counted: usize = l.counts.iter().map(|&c| usize::from(c)).sum();
    if [counted, l.albedo.len(), l.normal.len(), l.object.len()] != [n; 4] {
        return Some(format!("{n} depths, but {counted} counted samples"));
    }
    let c = &l.camera;
    let axes = [c.right, c.up, c.forward].iter().all(|a| a.is_finite()) && c.eye.is_finite();
    if !(axes && [c.left, c.right_tan, c.bottom, c.top].iter().all(|t| t.is_finite())) {
        return Some("a camera that is not finite".into());
    }
    let [near, far] = l.inverse_depth;
    let depths = near > 0.0 && far > 0.0 && far <= near && near.is_finite() && far.recip().is_finite();
    if !depths {
        return Some(format!("depths from 1 / {near} to 1 / {far}"));
    }
    let object = l.object.iter().find(|&&o| usize::from(o) >= l.objects.len());
    let nothing = l.objects.contains(&0).then(|| "object 0, which means nothing hit".to_owned());
    object.map(|o| format!("object {o} of {}", l.objects.len())).or(nothing)
}

/// Makes every chunk of the scene resident; returns the bytes taken.
///
/// # Errors
/// As [`Backend::upload`], or what reading the geometry gives.
pub fn upload_scene(backend: &mut dyn Backend, scene: &Scene) -> Result<u64, Fault> {
    let mut bytes = 0;
    for id in scene.mesh_chunk_ids() {
        let mut done = Ok(0);
        scene.geometry.with(id, &mut |chunk| done = backend.upload(Block::Chunk(id), &BlockData::Chunk(chunk)))?;
        bytes += done?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use crate::id::{AssetId, LocalPayload, PayloadRef};
    use crate::payload::{LinesPart, Part, PointsPart};
    use glam::{DVec3, Vec3};

    fn said(part: Part) -> String {
        let payload = Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![part] };
        let block = Block::Payload(PayloadRef { asset: AssetId(0), id: LocalPayload(0) });
        validate(block, &BlockData::Payload(&payload)).map_or_else(|e| e.to_string(), |()| "sound".into())
    }

    #[test]
    fn points_and_lines_that_contradict_themselves_are_refused_with_the_cause() {
        let points = |radius, positions: Vec<Vec3>| {
            let n = positions.len();
            Part::Points(PointsPart {
                positions,
                normals: vec![Vec3::Y; n],
                albedo: vec![[1; 4]; n],
                radius,
                two_sided: false,
            })
        };
        let lines = |normals, indices| {
            Part::Lines(LinesPart {
                positions: vec![Vec3::ZERO, Vec3::X],
                normals: vec![Vec3::Y; normals],
                albedo: vec![[1; 4]; 2],
                indices,
            })
        };
        let cases = [
            (points(0.0, vec![]), "sound"),
            (points(0.5, vec![Vec3::ONE]), "sound"),
            (points(0.5, vec![Vec3::ONE, Vec3::new(0.0, f32::NAN, 0.0)]), "point 1 of 2 lies at [0, NaN, 0]"),
            (points(0.5, vec![Vec3::X * f32::INFINITY]), "point 0 of 1"),
            (points(f32::NAN, vec![]), "points of radius NaN"),
            (points(-1.0, vec![]), "points of radius -1"),
            (points(f32::INFINITY, vec![]), "points of radius inf"),
            (lines(2, vec![]), "sound"),
            (lines(2, vec![0, 1, 1, 1]), "sound"),
            (lines(2, vec![0, 1, 1]), "3 indices are not whole lines"),
            (lines(2, vec![0, 2]), "index 2 of 2 vertices"),
            (lines(1, vec![0, 1]), "2 positions, but 1 normals and 2 albedos"),
        ];
        for (part, cause) in cases {
            let told = format!("{part:?}");
            assert!(said(part).contains(cause), "{told}: {cause}");
        }
    }
}
