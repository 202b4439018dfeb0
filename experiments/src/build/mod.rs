//! Building: the cells that a path needs, in parallel, into the store.
//!
//! Every bake's key is the hash of all that it may depend on (scene, views, resolved settings, the cell, the scene's asset,
//! the capturer, the strategies' versions), so that a build resumes where it was stopped, and pipelines that differ in other
//! things share their cells.

mod division;
mod executor;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use farfield_core::Fault;
use farfield_core::camera::ViewModel;
use farfield_core::cell::Cell;
use farfield_core::context::{Capture, Context};
use farfield_core::id::CellId;
use farfield_core::scene::Scene;
use farfield_core::strategy::{CellJob, Covers, LeftOut, Needs, SceneJob};
use rayon::prelude::*;

pub use division::{Division, divide};
pub use executor::{NoCapture, Pool, capture};

use crate::config::{BuildWhen, Pipeline};
use crate::failure::Failure;
use crate::progress::{Bar, Progress};
use crate::results::Preprocess;
use crate::store::{Key, Manifest, Recorder, Store, StoreMemo, decode, encode, key};

/// What all builds of an experiment share.
pub struct Site<'a> {
    /// The scene.
    pub scene: &'a Arc<Scene>,
    /// The views to come.
    pub views: &'a ViewModel,
    /// The store.
    pub store: &'a Store,
    /// Takes pictures.
    pub capture: &'a dyn Capture,
    /// Set to stop.
    pub cancel: &'a AtomicBool,
    /// Shows how far it is.
    pub progress: &'a Progress,
}

/// One cell, built.
pub struct BuiltCell {
    /// Its inside.
    pub cell: Cell,
    /// Its asset: empty where the far field builds nothing for cells, `None` as long as it is not built.
    pub manifest: Option<Manifest>,
}

/// A pipeline, built.
pub struct Built {
    /// The scene's asset with its key, where the far field has one.
    pub shared: Option<(Key, Manifest)>,
    /// The needed cells; none yet where they are built on demand.
    pub cells: BTreeMap<CellId, BuiltCell>,
    /// What the far field draws.
    pub covers: Covers,
    /// What was left out and why, each once.
    pub left_out: Vec<LeftOut>,
    /// What it cost.
    pub preprocess: Preprocess,
}

