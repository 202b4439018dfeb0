//! One cell: its windows in parallel, each picture merged as it is taken, and a payload a window.

use std::collections::BTreeMap;

use farfield_core::cell::{Cell, Sector};
use farfield_core::context::{Context, Shot, collect};
use farfield_core::id::LocalPayload;
use farfield_core::image::SurfaceImage;
use farfield_core::layered::{LayeredPart, normal_bytes};
use farfield_core::payload::{Part, Payload};
use farfield_core::region::Region;
use farfield_core::scene::ChunkSet;
use farfield_core::strategy::{CellJob, LeftOut, Sink};
use farfield_core::{Aabb, Camera, Fault};
use glam::{DVec3, Vec3};

use crate::LayeredDepthImage;
use crate::enough::Enough;
use crate::frame::{Framed, Grain, frame};
use crate::index::{Index, Picture};
use crate::merge::{Layers, Sample};
use crate::places;

/// Bakes a cell; the far chunks do not meet its region.
pub(crate) fn bake(
    own: &LayeredDepthImage,
    job: &CellJob<'_>,
    out: &dyn Sink,
    cx: &Context<'_>,
) -> Result<Index, Fault> {
    let made = collect(cx.run, job.cell.sectors.len(), &|i| {
        let sector = &job.cell.sectors[i];
        let seen = sector.seen.intersection(&job.cell.splits[sector.split.index()].far);
        let grain = Grain { density: own.density, max_px: own.max_px };
        let Some(framed) = frame(job.cell, sector, &seen, job.scene, job.views.near, grain)? else { return Ok(None) };
        let (pixels, taken) = merged(own, job, sector, &seen, &framed, cx)?;
        let Some((part, bounds)) = part(own, &framed.camera, &pixels)? else { return Ok(None) };
        let mut picture = picture(i as u32, sector, job.cell, &framed, &part, bounds);
        picture.taken = own.enough.as_ref().map(|_| taken[0]);
        let eye = framed.camera.eye;
        out.put(LocalPayload(i as u32), &Payload { origin: eye, bounds, parts: vec![Part::Layered(part)] })?;
        Ok(Some((picture, taken)))
    })?;
    let (pictures, taken): (Vec<Picture>, Vec<[u32; 2]>) = made.into_iter().flatten().unzip();
    report(own, &pictures, out);
    report_spared(&taken, out);
    Ok(Index { pictures })
}

/// Takes the pictures of a window, one at a time, and merges them: the centre's, then the others, nearest to the window first, until
/// they are enough. Gives also how many were taken, and how many there are places for.
fn merged(
    own: &LayeredDepthImage,
    job: &CellJob<'_>,
    sector: &Sector,
    seen: &ChunkSet,
    framed: &Framed,
    cx: &Context<'_>,
) -> Result<(Vec<Vec<Sample>>, [u32; 2]), Fault> {
    let shoot = |camera: Camera| -> Result<SurfaceImage, Fault> {
        cx.check()?;
        let image = cx.capture.shoot(&[Shot { chunks: seen.clone(), camera }])?.pop();
        image.ok_or_else(|| Fault::Refused("a capture that gave no image".into()))
    };
    let mut offsets = places::around(job.cell, &sector.window, own.construction_images as usize - 1);
    offsets.sort_by(|a, b| b.dot(sector.window.axis).total_cmp(&a.dot(sector.window.axis)));
    let central = shoot(framed.camera)?;
    let mut layers = Layers::new(framed.camera, own.merge_px, &central);
    let mut enough = own.enough.as_deref().map(|m| Enough::new(m, job, sector, seen, (framed.camera, central)));
    let mut taken = [1, 1 + offsets.len() as u32];
    for offset in offsets {
        if let Some(enough) = &enough
            && enough.passes(cx)?
        {
            break;
        }
        let camera = places::camera(framed, offset, own.max_px);
        let image = shoot(camera)?;
        layers.add(&camera, &image);
        taken[0] += 1;
        if let Some(enough) = &mut enough {
            enough.add(camera, image);
        }
    }
    Ok((layers.finish(), taken))
}

