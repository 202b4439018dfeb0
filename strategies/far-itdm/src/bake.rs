//! From samples to scan cubes: the tree, what is redundant, meshes, their texels, payloads.

use std::collections::BTreeMap;

use farfield_core::atlas::{blank, pack};
use farfield_core::context::{Context, collect};
use farfield_core::id::LocalPayload;
use farfield_core::image::SurfaceImage;
use farfield_core::panorama::{Joined, Panorama, SkinTests, Surface};
use farfield_core::payload::{MeshPart, Part, Payload, ProjectedPart};
use farfield_core::scene::ChunkSet;
use farfield_core::strategy::{CellJob, LeftOut, Sink};
use farfield_core::{Aabb, Camera, Fault};
use glam::{DVec3, Vec3};

use crate::dense::Dense;
use crate::index::{Cube, Index, Piece};
use crate::redundancy::{Sample, kept, mend};
use crate::samples::{joined, panoramas, take};
use crate::simplify::{Extremes, Limits, Simplified, simplify};
use crate::texels::{Patch, patches, write};
use crate::tree::Tree;

/// Layers that every device's textures may have.
const MAX_LAYERS: u32 = 256;

/// Projectors that a part's triangles may name: one bit each.
const PROJECTORS: usize = 32;

/// How scan cubes are made.
pub(crate) struct Making {
    pub(crate) face_px: u32,
    /// How skins are found; `None` keeps them in the meshes.
    pub(crate) skins: Option<SkinTests>,
    /// The tolerance of the redundancy test; `None` makes every sample an intra sample.
    pub(crate) same_px: Option<f32>,
    pub(crate) limits: Limits,
    pub(crate) atlas_px: u32,
}

/// A sample on its way to a scan cube.
struct Kept {
    pixels: Vec<bool>,
    points: u64,
    mended: u64,
}

/// Bakes the samples of one split at `eyes` and adds their cubes to the index.
pub(crate) fn bake(
    making: &Making,
    job: &CellJob<'_>,
    (split, far): (u32, &ChunkSet),
    eyes: &[DVec3],
    index: &mut Index,
    out: &dyn Sink,
    cx: &Context<'_>,
) -> Result<(), Fault> {
    let views = take(eyes, far, making.face_px, job.views.near, cx)?;
    let all = panoramas(&views);
    let joined = match &making.skins {
        Some(tests) => joined(&all, tests, cx)?,
        None => all.iter().map(Joined::everything).collect(),
    };
    let tree = match making.same_px {
        Some(_) => Tree::new(eyes),
        None => Tree { parent: vec![None; eyes.len()], order: (0..eyes.len()).collect() },
    };
    let surfaces = collect(cx.run, all.len(), &|i| Ok(Surface::new(&all[i], &joined[i])))?;
    let kept = redundant(making, &all, &surfaces, &tree, cx)?;
    let first = index.cubes.len() as u32;
    let place = |i: usize| first + tree.order.iter().position(|&o| o == i).unwrap_or_default() as u32;
    let made = collect(cx.run, tree.order.len(), &|k| {
        cx.check()?;
        let i = tree.order[k];
        let dense = Dense::new(&all[i], &surfaces[i], &kept[i].pixels);
        let mesh = simplify(&dense, &extremes(job, eyes[i], making.face_px), &making.limits)?;
        let id = LocalPayload(first + k as u32);
        let (payload, pieces, texels) = cube(making, &all[i], &mesh, id)?;
        let cube = Cube {
            payload: id.0,
            split,
            eye: eyes[i],
            parent: tree.parent[i].map(place),
            object: most_seen(&views[6 * i..6 * i + 6]),
            bytes: bytes(&payload),
            bounds: payload.bounds,
            pieces,
            points: kept[i].points,
            kept: kept[i].pixels.iter().filter(|k| **k).count() as u64,
            mended: kept[i].mended,
            dense_triangles: dense.triangles() as u64,
            texels,
        };
        out.put(id, &payload)?;
        Ok(cube)
    })?;
    report(&made, out);
    index.cubes.extend(made);
    Ok(())
}

