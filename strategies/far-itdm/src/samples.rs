//! Taking panoramic samples, and choosing where.
//!
//! Follows Wilson and Manocha 2003, section 3.2: samples at the region's corners first, then, one at a time, where a visibility metric
//! says that most is unseen, until it is satisfied. Places are chosen on samples of `sampling_px`, which cost little; those that meshes
//! are made of are taken again at full size.

use farfield_core::cell::Cell;
use farfield_core::context::{Context, Shot, collect};
use farfield_core::image::SurfaceImage;
use farfield_core::panorama::{Joined, Panorama, SkinTests, spread};
use farfield_core::scene::ChunkSet;
use farfield_core::strategy::{CellJob, Subject, Verdict, VisibilityMetric};
use farfield_core::{Aabb, Camera, Fault};
use glam::{DVec3, Vec3};

/// Faces of a sample.
const FACES: usize = 6;
/// Points that stand for what a region sees, for metrics that ask where surfaces are.
const FACING: usize = 20_000;

/// Where to sample.
pub(crate) struct Sampling<'a> {
    pub(crate) metric: &'a dyn VisibilityMetric,
    pub(crate) first: Vec<DVec3>,
    pub(crate) max_samples: usize,
    pub(crate) face_px: u32,
}

/// Places that were chosen, and the metric's last word on them.
pub(crate) struct Chosen {
    pub(crate) eyes: Vec<DVec3>,
    pub(crate) verdict: Verdict,
}

/// Takes samples of `chunks`: six pictures an eye.
pub(crate) fn take(
    eyes: &[DVec3],
    chunks: &ChunkSet,
    face_px: u32,
    near: f32,
    cx: &Context<'_>,
) -> Result<Vec<(Camera, SurfaceImage)>, Fault> {
    let mut out = vec![];
    for &eye in eyes {
        cx.check()?;
        let cameras = Camera::cube(eye, face_px, near);
        let shots = cameras.map(|camera| Shot { chunks: chunks.clone(), camera });
        let images = cx.capture.shoot(&shots)?;
        if images.len() != FACES {
            return Err(Fault::Refused(format!("a capture gave {} of {FACES} pictures", images.len())));
        }
        out.extend(cameras.into_iter().zip(images));
    }
    Ok(out)
}

/// The samples as panoramas. Coincident eyes stay apart.
pub(crate) fn panoramas(views: &[(Camera, SurfaceImage)]) -> Vec<Panorama<'_>> {
    views.chunks(FACES).map(Panorama::new).collect()
}

/// Which neighbouring pixels share a surface, by all three tests, of every sample.
pub(crate) fn joined(all: &[Panorama<'_>], tests: &SkinTests, cx: &Context<'_>) -> Result<Vec<Joined>, Fault> {
    collect(cx.run, all.len(), &|i| {
        cx.check()?;
        let mut joined = Joined::new(&all[i], tests);
        let others = all.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, other)| other);
        joined.see_past_all(&all[i], others);
        Ok(joined)
    })
}

/// Chooses places for samples of `far`.
pub(crate) fn choose(own: &Sampling<'_>, job: &CellJob<'_>, far: &ChunkSet, cx: &Context<'_>) -> Result<Chosen, Fault> {
    let bounds = far.iter().fold(Aabb::EMPTY, |b, c| b.union(job.scene.chunks[c.index()].bounds));
    let mut eyes = own.first.clone();
    let mut samples = take(&eyes, far, own.face_px, job.views.near, cx)?;
    loop {
        let facing = spread(&samples, FACING);
        let subject = subject(job, bounds, &facing, &samples);
        let next = if eyes.len() < own.max_samples { own.metric.next(&subject, cx)? } else { None };
        match next.map(Vec3::as_dvec3).filter(|p| !eyes.contains(p)) {
            Some(p) => {
                samples.extend(take(&[p], far, own.face_px, job.views.near, cx)?);
                eyes.push(p);
            }
            None => return Ok(Chosen { verdict: own.metric.judge(&subject, cx)?, eyes }),
        }
    }
}

fn subject<'a>(
    job: &CellJob<'a>,
    bounds: Aabb,
    facing: &'a [Vec3],
    samples: &'a [(Camera, SurfaceImage)],
) -> Subject<'a> {
    let cell: &'a Cell = job.cell;
    Subject { cell, views: job.views, bounds, facing, px_per_tan: job.views.px_per_tan(), samples }
}