/// The layered part and the box of its samples; `None` where there are none.
fn part(
    own: &LayeredDepthImage,
    camera: &Camera,
    pixels: &[Vec<Sample>],
) -> Result<Option<(LayeredPart, Aabb)>, Fault> {
    let all = || pixels.iter().flatten();
    let (near, far) = all().fold((f32::INFINITY, 0f32), |(n, f), s| (n.min(s.depth), f.max(s.depth)));
    if far <= 0.0 {
        return Ok(None);
    }
    let inverse_depth = [near.recip(), far.recip()];
    let mut numbers: BTreeMap<u32, u16> = all().map(|s| (s.object, 0)).collect();
    for (i, n) in numbers.values_mut().enumerate() {
        *n = u16::try_from(i).map_err(|_| {
            Fault::Refused(
                "layered-depth-image: more than 65,536 objects in one image; divide the window's far part".into(),
            )
        })?;
    }
    let mut bounds = Aabb::EMPTY;
    for (i, samples) in pixels.iter().enumerate() {
        let (x, y) = (i as u32 % camera.size[0], i as u32 / camera.size[0]);
        let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5).as_dvec3();
        let at = |s: &Sample| (camera.eye + ray * f64::from(s.depth)).as_vec3();
        bounds = bounds.union(Aabb::of(samples.iter().map(at)));
    }
    // Elements are a footprint large.
    let footprint = Vec3::splat(far / camera.px_per_tan());
    bounds = Aabb { min: bounds.min - footprint, max: bounds.max + footprint };
    let part = LayeredPart {
        camera: Camera { eye: DVec3::ZERO, ..*camera },
        inverse_depth,
        counts: pixels.iter().map(|p| p.len() as u8).collect(),
        depth: all().map(|s| LayeredPart::quantise(s.depth, inverse_depth)).collect(),
        albedo: all().map(|s| s.albedo).collect(),
        normal: all().map(|s| normal_bytes(s.normal)).collect(),
        object: all().map(|s| numbers[&s.object]).collect(),
        objects: numbers.into_keys().collect(),
        smooth: own.smooth,
    };
    Ok(Some((part, bounds)))
}

fn picture(payload: u32, sector: &Sector, cell: &Cell, framed: &Framed, part: &LayeredPart, bounds: Aabb) -> Picture {
    let c = &framed.camera;
    let [w, h] = c.size.map(|s| s as f32);
    let [near, far] = part.inverse_depth.map(f32::recip);
    // A pixel around: elements on the border reach over it.
    let corners = std::array::from_fn(|i| {
        let pick = |bit: usize, a: f32, b: f32| if i >> bit & 1 == 0 { a } else { b };
        let ray = c.ray(pick(0, -1.0, w + 1.0), pick(1, -1.0, h + 1.0)).as_dvec3();
        (c.eye + ray * f64::from(pick(2, near, far))).as_vec3()
    });
    let moved = match &cell.outline.region {
        Region::Sphere { centre, radius } => centre.distance(cell.outline.centre) + radius,
        region => region.corners().into_iter().flatten().map(|p| p.distance(cell.outline.centre)).fold(0.0, f32::max),
    };
    Picture {
        payload,
        split: sector.split.0,
        bounds,
        corners,
        // What the largest of the backends needs: 16 bytes a sample and 4 an object on a GPU.
        bytes: part.bytes().max(16 * part.samples() as u64 + 4 * part.objects.len().next_multiple_of(4) as u64),
        size: c.size,
        covered: part.counts.iter().filter(|n| **n > 0).count() as u64,
        samples: part.samples() as u64,
        deepest: u32::from(part.counts.iter().copied().max().unwrap_or(0)),
        coarse: framed.coarse,
        rounding_px: part.rounding_px(moved.min(0.5 * near), sector.window.px_per_tan),
        taken: None,
    }
}

/// Says what the cell turned out not to get.
fn report(own: &LayeredDepthImage, pictures: &[Picture], out: &dyn Sink) {
    let coarse = pictures.iter().filter(|p| p.coarse * own.density > 1.001);
    let (n, worst) = coarse.fold((0, 0f32), |(n, worst), p| (n + 1, worst.max(p.coarse)));
    if n > 0 {
        let reason = format!(
            "{n} images would have edges of more than {} pixels: the coarsest has {:.3} pixels a pixel of its window",
            own.max_px,
            worst.recip()
        );
        out.left_out(LeftOut { stage: "image density".into(), reason, decided: "build".into() });
    }
}

/// Says how many of the pictures that there are places for were not taken.
fn report_spared(taken_of: &[[u32; 2]], out: &dyn Sink) {
    let [taken, places] =
        taken_of.iter().fold([0u64; 2], |sum, t| [sum[0] + u64::from(t[0]), sum[1] + u64::from(t[1])]);
    if taken < places {
        let n = taken_of.len() as f64;
        let [spared, each] = [places - taken, places].map(|k| k as f64 / n);
        let reason = format!("on average {spared:.2} of {each:.2} an image were not needed");
        out.left_out(LeftOut { stage: "construction images".into(), reason, decided: "build".into() });
    }
}
