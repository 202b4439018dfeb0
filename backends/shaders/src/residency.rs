//! Which blocks are on the device and where: the bookkeeping of a backend, without the device.

use std::collections::HashMap;

use farfield_core::backend::{BlockData, validate};
use farfield_core::id::{AssetId, Block, LocalPayload, MeshChunkId, PayloadRef};
use farfield_core::layered::LayeredPart;
use farfield_core::payload::{LinesPart, MeshPart, Part, Payload, PointsPart, ProjectedPart};
use farfield_core::{Camera, Fault};
use glam::DVec3;

use crate::layout::ATLAS_SLOTS;
use crate::pack;
use crate::pool::{PageId, PageSizes, Pool, Span, Stream};
use crate::warp::{MAX_IMAGE_PX, MAX_SAMPLES};

/// Where drawable triangles lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Their vertices.
    pub vertices: Span,
    /// Their indices.
    pub indices: Span,
}

/// Where a layered depth image lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayeredSlot {
    /// Its samples, and its objects behind them.
    pub span: Span,
    /// How many samples.
    pub samples: u32,
    /// Its camera, the eye relative to the payload's origin.
    pub camera: Camera,
    /// Whether it is drawn smoothed.
    pub smooth: bool,
}

/// A resident part of a payload.
#[derive(Clone, Debug, PartialEq)]
pub enum PartSlot {
    /// A plain mesh.
    Mesh {
        /// Where it lies.
        slot: Slot,
        /// Whether it is drawn from behind too.
        two_sided: bool,
    },
    /// A projected mesh.
    Projected {
        /// Where it lies.
        slot: Slot,
        /// Whether it is drawn from behind too.
        two_sided: bool,
        /// Where its projectors lie.
        projectors: Span,
        /// The payloads whose atlases it draws from, by slot.
        atlases: [Option<LocalPayload>; ATLAS_SLOTS],
    },
    /// Texels; the backend keeps those of a payload's first part as textures.
    Atlas {
        /// Whether there are none.
        empty: bool,
    },
    /// A layered depth image.
    Layered(LayeredSlot),
    /// Points.
    Points {
        /// Where they lie.
        span: Span,
        /// Half the edge of a splat, scene units.
        radius: f32,
        /// Whether they are drawn from behind too.
        two_sided: bool,
    },
    /// Lines.
    Lines {
        /// Where they lie.
        span: Span,
    },
}

/// A resident payload.
#[derive(Clone, Debug, PartialEq)]
pub struct PayloadSlot {
    /// Where its positions start from, local frame.
    pub origin: DVec3,
    /// Its parts.
    pub parts: Vec<PartSlot>,
}

/// What a backend has to do so that a block becomes drawable, in this order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Placement {
    /// Pages to make, with their bytes.
    pub pages: Vec<(PageId, u64)>,
    /// What to write: page, byte offset, bytes (a multiple of four, as is the offset).
    pub writes: Vec<(PageId, u64, Vec<u8>)>,
    /// Whether the payload's first part is an atlas, whose texels have to become two textures (replacing those that the block
    /// had; where this is false, textures that the block had are dropped).
    pub atlas: bool,
    /// Device bytes that the block takes, textures included.
    pub bytes: u64,
}

/// The blocks on a device.
#[derive(Debug)]
pub struct Residency {
    pools: [Pool; Stream::ALL.len()],
    /// With whether there are texture coordinates.
    chunks: HashMap<MeshChunkId, (Slot, bool)>,
    payloads: HashMap<PayloadRef, PayloadSlot>,
}

impl Residency {
    /// Nothing resident. `storage_max_bytes` bounds a page of what shaders read as storage.
    pub fn new(sizes: PageSizes, storage_max_bytes: u64) -> Self {
        let bound = sizes.max_bytes.min(storage_max_bytes);
        let storage = PageSizes {
            first_bytes: (1 << 20).min(bound),
            usual_bytes: sizes.usual_bytes.min(bound),
            max_bytes: bound,
        };
        Self {
            pools: Stream::ALL.map(|s| Pool::new(s, if s.is_storage() { storage } else { sizes })),
            chunks: HashMap::new(),
            payloads: HashMap::new(),
        }
    }