/// What each sample keeps, generation by generation, since a sample's borders depend on what its ancestors kept.
fn redundant(
    making: &Making,
    all: &[Panorama<'_>],
    surfaces: &[Surface],
    tree: &Tree,
    cx: &Context<'_>,
) -> Result<Vec<Kept>, Fault> {
    let same_px = making.same_px.unwrap_or(0.0);
    let mut done: Vec<Option<Kept>> = all.iter().map(|_| None).collect();
    for generation in tree.generations() {
        let kept = collect(cx.run, generation.len(), &|k| {
            cx.check()?;
            let i = generation[k];
            let ancestors: Vec<&Panorama<'_>> = tree.ancestors(i).map(|a| &all[a]).collect();
            let mut pixels = kept(&all[i], &ancestors, same_px);
            let sample = |a: usize| {
                let keep = done[a].as_ref().map(|k| k.pixels.as_slice())?;
                Some(Sample { panorama: &all[a], surface: &surfaces[a], keep })
            };
            let ancestors: Vec<Sample<'_>> = tree.ancestors(i).filter_map(sample).collect();
            let mended = if ancestors.is_empty() { 0 } else { mend(&all[i], &mut pixels, &ancestors, same_px) };
            let points = (0..all[i].pixels()).filter(|&p| all[i].depth(p).is_finite()).count() as u64;
            Ok(Kept { pixels, points, mended })
        })?;
        generation.iter().zip(kept).for_each(|(&i, k)| done[i] = Some(k));
    }
    Ok(done.into_iter().flatten().collect())
}

/// The extreme viewpoints of the region, and the sample's own, relative to it.
fn extremes(job: &CellJob<'_>, eye: DVec3, face_px: u32) -> Extremes {
    let mut eyes = vec![Vec3::ZERO];
    for w in job.cell.outline.region.corners().into_iter().flatten() {
        let w = (w.as_dvec3() - eye).as_vec3();
        if !eyes.contains(&w) {
            eyes.push(w);
        }
    }
    Extremes { eyes, px_per_tan: 0.5 * face_px as f32 }
}

/// The payload of a scan cube, its drawable parts, and how many texels it stores.
fn cube(
    making: &Making,
    p: &Panorama<'_>,
    mesh: &Simplified,
    id: LocalPayload,
) -> Result<(Payload, Vec<Piece>, u64), Fault> {
    let eye = p.eye();
    if mesh.indices.is_empty() {
        // All that it sees an ancestor has, or it sees nothing. The index, JSON, has no word for an empty box.
        let bounds = Aabb::of([eye.as_vec3()]);
        return Ok((Payload { origin: eye, bounds, parts: vec![] }, vec![], 0));
    }
    let cameras: Vec<Camera> = p.views().iter().map(|v| v.0).collect();
    let patches = patches(&cameras, mesh);
    let sizes: Vec<[u32; 2]> = patches.iter().map(|p| [p.rect[2], p.rect[3]]).collect();
    let mut side = making.atlas_px;
    let mut packing = pack(std::slice::from_ref(&sizes), side, u32::MAX)?;
    while packing.atlases[0].1 > MAX_LAYERS && side < 16384 {
        side *= 2;
        packing = pack(std::slice::from_ref(&sizes), side, u32::MAX)?;
    }
    let slots = &packing.slots[0];
    // No larger than what is used of it.
    let used = |k: usize| slots.iter().map(|s| s.rect[k] + s.rect[k + 2]).max().unwrap_or(1);
    let mut atlas = blank([used(0), used(1)], packing.atlases[0].1);
    patches.iter().zip(slots).for_each(|(patch, slot)| write(&mut atlas, slot, &p.views()[patch.view].1, patch));
    let texels = patches.iter().map(|p| u64::from(p.rect[2]) * u64::from(p.rect[3])).sum();
    let mut parts = vec![Part::Atlas(atlas)];
    let (mut pieces, mut bounds) = (vec![], Aabb::EMPTY);
    // A part is of one picture, so that it can be culled.
    for (patches, slots) in groups(&patches).map(|r| (&patches[r.clone()], &slots[r])) {
        let mut part = ProjectedPart::default();
        let mut new: BTreeMap<u32, u32> = BTreeMap::new();
        for (k, (patch, slot)) in patches.iter().zip(slots).enumerate() {
            let corner = [patch.rect[0], patch.rect[1]];
            part.projectors.push(slot.projector(&cameras[patch.view], corner, Vec3::ZERO, id));
            for &t in &patch.triangles {
                part.views.push(1 << k);
                for &v in &mesh.indices[3 * t as usize..3 * t as usize + 3] {
                    let next = new.len() as u32;
                    let at = *new.entry(v).or_insert(next);
                    if at == next {
                        part.mesh.positions.push(mesh.positions[v as usize]);
                    }
                    part.mesh.indices.push(at);
                }
            }
        }
        attributes(&mut part.mesh);
        let at = |p: &Vec3| (p.as_dvec3() + eye).as_vec3();
        let own = Aabb::of(part.mesh.positions.iter().map(at));
        bounds = bounds.union(own);
        let triangles = part.views.len() as u64;
        pieces.push(Piece { part: parts.len() as u16, bounds: own, triangles });
        parts.push(Part::Projected(part));
    }
    Ok((Payload { origin: eye, bounds, parts }, pieces, texels))
}

/// Runs of patches of one picture, as long as projectors suffice.
fn groups(patches: &[Patch]) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
    let mut at = 0;
    std::iter::from_fn(move || {
        let first = patches.get(at)?;
        let n = patches[at..].iter().take(PROJECTORS).take_while(|p| p.view == first.view).count();
        at += n;
        Some(at - n..at)
    })
}

