//! Taking panoramic samples, and choosing where.
//!
//! Follows Wilson and Manocha 2003, section 3.2: samples at the region's corners first, then, one at a time, where a visibility metric
//! says that most is unseen, until it is satisfied. Places are chosen on samples of `sampling_px`, which cost little; those that meshes
//! are made of are taken again at full size.

use farfield_core::cell::Cell;
use farfield_core::context::{Context, Shot, collect};
use farfield_core::image::SurfaceImage;
use farfield_core::panorama::{Joined, Panorama, SkinTests};
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
        let facing = points(&samples);
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

/// Points of what samples see, spread over all of them, local frame.
fn points(samples: &[(Camera, SurfaceImage)]) -> Vec<Vec3> {
    let pixels: usize = samples.iter().map(|s| s.1.depth.len()).sum();
    let every = pixels.div_ceil(FACING).max(1);
    let of = |(c, image): &(Camera, SurfaceImage)| -> Vec<Vec3> {
        let point = |i: usize| {
            let (x, y) = (i as u32 % c.size[0], i as u32 / c.size[0]);
            let ray = c.ray(x as f32 + 0.5, y as f32 + 0.5).as_dvec3();
            (c.eye + ray * f64::from(image.depth[i])).as_vec3()
        };
        (0..image.depth.len()).step_by(every).filter(|&i| image.hit(i)).map(point).collect()
    };
    samples.iter().flat_map(of).collect()
}