    /// Finds room for a block, which must be sound, and packs it. A block that is there is replaced.
    ///
    /// # Errors
    /// [`Fault::Data`] where the block contradicts itself, [`Fault::Refused`] where a projected part draws from more than
    /// [`ATLAS_SLOTS`] atlases or a layered depth image has more samples than a storage binding or a splat's number takes or more
    /// than [`MAX_IMAGE_PX`] pixels across or down, [`Fault::Device`] where no buffer of the device can hold a part. The block is then not there.
    pub fn place(&mut self, block: Block, data: &BlockData<'_>) -> Result<Placement, Fault> {
        validate(block, data)?;
        self.release(block);
        let mut out = Placement::default();
        match self.find_room(block, data, &mut out) {
            Ok(()) => Ok(out),
            Err(fault) => {
                self.undo(block, &out, 0);
                Err(fault)
            }
        }
    }

    fn find_room(&mut self, block: Block, data: &BlockData<'_>, out: &mut Placement) -> Result<(), Fault> {
        match (block, data) {
            (Block::Chunk(id), BlockData::Chunk(c)) => {
                let slot = self.triangles(
                    block,
                    Stream::ChunkVertices,
                    bytemuck::cast_slice(&pack::chunk_vertices(c)),
                    &c.indices,
                    out,
                )?;
                self.chunks.insert(id, (slot, !c.uvs.is_empty()));
            }
            (Block::Payload(id), BlockData::Payload(p)) => {
                let slot = self.payload(block, p, out)?;
                self.payloads.insert(id, slot);
            }
            _ => {
                return Err(Fault::Data {
                    place: format!("{block:?}"),
                    cause: "a chunk was given as a payload or a payload as a chunk".into(),
                });
            }
        }
        Ok(())
    }

    fn payload(&mut self, block: Block, p: &Payload, out: &mut Placement) -> Result<PayloadSlot, Fault> {
        let mut made = PayloadSlot { origin: p.origin, parts: vec![] };
        for (i, part) in p.parts.iter().enumerate() {
            let slot = match part {
                Part::Mesh(m) => self.mesh(block, m, out),
                Part::Projected(m) => self.projected(block, m, out),
                Part::Atlas(a) => {
                    if i == 0 {
                        out.atlas = !a.albedo.is_empty();
                        out.bytes += 4 * (a.albedo.len() + a.normal.len()) as u64;
                    }
                    Ok(PartSlot::Atlas { empty: a.albedo.is_empty() })
                }
                Part::Layered(l) => self.layered(block, l, out),
                Part::Points(p) => self.points(block, p, out),
                Part::Lines(l) => self.lines(block, l, out),
            };
            match slot {
                Ok(slot) => made.parts.push(slot),
                Err(fault) => {
                    self.give_back(&made);
                    return Err(fault);
                }
            }
        }
        Ok(made)
    }

    fn mesh(&mut self, block: Block, m: &MeshPart, out: &mut Placement) -> Result<PartSlot, Fault> {
        let vertices = pack::mesh_vertices(m);
        let slot = self.triangles(block, Stream::MeshVertices, bytemuck::cast_slice(&vertices), &m.indices, out)?;
        Ok(PartSlot::Mesh { slot, two_sided: m.two_sided })
    }

    fn projected(&mut self, block: Block, p: &ProjectedPart, out: &mut Placement) -> Result<PartSlot, Fault> {
        let mut named: Vec<LocalPayload> = p.projectors.iter().map(|q| q.atlas).collect();
        named.sort_unstable();
        named.dedup();
        if named.len() > ATLAS_SLOTS {
            return Err(Fault::Refused(format!(
                "{block:?}: a projected part draws from {} atlases; this backend binds {ATLAS_SLOTS}",
                named.len()
            )));
        }
        let slot_of = |i: usize| named.iter().position(|&a| a == p.projectors[i].atlas).unwrap_or(0) as u32;
        let packed = pack::projectors(p, slot_of);
        let projectors = self.bytes(block, Stream::Projectors, bytemuck::cast_slice(&packed), out)?;
        let (vertices, indices) = pack::projected_vertices(p);
        let slot = self
            .triangles(block, Stream::ProjectedVertices, bytemuck::cast_slice(&vertices), &indices, out)
            .inspect_err(|_| self.pools[Stream::Projectors as usize].give(projectors))?;
        let atlases = std::array::from_fn(|i| named.get(i).copied());
        Ok(PartSlot::Projected { slot, two_sided: p.mesh.two_sided, projectors, atlases })
    }