impl Site<'_> {
    fn context<'b>(&'b self, memo: &'b StoreMemo) -> Context<'b> {
        Context { capture: self.capture, run: &Pool, memo, cancel: self.cancel }
    }

    /// A cell's inside alone, its far field to be built later where it has something to build.
    ///
    /// # Errors
    /// What the partition gives.
    pub fn inside_of(&self, pipeline: &Pipeline, division: &Division, id: CellId) -> Result<(BuiltCell, Needs), Fault> {
        let (_, cell) = self.inside(pipeline, division, id)?;
        let needs = pipeline.far_field.needs(self.scene, Some(&cell))?;
        let manifest = (!needs.cell_asset).then(Manifest::default);
        Ok((BuiltCell { cell, manifest }, needs))
    }

    /// The parts of a key that every block of a pipeline has.
    fn base(&self, kind: &str, settings: &serde_json::Value, version: u32) -> Result<Key, Fault> {
        Ok(key(
            kind,
            &[&self.scene.digest, &encode(self.views)?, settings.to_string().as_bytes(), &version.to_le_bytes()],
        ))
    }

    /// Builds a pipeline's needed cells.
    ///
    /// # Errors
    /// [`Failure::Cancelled`], or what the stages give, with the pipeline and cell.
    pub fn build(&self, pipeline: &Pipeline, division: &Division) -> Result<Built, Failure> {
        let failed = |f| Failure::during(format!("pipeline \"{}\"", pipeline.name), f);
        let start = Instant::now();
        let scene_needs = pipeline.far_field.needs(self.scene, None).map_err(failed)?;
        let (shared, shared_is_new) = if scene_needs.scene_asset {
            let (key, manifest, new) = self.scene_asset(pipeline).map_err(failed)?;
            (Some((key, manifest)), new)
        } else {
            (None, false)
        };
        let needed = match pipeline.build {
            BuildWhen::Ahead => division.needed.as_slice(),
            BuildWhen::OnDemand => &[],
        };
        let bar = self.progress.cells(&pipeline.name, needed.len());
        let made: Vec<Result<(CellId, BuiltCell, Needs, bool), Failure>> = needed
            .par_iter()
            .map(|&id| {
                let of_cell = |f| Failure::during(format!("pipeline \"{}\", cell {}", pipeline.name, id.0), f);
                let one = self.cell(pipeline, division, id, shared.as_ref().map(|s| (s.0, &s.1))).map_err(of_cell);
                bar.inc();
                one
            })
            .collect();
        bar.done();
        let (mut cells, mut left_out, mut cells_built) = (BTreeMap::new(), BTreeSet::new(), 0);
        let mut note = |all: &[LeftOut]| {
            left_out.extend(all.iter().map(|l| (l.decided.clone(), l.stage.clone(), l.reason.clone())))
        };
        note(&scene_needs.left_out);
        let mut covers = scene_needs.covers;
        for one in made {
            let (id, built, needs, new) = one?;
            note(&needs.left_out);
            note(built.manifest.as_ref().map_or(&[], |m| &m.left_out));
            covers = needs.covers;
            cells_built += usize::from(new);
            cells.insert(id, built);
        }
        note(&division.left_out());
        note(pipeline.build.left_out(division).as_slice());
        let bytes = |m: &Manifest| m.bytes() + m.index.len() as u64;
        let shared_bytes = shared.as_ref().map_or(0, |s| bytes(&s.1));
        let preprocess = Preprocess {
            seconds: if cells_built > 0 || shared_is_new { start.elapsed().as_secs_f64() } else { 0.0 },
            cells_built,
            cells_needed: division.needed.len(),
            cells_total: division.cells.outlines().len(),
            bytes_stored: cells.values().filter_map(|c| c.manifest.as_ref()).map(bytes).sum::<u64>() + shared_bytes,
            peak_rss_bytes: peak_rss_bytes(),
        };
        let left_out =
            left_out.into_iter().rev().map(|(decided, stage, reason)| LeftOut { stage, reason, decided }).collect();
        Ok(Built { shared, cells, covers, left_out, preprocess })
    }

    /// The asset with this key, if it is whole: every payload's checksum holds.
    fn whole(&self, asset: &Key) -> Option<Manifest> {
        let manifest: Manifest = decode(&self.store.get(asset)?).ok()?;
        manifest.payloads.values().all(|p| self.store.check(&p.key).is_some()).then_some(manifest)
    }

    /// What all cells share, and whether it was built just now.
    fn scene_asset(&self, pipeline: &Pipeline) -> Result<(Key, Manifest, bool), Fault> {
        let base = self.base("scene asset", &baked_settings(pipeline), pipeline.far_field.version())?;
        let needs = pipeline.far_field.needs(self.scene, None)?;
        let identity = if needs.captures { self.capture.identity() } else { "" };
        let asset = key("scene asset", &[&base, identity.as_bytes()]);
        let bar = self.progress.scene(&pipeline.name);
        let job = SceneJob { scene: self.scene, views: self.views };
        let made = self.asset(&asset, &bar, |sink, cx| pipeline.far_field.bake_scene(&job, sink, cx));
        bar.done();
        made.map(|(manifest, new)| (asset, manifest, new))
    }

    /// What a bake leaves: from the store, or made, and whether it was made just now.
    fn asset(
        &self,
        asset: &Key,
        bar: &Bar,
        bake: impl Fn(&Recorder<'_>, &Context<'_>) -> Result<Vec<u8>, Fault>,
    ) -> Result<(Manifest, bool), Fault> {
        let memo = StoreMemo::of(self.store, asset);
        let known = self.whole(asset);
        let new = known.is_none();
        let made = known.map_or_else(
            || {
                let sink = Recorder::new(self.store, *asset, bar);
                let index = bake(&sink, &self.context(&memo))?;
                sink.finish(index)
            },
            Ok,
        )?;
        memo.clear();
        Ok((made, new))
    }

    /// One cell, with what it needs, and whether it was built just now.
    ///
    /// # Errors
    /// What the stages give.
    pub fn cell(
        &self,
        pipeline: &Pipeline,
        division: &Division,
        id: CellId,
        shared: Option<(Key, &Manifest)>,
    ) -> Result<(CellId, BuiltCell, Needs, bool), Fault> {
        let (inside, cell) = self.inside(pipeline, division, id)?;
        let needs = pipeline.far_field.needs(self.scene, Some(&cell))?;
        if !needs.cell_asset {
            return Ok((id, BuiltCell { cell, manifest: Some(Manifest::default()) }, needs, false));
        }
        let base = self.base("cell asset", &baked_settings(pipeline), pipeline.far_field.version())?;
        let identity = if needs.captures { self.capture.identity() } else { "" };
        let outlines = if needs.neighbour_cells { encode(&division.cells.outlines())? } else { vec![] };
        let shared_key = shared.map_or([0; 32], |s| s.0);
        let asset = key("cell asset", &[&base, &inside, identity.as_bytes(), &outlines, &shared_key]);
        let job = CellJob {
            scene: self.scene,
            views: self.views,
            cell: &cell,
            outlines: division.cells.outlines(),
            shared: shared.map(|s| s.1.index.as_slice()),
        };
        let bar = Bar::default();
        let (manifest, new) = self.asset(&asset, &bar, |sink, cx| pipeline.far_field.bake_cell(&job, sink, cx))?;
        Ok((id, BuiltCell { cell, manifest: Some(manifest) }, needs, new))
    }

    /// A cell's inside, from the store or made, and the hash of its bytes.
    fn inside(&self, pipeline: &Pipeline, division: &Division, id: CellId) -> Result<(Key, Cell), Fault> {
        let base = self.base("cell", &pipeline.resolved["partition"], pipeline.partition.version())?;
        let name = key("cell", &[&base, &id.0.to_le_bytes()]);
        let memo = StoreMemo::of(self.store, &name);
        let cx = self.context(&memo);
        cx.check()?;
        if let Some(bytes) = self.store.get(&name)
            && let Ok(cell) = decode(&bytes)
        {
            return Ok((key("inside", &[&bytes]), cell));
        }
        let cell = division.cells.inside(id, self.scene, &cx)?;
        let bytes = encode(&cell)?;
        self.store.put(&name, &bytes).map_err(|e| Fault::Data { place: "store".into(), cause: e.to_string() })?;
        memo.clear();
        Ok((key("inside", &[&bytes]), cell))
    }
}

/// The process's peak resident set, bytes; 0 where the system does not tell.
pub fn peak_rss_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").trim().parse::<u64>().ok()).unwrap_or(0) * 1024
}

/// A far field's settings without those that only frames depend on.
fn baked_settings(pipeline: &Pipeline) -> serde_json::Value {
    let mut settings = pipeline.resolved["far_field"].clone();
    if let Some(table) = settings.as_object_mut() {
        pipeline.far_field.frame_settings().iter().for_each(|&name| _ = table.remove(name));
    }
    settings
}
