//! Captures for bakes: many small pictures of original geometry, each traced on the thread that asks for it.

use std::collections::BTreeMap;

use farfield_core::Fault;
use farfield_core::context::{Capture, Shot};
use farfield_core::id::MeshChunkId;
use farfield_core::image::SurfaceImage;
use farfield_core::scene::Scene;
use rayon::prelude::*;

use crate::block::Surface;
use crate::frame::Frame;
use crate::paint;
use crate::tables::Tables;

/// Raised whenever captures change, however little: it is part of every store key.
const VERSION: u32 = 1;

/// Captures by ray casting. Hierarchies are built once, at the start, and shared by all shots.
///
/// A shot costs O(pixels * log triangles) and O(chunks log chunks) to put the chunks in order.
pub struct CpuCapture {
    identity: String,
    tables: Tables,
    surfaces: BTreeMap<MeshChunkId, Surface>,
}

impl CpuCapture {
    /// Reads every chunk of the scene and builds the hierarchies, on the threads of the pool that the caller is in.
    ///
    /// # Errors
    /// What reading the geometry gives.
    pub fn new(scene: &Scene) -> Result<Self, Fault> {
        let ids: Vec<MeshChunkId> = scene.mesh_chunk_ids().collect();
        let surfaces = ids
            .into_par_iter()
            .map(|id| {
                let mut surface = None;
                scene.geometry.with(id, &mut |c| surface = Some(Surface::chunk(c)))?;
                surface.map(|s| (id, s)).ok_or_else(|| Fault::Data {
                    place: format!("{id:?}"),
                    cause: "the geometry kept its chunk to itself".into(),
                })
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { identity: format!("cpu ray caster, version {VERSION}"), tables: Tables::new(scene), surfaces })
    }

    fn shot(&self, shot: &Shot) -> Result<SurfaceImage, Fault> {
        let frame = Frame::of_chunks(shot.camera.eye, &shot.chunks, &self.tables, |id| {
            self.surfaces.get(&id).ok_or_else(|| Fault::Refused(format!("the scene has no {id:?}")))
        })?;
        Ok(paint::surface(&frame, &shot.camera, false))
    }
}

impl Capture for CpuCapture {
    fn identity(&self) -> &str {
        &self.identity
    }

    fn shoot(&self, shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        shots.iter().map(|s| self.shot(s)).collect()
    }
}