    fn layered(&mut self, block: Block, l: &LayeredPart, out: &mut Placement) -> Result<PartSlot, Fault> {
        let refuse = |cause: String| Err(Fault::Refused(format!("{block:?}: a layered depth image of {cause}")));
        let [w, h] = l.camera.size;
        if w.max(h) > MAX_IMAGE_PX {
            return refuse(format!("{w} x {h} pixels; this backend takes {MAX_IMAGE_PX} each way"));
        }
        if l.samples() > MAX_SAMPLES {
            return refuse(format!("{} samples; this backend takes {MAX_SAMPLES}", l.samples()));
        }
        let stride = Stream::Samples.stride();
        let bytes = (l.samples() + l.objects.len().div_ceil(4)) as u64 * stride;
        let most = self.pools[Stream::Samples as usize].max_bytes();
        if bytes > most {
            let n = l.samples();
            return refuse(format!("{n} samples needs {bytes} bytes in one storage binding; this device binds {most}"));
        }
        let packed = pack::samples(l);
        let span = self.bytes(block, Stream::Samples, bytemuck::cast_slice(&packed), out)?;
        let samples = l.samples() as u32;
        Ok(PartSlot::Layered(LayeredSlot { span, samples, camera: l.camera, smooth: l.smooth }))
    }

    fn points(&mut self, block: Block, p: &PointsPart, out: &mut Placement) -> Result<PartSlot, Fault> {
        let span = self.bytes(block, Stream::Points, bytemuck::cast_slice(&pack::points(p)), out)?;
        Ok(PartSlot::Points { span, radius: p.radius, two_sided: p.two_sided })
    }

    fn lines(&mut self, block: Block, l: &LinesPart, out: &mut Placement) -> Result<PartSlot, Fault> {
        let span = self.bytes(block, Stream::Lines, bytemuck::cast_slice(&pack::lines(l)), out)?;
        Ok(PartSlot::Lines { span })
    }

    fn triangles(
        &mut self,
        block: Block,
        stream: Stream,
        vertices: &[u8],
        indices: &[u32],
        out: &mut Placement,
    ) -> Result<Slot, Fault> {
        let vertices = self.bytes(block, stream, vertices, out)?;
        let indices = self
            .bytes(block, Stream::Indices, bytemuck::cast_slice(indices), out)
            .inspect_err(|_| self.pools[stream as usize].give(vertices))?;
        Ok(Slot { vertices, indices })
    }

    fn bytes(&mut self, block: Block, stream: Stream, data: &[u8], out: &mut Placement) -> Result<Span, Fault> {
        let too_large = || Fault::Device {
            device: "buffers".into(),
            cause: format!("{block:?}: {} bytes of {stream:?} do not fit in one buffer of this device", data.len()),
        };
        let len = u32::try_from(data.len() as u64 / stream.stride()).map_err(|_| too_large())?;
        let (span, made) = self.pools[stream as usize].take(len).ok_or_else(too_large)?;
        let page = PageId { stream, index: span.page };
        out.pages.extend(made.map(|bytes| (page, bytes)));
        if len > 0 {
            out.writes.push((page, u64::from(span.first) * stream.stride(), data.to_vec()));
        }
        out.bytes += data.len() as u64;
        Ok(span)
    }

    /// Takes back what [`Residency::place`] planned, where the device refused one of its pages: the block is not there, and of
    /// `placement.pages` only the first `made` exist.
    pub fn undo(&mut self, block: Block, placement: &Placement, made: usize) {
        self.release(block);
        for (page, bytes) in placement.pages[made..].iter().rev() {
            self.pools[page.stream as usize].forget_last_page(*bytes);
        }
    }