/// Attributes for triangles that no projector sees; here each has one, so that they are a formality.
fn attributes(mesh: &mut MeshPart) {
    let mut normals = vec![Vec3::ZERO; mesh.positions.len()];
    for t in mesh.indices.as_chunks::<3>().0 {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        t.iter().for_each(|&v| normals[v as usize] += (b - a).cross(c - a));
    }
    mesh.normals = normals.into_iter().map(|n| n.try_normalize().unwrap_or(Vec3::Y)).collect();
    mesh.albedo = vec![[128, 128, 128, 255]; mesh.positions.len()];
}

/// The object that most pixels show, as the object plane names it.
fn most_seen(views: &[(Camera, SurfaceImage)]) -> u32 {
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    for o in views.iter().flat_map(|v| &v.1.object).filter(|o| **o != 0) {
        *counts.entry(*o).or_default() += 1;
    }
    counts.into_iter().max_by_key(|&(o, n)| (n, std::cmp::Reverse(o))).map_or(1, |(o, _)| o)
}

/// Bytes in memory: 28 a vertex, 16 a triangle, 100 a projector, 8 a texel.
fn bytes(p: &Payload) -> u64 {
    let of = |part: &Part| match part {
        Part::Projected(q) => {
            28 * q.mesh.positions.len() as u64 + 16 * q.views.len() as u64 + 100 * q.projectors.len() as u64
        }
        _ => 0,
    };
    p.texture_bytes() + p.parts.iter().map(of).sum::<u64>()
}

/// Says what need not be stored.
fn report(cubes: &[Cube], out: &dyn Sink) {
    let deltas: Vec<&Cube> = cubes.iter().filter(|c| c.parent.is_some()).collect();
    let (points, kept): (u64, u64) = deltas.iter().fold((0, 0), |(p, k), c| (p + c.points, k + c.kept));
    if points > 0 {
        let share = 100.0 * (points - kept) as f64 / points as f64;
        let reason = format!("{share:.1} % of the points of {} delta samples are seen by an ancestor", deltas.len());
        out.left_out(LeftOut { stage: "redundant points".into(), reason, decided: "build".into() });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_of_nothing_has_a_box_that_an_index_can_hold() {
        let n = 4;
        let nothing = SurfaceImage {
            size: [n; 2],
            albedo: vec![[0; 4]; 16],
            normal: vec![0; 16],
            depth: vec![f32::INFINITY; 16],
            object: vec![0; 16],
        };
        let views = Camera::cube(DVec3::new(1.0, 2.0, 3.0), n, 0.1).map(|c| (c, nothing.clone()));
        let limits = Limits { border_px: 0.5, interior_px: 0.5, tree_triangles: 1 };
        let making = Making { face_px: n, skins: None, same_px: None, limits, atlas_px: 64 };
        let mesh = Simplified { positions: vec![], indices: vec![], views: vec![] };
        let (payload, pieces, texels) = cube(&making, &Panorama::new(&views), &mesh, LocalPayload(0)).unwrap();
        assert_eq!((pieces.len(), texels), (0, 0));
        let cube = Cube {
            payload: 0,
            split: 0,
            eye: payload.origin,
            parent: None,
            object: most_seen(&views),
            bytes: bytes(&payload),
            bounds: payload.bounds,
            pieces,
            points: 0,
            kept: 0,
            mended: 0,
            dense_triangles: 0,
            texels,
        };
        let index = Index { cubes: vec![cube] };
        assert_eq!(Index::decode("test", &index.encode().unwrap()).unwrap(), index);
    }
}
