//! One cell: its pieces in parallel, then atlases, payloads, claims and the index in a fixed order.

use std::collections::BTreeMap;

use farfield_core::atlas::{blank, pack};
use farfield_core::claim::{Claim, Quantity};
use farfield_core::context::{Context, collect};
use farfield_core::id::{ChunkId, LocalPayload, ObjectId};
use farfield_core::payload::{Part, Payload, ProjectedPart, Projector};
use farfield_core::scene::ChunkSet;
use farfield_core::strategy::{CellJob, LeftOut, Sink};
use farfield_core::{Aabb, Fault};
use glam::Vec3;

use crate::TexturedLodMesh;
use crate::atlas::write;
use crate::index::{Atlas, Entry, Index};
use crate::mesh::{Baked, simplify};
use crate::object::Piece;
use crate::pieces::pieces;

/// Layers of an atlas, about: 8 of 2048 x 2048 are 256 MiB of albedo and normals.
const MAX_LAYERS: u32 = 8;

/// Bakes a cell; the far chunks do not meet its region.
pub(crate) fn bake(
    own: &TexturedLodMesh,
    job: &CellJob<'_>,
    out: &dyn Sink,
    cx: &Context<'_>,
) -> Result<Vec<u8>, Fault> {
    let (work, plain) = of_splits(job);
    let mut index = Index { plain, ..Index::default() };
    let mut baked = collect(cx.run, work.len(), &|i| simplify(own, job, &work[i].1, cx))?;
    report(&baked, &index, out);

    let groups: Vec<Vec<[u32; 2]>> =
        baked.iter().map(|b| b.iter().flat_map(|b| &b.views).map(|v| v.texels.size).collect()).collect();
    let packing = pack(&groups, own.atlas_px, MAX_LAYERS)?;
    let atlas_id = |a: u32| LocalPayload(work.len() as u32 + a);
    for (a, &(side, layers)) in packing.atlases.iter().enumerate() {
        cx.check()?;
        let mut part = blank([side; 2], layers);
        let mut bounds = Aabb::EMPTY;
        for (i, slots) in packing.slots.iter().enumerate() {
            let Some(b) = baked[i].as_mut().filter(|_| slots.first().is_some_and(|s| s.atlas as usize == a)) else {
                continue;
            };
            bounds = bounds.union(work[i].1.bounds);
            for (slot, view) in slots.iter().zip(&mut b.views) {
                write(&mut part, slot, &view.texels);
                view.texels = Default::default();
            }
        }
        let origin = job.cell.outline.centre.as_dvec3();
        let payload = Payload { origin, bounds, parts: vec![Part::Atlas(part)] };
        let id = atlas_id(a as u32);
        index.atlases.push(Atlas { payload: id.0, bounds, bytes: payload.texture_bytes() });
        out.put(id, &payload)?;
    }

    for (i, b) in baked.into_iter().enumerate() {
        let Some(b) = b else { continue };
        let (splits, piece) = &work[i];
        let slots = &packing.slots[i];
        let projectors: Vec<Projector> = b
            .views
            .iter()
            .zip(slots)
            .map(|(v, slot)| slot.projector(&v.camera, [0; 2], v.offset, atlas_id(slot.atlas)))
            .collect();
        let (hole_px, error_px, size_px) = (b.hole_px, b.error_px, b.size_px);
        let payload = payload(b, &projectors);
        let id = LocalPayload(i as u32);
        if let Some(max) = hole_px {
            out.claim(Claim { quantity: Quantity::HoleWidthPx, payload: Some(id), max });
        }
        for &split in splits {
            let shows = |k: &u32| {
                let s = &job.cell.sectors[*k as usize];
                s.split.0 == split && !s.seen.intersection(&piece.chunks).is_empty()
            };
            index.meshes.push(Entry {
                payload: id.0,
                parts: payload.parts.len() as u16,
                object: piece.object.0,
                split,
                sectors: (0..job.cell.sectors.len() as u32).filter(shows).collect(),
                bounds: payload.bounds,
                bytes: mesh_bytes(&payload),
                error_px,
                size_px,
                atlas: slots.first().map(|s| s.atlas),
            });
        }
        out.put(id, &payload)?;
    }
    index.encode()
}

/// The pieces of all splits, each with the splits that it is far in, and what no picture holds, split by split. Splits that leave
/// the same chunks of an object far share the piece: what is baked of it depends on the cell, not on the split.
fn of_splits(job: &CellJob<'_>) -> (Vec<(Vec<u32>, Piece)>, Vec<ChunkSet>) {
    let (mut work, mut all_plain): (Vec<(Vec<u32>, Piece)>, _) = (vec![], vec![]);
    let mut known: BTreeMap<(ObjectId, Option<ChunkId>), Vec<usize>> = BTreeMap::new();
    for (split, s) in job.cell.splits.iter().enumerate() {
        let (found, plain) = pieces(job.scene, &s.far, job.cell.outline.centre, job.views.near);
        for piece in found {
            let alike = known.entry((piece.object, piece.chunks.iter().next())).or_default();
            match alike.iter().find(|&&i| work[i].1.chunks == piece.chunks) {
                Some(&i) => work[i].0.push(split as u32),
                None => {
                    alike.push(work.len());
                    work.push((vec![split as u32], piece));
                }
            }
        }
        all_plain.push(plain);
    }
    (work, all_plain)
}

/// Says what the cell turned out not to need.
fn report(baked: &[Option<Baked>], index: &Index, out: &dyn Sink) {
    let say = |stage: &str, reason: String| {
        out.left_out(LeftOut { stage: stage.into(), reason, decided: "build".into() });
    };
    if !baked.is_empty() && baked.iter().flatten().all(|b| b.passes) {
        say("captures from neighbouring cells", "every object passes the view test".into());
    }
    let hidden = baked.iter().filter(|b| b.is_none()).count();
    if hidden > 0 {
        say("meshes", format!("{hidden} objects turn away from the whole cell"));
    }
    let plain: usize = index.plain.iter().map(|p| p.len()).sum();
    if plain > 0 {
        say("textured meshes", format!("{plain} chunks reach round the cell and are drawn as they are"));
    }
}

fn payload(b: Baked, projectors: &[Projector]) -> Payload {
    let mut bounds = Aabb::EMPTY;
    let parts: Vec<Part> = b
        .parts
        .into_iter()
        .map(|(mesh, views)| {
            // Outwards by a rounding: positions are sums in 32 bits.
            let at = |p: &Vec3| (p.as_dvec3() + b.origin).as_vec3();
            bounds = bounds.union(Aabb::of(mesh.positions.iter().map(at)));
            if projectors.is_empty() {
                Part::Mesh(mesh)
            } else {
                Part::Projected(ProjectedPart { mesh, views, projectors: projectors.to_vec() })
            }
        })
        .collect();
    Payload { origin: b.origin, bounds, parts }
}

/// Position and normal 12 bytes each, albedo 4 a vertex; three indices and a view set a triangle; 100 bytes a projector.
fn mesh_bytes(p: &Payload) -> u64 {
    let of = |m: &farfield_core::payload::MeshPart| m.positions.len() as u64 * 28 + m.indices.len() as u64 * 4;
    p.parts
        .iter()
        .map(|part| match part {
            Part::Mesh(m) => of(m),
            Part::Projected(q) => of(&q.mesh) + q.views.len() as u64 * 4 + q.projectors.len() as u64 * 100,
            Part::Atlas(_) | Part::Layered(_) | Part::Points(_) | Part::Lines(_) => 0,
        })
        .sum()
}