    /// Frees a block; says whether it was there.
    pub fn release(&mut self, block: Block) -> bool {
        match block {
            Block::Chunk(id) => {
                self.chunks.remove(&id).map(|(slot, _)| self.give_slot(Stream::ChunkVertices, slot)).is_some()
            }
            Block::Payload(id) => self.payloads.remove(&id).map(|p| self.give_back(&p)).is_some(),
        }
    }

    fn give_back(&mut self, p: &PayloadSlot) {
        for part in &p.parts {
            match part {
                PartSlot::Mesh { slot, .. } => self.give_slot(Stream::MeshVertices, *slot),
                PartSlot::Projected { slot, projectors, .. } => {
                    self.give_slot(Stream::ProjectedVertices, *slot);
                    self.pools[Stream::Projectors as usize].give(*projectors);
                }
                PartSlot::Layered(slot) => self.pools[Stream::Samples as usize].give(slot.span),
                PartSlot::Points { span, .. } => self.pools[Stream::Points as usize].give(*span),
                PartSlot::Lines { span } => self.pools[Stream::Lines as usize].give(*span),
                PartSlot::Atlas { .. } => {}
            }
        }
    }

    fn give_slot(&mut self, stream: Stream, slot: Slot) {
        self.pools[stream as usize].give(slot.vertices);
        self.pools[Stream::Indices as usize].give(slot.indices);
    }

    /// Where a chunk lies, if it is there, and whether it has texture coordinates.
    pub fn chunk(&self, id: MeshChunkId) -> Option<(Slot, bool)> {
        self.chunks.get(&id).copied()
    }

    /// Where a payload lies, if it is there.
    pub fn payload_slot(&self, id: PayloadRef) -> Option<&PayloadSlot> {
        self.payloads.get(&id)
    }

