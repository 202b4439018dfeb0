//! `plan`: what would be built and what is left out, with reasons and estimated sizes. Nothing is built or written.

use std::sync::atomic::AtomicBool;

use farfield_core::Camera;
use farfield_core::cell::Split;
use farfield_core::context::{Context, Forget};
use farfield_core::strategy::{Covers, LeftOut, Level};
use serde::Serialize;

use crate::build::{NoCapture, Pool};
use crate::config::{BuildWhen, Experiment};
use crate::failure::Failure;
use crate::run::Prepared;

/// Bytes of a texel in memory: albedo and normal.
const TEXEL_BYTES: u64 = 8;

/// The plan of an experiment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Triangles of the scene.
    pub scene_triangles: u64,
    /// Objects of the scene.
    pub scene_objects: usize,
    /// Frames of the path.
    pub frames: usize,
    /// One a pipeline.
    pub pipelines: Vec<PipelinePlan>,
}

/// The plan of a pipeline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PipelinePlan {
    /// Its name.
    pub name: String,
    /// Whether something is built for the scene as a whole.
    pub scene_asset: bool,
    /// Cells that are built ahead of the walk.
    pub cells_built: usize,
    /// Cells that the path visits.
    pub cells_needed: usize,
    /// Cells of the partition.
    pub cells_total: usize,
    /// Frames outside all cells.
    pub frames_outside_cells: usize,
    /// Whether building takes pictures.
    pub captures: bool,
    /// Original triangles near a visited cell, or its partition's budget for a frame where there is one: mean and largest.
    pub near_triangles_mean: f64,
    /// The largest of them.
    pub near_triangles_max: u64,
    /// An upper estimate of the texels' bytes in memory, over all built cells: every far object's box as its cell's centre sees
    /// it, albedo and normal a pixel.
    pub estimated_texture_bytes: u64,
    /// Levels of detail, where there will be a hierarchy of them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<Level>,
    /// What is left out, and why.
    pub left_out: Vec<LeftOut>,
}

/// Plans an experiment.
///
/// # Errors
/// [`Failure::Input`] where a stage refuses.
pub fn plan(experiment: &Experiment, prepared: &Prepared, cancel: &AtomicBool) -> Result<Plan, Failure> {
    let pipelines = (0..experiment.pipelines.len()).map(|i| of_pipeline(experiment, prepared, i, cancel));
    Ok(Plan {
        scene_triangles: prepared.scene.triangles(),
        scene_objects: prepared.scene.objects.len(),
        frames: prepared.cameras.len(),
        pipelines: pipelines.collect::<Result<_, _>>()?,
    })
}

fn of_pipeline(
    experiment: &Experiment,
    prepared: &Prepared,
    i: usize,
    cancel: &AtomicBool,
) -> Result<PipelinePlan, Failure> {
    let (p, division, scene) = (&experiment.pipelines[i], &prepared.divisions[i], &prepared.scene);
    let refused = |f| Failure::before(format!("pipeline \"{}\"", p.name), f);
    let cx = Context { capture: &NoCapture, run: &Pool, memo: &Forget, cancel };
    let scene_needs = p.far_field.needs(scene, None).map_err(refused)?;
    let mut left_out = scene_needs.left_out.clone();
    let (mut cells_built, mut captures, mut texels, mut near) = (0, false, 0u64, vec![]);
    for &id in &division.needed {
        let cell = division.cells.inside(id, scene, &cx).map_err(refused)?;
        let needs = p.far_field.needs(scene, Some(&cell)).map_err(refused)?;
        left_out.extend(needs.left_out.iter().cloned());
        captures |= needs.captures && needs.cell_asset;
        let of_split = |s: &Split| match needs.covers {
            Covers::Far => s.near_budget.unwrap_or_else(|| scene.triangles() - scene.triangles_of(&s.far)),
            Covers::Everything => scene.triangles(),
        };
        near.push(cell.splits.iter().map(of_split).max().unwrap_or(0));
        if needs.cell_asset {
            cells_built += usize::from(p.build == BuildWhen::Ahead);
            if needs.captures {
                let centre = cell.outline.centre.as_dvec3();
                texels += cell.splits.iter().map(|s| texels_of(prepared, &s.far, centre)).sum::<u64>();
            }
        }
    }
    left_out.extend(division.left_out());
    left_out.extend(p.build.left_out(division));
    left_out.sort_by(|a, b| (&a.stage, &a.reason).cmp(&(&b.stage, &b.reason)));
    left_out.dedup();
    Ok(PipelinePlan {
        name: p.name.clone(),
        scene_asset: scene_needs.scene_asset,
        cells_built,
        cells_needed: division.needed.len(),
        cells_total: division.cells.outlines().len(),
        frames_outside_cells: division.path.iter().filter(|c| c.is_none()).count(),
        captures,
        near_triangles_mean: near.iter().sum::<u64>() as f64 / near.len().max(1) as f64,
        near_triangles_max: near.iter().copied().max().unwrap_or(0),
        estimated_texture_bytes: texels * TEXEL_BYTES,
        levels: p.far_field.census(scene, None).map_err(refused)?,
        left_out,
    })
}

/// Pixels of the far objects' boxes, seen from a centre at the views' density.
fn texels_of(prepared: &Prepared, far: &farfield_core::scene::ChunkSet, centre: glam::DVec3) -> u64 {
    let objects: std::collections::BTreeSet<_> = far.iter().map(|c| prepared.scene.chunks[c.index()].object).collect();
    let pixels = |o: farfield_core::id::ObjectId| -> u64 {
        let b = prepared.scene.objects[o.index()].bounds;
        let axis = (b.centre().as_dvec3() - centre).as_vec3();
        let picture = Camera::around(centre, axis, b.corners(), prepared.views.px_per_tan(), 1, prepared.views.near);
        picture.map_or(0, |c| u64::from(c.size[0]) * u64::from(c.size[1]))
    };
    objects.into_iter().map(pixels).sum()
}

/// As text.
pub fn text(plan: &Plan) -> String {
    let mut out =
        format!("{} triangles in {} objects, {} frames\n", plan.scene_triangles, plan.scene_objects, plan.frames);
    for p in &plan.pipelines {
        out += &format!("\n{}\n", p.name);
        out += &format!(
            "  cells: {} built, {} visited, {} in the partition\n",
            p.cells_built, p.cells_needed, p.cells_total
        );
        out +=
            &format!("  near triangles a cell: {:.0} mean, {} at most\n", p.near_triangles_mean, p.near_triangles_max);
        if !p.levels.is_empty() {
            let nodes: Vec<String> = p.levels.iter().map(|l| l.nodes.to_string()).collect();
            out += &format!("  nodes a level, coarsest first: {}\n", nodes.join(", "));
        }
        if p.scene_asset {
            out += "  built once for the scene: yes\n";
        }
        if p.captures {
            out += &format!(
                "  takes pictures; texels up to about {:.1} MB in memory\n",
                p.estimated_texture_bytes as f64 / 1e6
            );
        }
        for l in &p.left_out {
            out += &format!("  left out: {}: {} (decided: {})\n", l.stage, l.reason, l.decided);
        }
    }
    out
}