    /// Whether a payload is there and its first part is an atlas with texels.
    pub fn has_atlas(&self, asset: AssetId, id: LocalPayload) -> bool {
        let parts = self.payloads.get(&PayloadRef { asset, id }).map(|p| &p.parts[..]);
        matches!(parts, Some([PartSlot::Atlas { empty: false }, ..]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::Aabb;
    use farfield_core::mesh::ChunkMesh;
    use farfield_core::payload::{AtlasPart, Projector};
    use glam::{Mat4, Vec3};

    fn residency(max_bytes: u64) -> Residency {
        Residency::new(PageSizes { first_bytes: 4096, usual_bytes: 8192, max_bytes }, max_bytes)
    }

    fn id(n: u32) -> PayloadRef {
        PayloadRef { asset: AssetId(0), id: LocalPayload(n) }
    }

    fn chunk(triangles: u32) -> ChunkMesh {
        let n = 3 * triangles;
        ChunkMesh {
            positions: vec![Vec3::ONE; n as usize],
            normals: vec![Vec3::Y; n as usize],
            vertex_ids: vec![0; n as usize],
            indices: (0..n).collect(),
            ..ChunkMesh::default()
        }
    }

    /// A projected triangle whose projectors draw from so many atlases.
    fn projected(atlases: u32) -> Payload {
        let projector = |i| Projector {
            matrix: Mat4::IDENTITY,
            eye: Vec3::Z,
            atlas: LocalPayload(i),
            layer: 0,
            rect: [0, 0, 4, 4],
        };
        let mesh = MeshPart {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            albedo: vec![[9; 4]; 3],
            indices: vec![0, 1, 2],
            two_sided: false,
        };
        let part = ProjectedPart { mesh, views: vec![1], projectors: (0..atlases).map(projector).collect() };
        Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![Part::Projected(part)] }
    }

    #[test]
    fn what_is_written_lies_where_the_slot_says() {
        let mut r = residency(1 << 20);
        let chunk_id = |chunk| MeshChunkId { mesh: farfield_core::id::MeshId(0), chunk };
        let mut firsts = vec![];
        for (i, triangles) in [5, 1, 40].into_iter().enumerate() {
            let id = chunk_id(i as u32);
            let placement = r.place(Block::Chunk(id), &BlockData::Chunk(&chunk(triangles))).unwrap();
            let (slot, has_uvs) = r.chunk(id).unwrap();
            assert!(!has_uvs);
            assert_eq!(placement.bytes, u64::from(triangles) * 3 * (28 + 4));
            let (page, offset, bytes) = &placement.writes[0];
            assert_eq!((page.index, *offset), (slot.vertices.page, u64::from(slot.vertices.first) * 28));
            assert_eq!(bytes.len() as u32, slot.vertices.len * 28);
            firsts.push(slot.vertices.first);
        }
        assert_eq!(firsts, [0, 15, 18]);
        assert!(r.release(Block::Chunk(chunk_id(0))) && !r.release(Block::Chunk(chunk_id(0))));
        r.place(Block::Chunk(chunk_id(7)), &BlockData::Chunk(&chunk(4))).unwrap();
        assert_eq!(r.chunk(chunk_id(7)).unwrap().0.vertices.first, 0, "the freed range is used again");
    }

    #[test]
    fn more_atlases_than_slots_are_refused_and_leave_nothing() {
        let mut r = residency(1 << 20);
        let most = ATLAS_SLOTS as u32;
        r.place(Block::Payload(id(0)), &BlockData::Payload(&projected(most))).unwrap();
        let fault = r.place(Block::Payload(id(1)), &BlockData::Payload(&projected(most + 1))).unwrap_err();
        assert!(fault.to_string().contains("draws from 5 atlases"), "{fault}");
        assert!(r.payload_slot(id(1)).is_none() && r.payload_slot(id(0)).is_some());
    }

    #[test]
    fn a_block_that_no_buffer_holds_leaves_no_page_behind() {
        let mut r = residency(3000);
        // 75 vertices fit (2100 bytes), 825 indices do not (3300 bytes): the page of vertices has to go again.
        let mut c = chunk(25);
        c.indices = c.indices.iter().cycle().take(825).copied().collect();
        let block = Block::Chunk(MeshChunkId { mesh: farfield_core::id::MeshId(0), chunk: 0 });
        let fault = r.place(block, &BlockData::Chunk(&c)).unwrap_err();
        assert!(matches!(fault, Fault::Device { .. }), "{fault}");
        let again = r.place(block, &BlockData::Chunk(&chunk(25))).unwrap();
        assert_eq!(again.pages[0].0, PageId { stream: Stream::ChunkVertices, index: 0 }, "the page is to be made anew");
    }

    /// One image of 4 x 2 pixels with as many samples, in one pixel after the other.
    fn image(samples: usize) -> Payload {
        let camera = Camera::looking(DVec3::ZERO, Vec3::X, Vec3::Y, 1.0, [4, 2], 0.1);
        let part = LayeredPart {
            camera,
            inverse_depth: [1.0, 0.5],
            counts: (0..8).map(|i| samples.saturating_sub(255 * i).min(255) as u8).collect(),
            depth: vec![7; samples],
            albedo: vec![[1, 2, 3]; samples],
            normal: vec![[0, 127]; samples],
            object: vec![4; samples],
            objects: vec![1, 2, 3, 4, 5],
            smooth: true,
        };
        Payload { origin: DVec3::ONE, bounds: Aabb::EMPTY, parts: vec![Part::Layered(part)] }
    }

    #[test]
    fn images_take_whole_elements_and_give_them_back() {
        let mut r = residency(4096);
        let first = r.place(Block::Payload(id(0)), &BlockData::Payload(&image(10))).unwrap();
        // Ten samples, and two elements for five objects.
        assert_eq!((first.bytes, first.writes[0].2.len()), (192, 192));
        r.place(Block::Payload(id(1)), &BlockData::Payload(&image(3))).unwrap();
        let span = |r: &Residency, n| match r.payload_slot(id(n)).unwrap().parts[0] {
            PartSlot::Layered(s) => (s.span.first, s.span.len, s.samples, s.smooth),
            _ => panic!("an image"),
        };
        assert_eq!([span(&r, 0), span(&r, 1)], [(0, 12, 10, true), (12, 5, 3, true)]);
        r.release(Block::Payload(id(0)));
        r.place(Block::Payload(id(2)), &BlockData::Payload(&image(10))).unwrap();
        assert_eq!(span(&r, 2).0, 0, "the freed range is used again");
    }

    #[test]
    fn images_too_large_are_refused_and_leave_nothing() {
        let mut r = residency(4096);
        let fault = r.place(Block::Payload(id(0)), &BlockData::Payload(&image(255))).unwrap_err();
        assert!(matches!(&fault, Fault::Refused(c) if c.contains("4112 bytes in one storage binding")), "{fault}");
        let mut wide = image(0);
        if let Part::Layered(l) = &mut wide.parts[0] {
            l.camera.size = [MAX_IMAGE_PX + 1, 1];
            l.counts = vec![0; MAX_IMAGE_PX as usize + 1];
        }
        let fault = r.place(Block::Payload(id(0)), &BlockData::Payload(&wide)).unwrap_err();
        assert!(matches!(&fault, Fault::Refused(c) if c.contains("65537 x 1 pixels")), "{fault}");
        assert!(r.payload_slot(id(0)).is_none());
        r.place(Block::Payload(id(0)), &BlockData::Payload(&image(254))).unwrap();
    }

    #[test]
    fn points_and_lines_take_the_bytes_that_they_say_and_give_them_back() {
        let mut r = residency(4096);
        let with = |points: usize, lines: usize| {
            let (positions, normals) = (vec![Vec3::ONE; points], vec![Vec3::Y; points]);
            let albedo = vec![[1, 2, 3, 255]; points];
            let points = PointsPart {
                positions: positions.clone(),
                normals: normals.clone(),
                albedo: albedo.clone(),
                radius: 0.25,
                two_sided: true,
            };
            let lines = LinesPart { positions, normals, albedo, indices: vec![0; 2 * lines] };
            let bytes = points.bytes() + lines.bytes();
            let parts = vec![Part::Points(points), Part::Lines(lines)];
            (Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts }, bytes)
        };
        let (payload, bytes) = with(10, 3);
        let placement = r.place(Block::Payload(id(0)), &BlockData::Payload(&payload)).unwrap();
        assert_eq!((placement.bytes, bytes), (320, 320));
        assert_eq!(placement.writes.iter().map(|w| w.2.len()).collect::<Vec<_>>(), [200, 120]);
        assert_eq!([payload.points(), payload.lines(), payload.triangles()], [10, 3, 0]);
        r.place(Block::Payload(id(1)), &BlockData::Payload(&with(5, 2).0)).unwrap();
        let spans = |r: &Residency, n| match r.payload_slot(id(n)).unwrap().parts[..] {
            [PartSlot::Points { span: p, radius: 0.25, two_sided: true }, PartSlot::Lines { span: l }] => {
                [p.first, p.len, l.first, l.len]
            }
            ref other => panic!("{other:?}"),
        };
        assert_eq!([spans(&r, 0), spans(&r, 1)], [[0, 10, 0, 3], [10, 5, 3, 2]]);
        r.release(Block::Payload(id(0)));
        r.place(Block::Payload(id(2)), &BlockData::Payload(&with(10, 3).0)).unwrap();
        assert_eq!(spans(&r, 2), [0, 10, 0, 3], "the freed ranges are used again");
        // More than a storage binding: refused, and nothing is left of it.
        let fault = r.place(Block::Payload(id(3)), &BlockData::Payload(&with(205, 1).0)).unwrap_err();
        assert!(matches!(fault, Fault::Device { .. }), "{fault}");
        assert!(r.payload_slot(id(3)).is_none());
    }

    #[test]
    fn a_replaced_atlas_is_said_to_be_gone() {
        let mut r = residency(1 << 20);
        let atlas = AtlasPart { size: [2, 1], layers: 1, albedo: vec![[1; 4]; 2], normal: vec![[2; 4]; 2] };
        let with = |parts| Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts };
        let first = r.place(Block::Payload(id(3)), &BlockData::Payload(&with(vec![Part::Atlas(atlas)]))).unwrap();
        assert!(first.atlas && first.bytes == 16 && r.has_atlas(AssetId(0), LocalPayload(3)));
        let second = r.place(Block::Payload(id(3)), &BlockData::Payload(&with(vec![]))).unwrap();
        assert!(!second.atlas && second.bytes == 0 && !r.has_atlas(AssetId(0), LocalPayload(3)));
    }
}
