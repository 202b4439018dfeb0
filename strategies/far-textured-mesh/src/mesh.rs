//! One piece as one cell sees it: from original triangles to a small projected mesh.
//!
//! Follows textured LOD meshes (2003, sections 3.1.3 and 3.1.4), in this order: triangles that no viewpoint sees from in front go; the
//! view test decides between one view (SVMesh) and several (MVMesh); pictures are taken, from the cell's centre or from the neighbours'
//! centres too; they give weights and view sets; edges collapse; polygons get their views.
//!
//! Chosen here:
//!
//! * A neighbour's centre from which the piece does not fit a picture (it stands in or beside the piece) is left out. Where
//!   a partition gives no neighbours, corners of the region's footprint stand in for them.
//! * A piece under one pixel from everywhere in the cell becomes one small quadrilateral, without any picture.
//! * A vertex that the mesh shares with chunks outside the piece is locked.

use farfield_core::claim::Quantity;
use farfield_core::collapse::{Candidate, Collapsed, Cost, LiveMesh, Place, Reach, Settings, collapse};
use farfield_core::context::{Context, Shot};
use farfield_core::payload::MeshPart;
use farfield_core::region::Region;
use farfield_core::strategy::{CellJob, MeshView, Subject, Verdict, VertexSeen};
use farfield_core::{Camera, Fault};
use glam::{DVec3, Vec3};

use crate::atlas::{Texels, texels};
use crate::facing::{Eyes, Facing, faces_all, faces_some};
use crate::object::{Piece, Welded, weld};
use crate::pieces::WIDEST_TAN;
use crate::polygon::view_set;
use crate::shot::{Picture, combine, look};
use crate::{Lengths, TexturedLodMesh, Weigh};

/// A textured view that a mesh uses.
pub(crate) struct Projection {
    pub(crate) camera: Camera,
    /// From the eye to the piece's origin.
    pub(crate) offset: Vec3,
    pub(crate) texels: Texels,
}

/// A piece, simplified.
pub(crate) struct Baked {
    pub(crate) origin: DVec3,
    /// Meshes, one-sided before two-sided, each with a view set a triangle; empty sets only: no views at all.
    pub(crate) parts: Vec<(MeshPart, Vec<u32>)>,
    pub(crate) views: Vec<Projection>,
    /// What is claimed of its holes.
    pub(crate) hole_px: Option<f64>,
    /// Whether one view serves the whole cell.
    pub(crate) passes: bool,
    pub(crate) error_px: f32,
    pub(crate) size_px: f32,
}

/// Simplifies a piece; `None` where no viewpoint of the cell sees any of it.
pub(crate) fn simplify(
    own: &TexturedLodMesh,
    job: &CellJob<'_>,
    piece: &Piece,
    cx: &Context<'_>,
) -> Result<Option<Baked>, Fault> {
    cx.check()?;
    let outline = &job.cell.outline;
    let px_per_tan = density(job);
    let mesh = weld(job.scene, piece)?;
    let relative = |p: Vec3| p.as_dvec3() - mesh.origin;
    let Some(corners) = outline.region.corners() else {
        return Err(Fault::Refused("textured-lod-mesh: the region has no bound".into()));
    };
    let corners: Vec<DVec3> = corners.into_iter().map(relative).collect();

    let culled: Vec<bool> = mesh
        .triangles
        .iter()
        .zip(&mesh.two_sided)
        .map(|(&t, &two)| if two { mesh.area_vector(t) == DVec3::ZERO } else { !faces_some(&mesh, t, &corners) })
        .collect();
    if culled.iter().all(|c| *c) {
        return Ok(None);
    }
    let distance = outline.region.distance(&piece.bounds);
    if piece.bounds.size().length() * px_per_tan < distance {
        return Ok(Some(speck(&mesh, &culled, relative(outline.centre), piece.bounds.size().length())));
    }

    // The cell's centre first: it decides.
    let Some(camera) = own.camera(&mesh, relative(outline.centre), px_per_tan, job.views.near) else {
        return Err(Fault::Refused(format!(
            "textured-lod-mesh: object {} does not lie before the centre of cell {}",
            piece.object.0, outline.id.0
        )));
    };
    let mut views = shoot(&mesh, piece, &[camera], cx)?;
    let verdict = judge(own, job, piece, &mesh, &culled, &views, cx)?;
    let eyes = if verdict.passes {
        Eyes::new(&[relative(outline.centre)], px_per_tan)
    } else {
        let cameras: Vec<Camera> = neighbours(job)
            .into_iter()
            .filter_map(|eye| own.camera(&mesh, relative(eye), px_per_tan, job.views.near))
            .collect();
        views.extend(shoot(&mesh, piece, &cameras, cx)?);
        match own.lengths {
            Lengths::Centre => Eyes::new(&[relative(outline.centre)], px_per_tan),
            Lengths::LongestCorner => Eyes::new(&corners, px_per_tan),
        }
    };
    cx.check()?;

    let keep: Vec<bool> = (0..mesh.triangles.len())
        .map(|i| {
            let t = mesh.triangles[i];
            let faces = || match (verdict.passes, own.facing) {
                (true, _) => mesh.facing(t, relative(outline.centre)) > 0.0,
                (false, Facing::AnyCorner) => true,
                (false, Facing::AllCorners) => faces_all(&mesh, t, &corners),
            };
            !culled[i] && (mesh.two_sided[i] || faces())
        })
        .collect();
    let (steps, weights) = (own.steps(job.views.near), own.weights());
    let looks: Vec<_> = views.iter().map(|v| look(&mesh, v, &steps, &weights, own.visible_px)).collect();
    let seen = combine(&mesh, &looks, own.weigh == Weigh::AllViews);
    let stretch = f64::from(job.views.half_diagonal_rad()).cos().powi(-2);
    // What bounds a distance bounds it in a picture's corners too, where lengths are longest.
    let most_px = if own.collapse.bounds_distance() { own.edge_px / stretch as f32 } else { own.edge_px };
    let (out, border_move) = reduce(own, &mesh, &keep, &seen, &eyes, (!verdict.passes, most_px))?;

    let erosion_px = f64::from(border_move) / f64::from(distance) * stretch * f64::from(px_per_tan);
    let size_px = views[0].camera.size.map(|n| n as f32);
    let mut baked = assemble(own, &mesh, &out, &seen, views);
    baked.passes = verdict.passes;
    // A test that knows no pixels bounds no hole in pixels; a solid angle is of the piece before it is simplified, and is not claimed.
    let in_px = verdict.passes && verdict.quantity == Quantity::HoleWidthPx;
    baked.hole_px = in_px.then_some(verdict.claim + erosion_px);
    baked.error_px = if in_px { verdict.value as f32 } else { own.edge_px };
    baked.size_px = size_px[0].max(size_px[1]);
    Ok((!baked.parts.is_empty()).then_some(baked))
}

/// Pixels a unit of tangent in the cell's windows.
pub(crate) fn density(job: &CellJob<'_>) -> f32 {
    let windows = job.cell.sectors.iter().map(|s| s.window.px_per_tan).fold(0.0, f32::max);
    if windows > 0.0 { windows } else { job.views.px_per_tan() }
}

/// The eyes beside the centre.
fn neighbours(job: &CellJob<'_>) -> Vec<Vec3> {
    let outline = &job.cell.outline;
    let centres = outline.neighbours.iter().filter_map(|n| job.outlines.get(n.index())).map(|o| o.centre);
    let mut out: Vec<Vec3> = centres.collect();
    if out.is_empty() && outline.region != Region::Everywhere {
        let footprint = outline.region.footprint();
        // A ball's footprint has 32 corners: four do.
        let step = if footprint.len() > 8 { footprint.len() / 4 } else { 1 };
        out.extend(footprint.iter().step_by(step).map(|p| Vec3::new(p[0], outline.centre.y, p[1])));
    }
    out.truncate(31);
    out
}

impl TexturedLodMesh {
    /// The camera that fits the piece, relative to its origin; `None` where it does not fit one picture.
    fn camera(&self, mesh: &Welded, eye: DVec3, px_per_tan: f32, near: f32) -> Option<Camera> {
        let points = mesh.positions.iter().copied();
        let axis = (-eye).as_vec3();
        let c = Camera::around(eye, axis, points, px_per_tan * self.density, self.border_px, near)?;
        let widest = 1.5 * WIDEST_TAN;
        (c.left.min(c.bottom) >= -widest && c.right_tan.max(c.top) <= widest).then_some(c)
    }
}

/// Pictures of the piece alone. The cameras are relative to its origin.
fn shoot(mesh: &Welded, piece: &Piece, cameras: &[Camera], cx: &Context<'_>) -> Result<Vec<Picture>, Fault> {
    let shots: Vec<Shot> = cameras
        .iter()
        .map(|c| Shot { chunks: piece.chunks.clone(), camera: Camera { eye: c.eye + mesh.origin, ..*c } })
        .collect();
    let images = cx.capture.shoot(&shots)?;
    if images.len() != shots.len() || images.iter().zip(&shots).any(|(i, s)| i.size != s.camera.size) {
        let cause = "captures of another number or size than asked for".into();
        return Err(Fault::Device { device: cx.capture.identity().into(), cause });
    }
    let picture = |((c, shot), image): ((&Camera, Shot), _)| Picture {
        camera: shot.camera,
        offset: (-c.eye).as_vec3(),
        eye: c.eye,
        image,
    };
    Ok(cameras.iter().zip(shots).zip(images).map(picture).collect())
}

fn judge(
    own: &TexturedLodMesh,
    job: &CellJob<'_>,
    piece: &Piece,
    mesh: &Welded,
    culled: &[bool],
    views: &[Picture],
    cx: &Context<'_>,
) -> Result<Verdict, Fault> {
    let mut used = vec![false; mesh.positions.len()];
    for (t, _) in mesh.triangles.iter().zip(culled).filter(|(_, c)| !**c) {
        t.iter().for_each(|&v| used[v as usize] = true);
    }
    let local = |p: &Vec3| (p.as_dvec3() + mesh.origin).as_vec3();
    let facing: Vec<Vec3> = mesh.positions.iter().zip(&used).filter(|(_, u)| **u).map(|(p, _)| local(p)).collect();
    let samples: Vec<_> = views.iter().map(|v| (v.camera, v.image.clone())).collect();
    let subject = Subject {
        cell: job.cell,
        views: job.views,
        bounds: piece.bounds,
        facing: &facing,
        px_per_tan: density(job),
        samples: &samples,
    };
    own.view_test.judge(&subject, cx)
}

/// Keeps a collapse from leaving the original vertices and, with several views, from joining vertices that no view sees together.
struct Constrained<'a> {
    inner: Box<dyn Cost + 'a>,
    seen: &'a [VertexSeen],
    several_views: bool,
}

impl Cost for Constrained<'_> {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        self.inner.costs(mesh, edges, out);
        for (&[a, b], out) in edges.iter().zip(out) {
            let (a, b) = (self.seen[a as usize].views, self.seen[b as usize].views);
            let apart = self.several_views && a & b == 0 && a | b != 0;
            if apart || matches!(out.place, Place::At(_)) {
                *out = Candidate::FORBIDDEN;
            }
        }
    }

    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        self.inner.collapsed(mesh, from, onto, at);
    }

    fn verifies(&self) -> bool {
        self.inner.verifies()
    }

    fn verify(&mut self, mesh: &LiveMesh) -> Vec<f32> {
        self.inner.verify(mesh)
    }

    fn reach(&self) -> Reach {
        self.inner.reach()
    }
}

/// Collapses the kept triangles. Returns with them how far, in scene units, a vertex of their border went at most.
///
/// The border bounds what the silhouette loses: seen from the centre every kept triangle of one view faces it, so the number of
/// layers over a pixel is the winding number of the border round it, which cannot change farther from the border than the border moved.
fn reduce(
    own: &TexturedLodMesh,
    mesh: &Welded,
    keep: &[bool],
    seen: &[VertexSeen],
    eyes: &Eyes,
    (several_views, most_px): (bool, f32),
) -> Result<(Collapsed, f32), Fault> {
    let indices: Vec<u32> = mesh.triangles.iter().zip(keep).filter(|(_, k)| **k).flat_map(|(t, _)| *t).collect();
    let originals: Vec<u32> = (0..keep.len() as u32).filter(|&i| keep[i as usize]).collect();
    let locked: Vec<bool> = seen.iter().map(|s| s.locked).collect();
    let live = LiveMesh::new(&mesh.positions, &indices, &locked)?;
    let view = MeshView { positions: &mesh.positions, normals: &mesh.normals, albedo: &[], indices: &indices };
    let px = |a: Vec3, b: Vec3| eyes.length_px(a, b);
    let (inner, max_cost) = own.collapse.begin(view, seen, &px, most_px)?;
    let mut cost = Constrained { inner, seen, several_views };
    let settings = Settings {
        max_cost,
        link_condition: own.keep_topology,
        max_turn_rad: own.max_turn_deg.to_radians(),
        ..Settings::default()
    };
    let border: Vec<u32> = (0..mesh.positions.len() as u32).filter(|&v| live.is_border(v)).collect();
    let mut out = collapse(live, &mut cost, &settings);
    let moved = |&v: &u32| mesh.positions[v as usize].distance(mesh.positions[out.remap[v as usize] as usize]);
    let border_move = border.iter().map(moved).fold(0.0, f32::max);
    out.triangles.iter_mut().for_each(|t| *t = originals[*t as usize]);
    Ok((out, border_move))
}

/// Triangles, view sets and the texels that they use.
fn assemble(own: &TexturedLodMesh, mesh: &Welded, out: &Collapsed, seen: &[VertexSeen], views: Vec<Picture>) -> Baked {
    let triangles: Vec<[u32; 3]> = out.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    let corners = |t: [u32; 3]| t.map(|v| mesh.positions[v as usize]);
    let sees = |t: [u32; 3]| t.map(|v| seen[v as usize].views);
    let sets: Vec<u32> = triangles.iter().map(|&t| view_set(&views, corners(t), sees(t), own.polygon_views)).collect();
    // Views that texture nothing are left out; the others close ranks.
    let used = sets.iter().fold(0, |all, s| all | s);
    let rank = |i: usize| (used & ((1u32 << i) - 1)).count_ones();
    let ranked = |set: u32| (0..views.len()).filter(|i| set >> i & 1 == 1).fold(0, |s, i| s | 1 << rank(i));
    let mut parts = vec![];
    for two_sided in [false, true] {
        let chosen: Vec<usize> =
            (0..triangles.len()).filter(|&i| mesh.two_sided[out.triangles[i] as usize] == two_sided).collect();
        if chosen.is_empty() {
            continue;
        }
        let mut part = MeshPart { two_sided, ..MeshPart::default() };
        let mut local = vec![u32::MAX; mesh.positions.len()];
        for v in chosen.iter().flat_map(|&i| triangles[i]) {
            let at = v as usize;
            if local[at] == u32::MAX {
                local[at] = part.positions.len() as u32;
                part.positions.push(mesh.positions[at]);
                part.normals.push(mesh.shading[at]);
                part.albedo.push(mesh.albedo[at]);
            }
            part.indices.push(local[at]);
        }
        parts.push((part, chosen.iter().map(|&i| ranked(sets[i])).collect()));
    }
    let kept = views.into_iter().enumerate().filter(|(i, _)| used >> i & 1 == 1);
    let views = kept
        .map(|(_, v)| Projection { camera: v.camera, offset: v.offset, texels: texels(&v.image, own.dilate_px) })
        .collect();
    Baked { origin: mesh.origin, parts, views, hole_px: None, passes: true, error_px: 0.0, size_px: 0.0 }
}

/// Under a pixel: a square of the piece's mean colour and normal, at right angles to the line from the centre.
fn speck(mesh: &Welded, culled: &[bool], centre: DVec3, size: f32) -> Baked {
    let forward = (-centre).normalize_or(DVec3::X).as_vec3();
    let (right, up) = forward.any_orthonormal_pair();
    let (mut colour, mut normal, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for (t, _) in mesh.triangles.iter().zip(culled).filter(|(_, c)| !**c) {
        for &v in t {
            let [r, g, b, _] = mesh.albedo[v as usize].map(farfield_core::color::linear_of_byte);
            colour += Vec3::new(r, g, b);
            normal += mesh.shading[v as usize];
            count += 1.0;
        }
    }
    let [r, g, b] = (colour / count).to_array().map(farfield_core::color::byte_of_linear);
    // The diagonal of the box bounds the piece; a square of half its length has about the area of a round thing in it.
    let half = 0.25 * size;
    let at = |s: f32, u: f32| (right * s + up * u) * half;
    let part = MeshPart {
        positions: vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)],
        normals: vec![normal.try_normalize().unwrap_or(-forward); 4],
        albedo: vec![[r, g, b, 255]; 4],
        indices: vec![0, 1, 2, 0, 2, 3],
        two_sided: true,
    };
    let views = vec![];
    Baked {
        origin: mesh.origin,
        parts: vec![(part, vec![0; 2])],
        views,
        hole_px: None,
        passes: true,
        error_px: 1.0,
        size_px: 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Flat;
    impl Cost for Flat {
        fn costs(&mut self, _mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
            for (e, o) in edges.iter().zip(out) {
                let place = if e[1] == 3 { Place::At(Vec3::ZERO) } else { Place::First };
                *o = Candidate { cost: 1.0, place };
            }
        }
    }

    #[test]
    fn with_several_views_only_vertices_that_some_view_sees_together_or_none_sees_are_joined() {
        let seen = [0b01, 0b11, 0b10, 0b11, 0, 0].map(|views| VertexSeen { views, ..VertexSeen::default() });
        let live =
            LiveMesh::new(&[Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE, -Vec3::X], &[0, 1, 2], &[]).unwrap();
        let edges = [[0, 1], [0, 2], [1, 2], [0, 4], [4, 5], [1, 3]];
        let allowed = |several_views: bool| {
            let mut out = [Candidate::FORBIDDEN; 6];
            Constrained { inner: Box::new(Flat), seen: &seen, several_views }.costs(&live, &edges, &mut out);
            out.map(|c| c.cost.is_finite())
        };
        assert_eq!(allowed(true), [true, false, true, false, true, false]);
        // One view: nothing but new positions is refused.
        assert_eq!(allowed(false), [true, true, true, true, true, false]);
    }

    /// Estimates nothing right: no edge costs anything, and at the end every triangle that was changed turns out to be off by nine pixels. Counts
    /// how often it is asked then.
    struct Late<'a>(&'a std::cell::Cell<usize>, &'a [u32]);
    impl Cost for Late<'_> {
        fn costs(&mut self, _mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
            edges.iter().zip(out).for_each(|(_, o)| *o = Candidate { cost: 0.0, place: Place::First });
        }
        fn verifies(&self) -> bool {
            true
        }
        fn verify(&mut self, mesh: &LiveMesh) -> Vec<f32> {
            self.0.set(self.0.get() + 1);
            let off = |(t, was): (u32, &[u32])| if mesh.corners(t) == was { 0.0 } else { 9.0 };
            (0..).zip(self.1.chunks_exact(3)).map(off).collect()
        }
    }

    /// A metric that looks over the whole at the end is asked then, and what it finds too far off is taken back.
    #[test]
    fn what_a_metric_finds_at_the_end_counts() {
        // A strip.
        let places: Vec<Vec3> = (0..8).map(|i| Vec3::new((i / 2) as f32, (i % 2) as f32, 0.0)).collect();
        let indices: Vec<u32> =
            (0..3).flat_map(|k| [2 * k, 2 * k + 2, 2 * k + 1, 2 * k + 1, 2 * k + 2, 2 * k + 3]).collect();
        let seen = vec![VertexSeen::default(); 8];
        let left = |max_cost: f32, asked: &std::cell::Cell<usize>| {
            let live = LiveMesh::new(&places, &indices, &[false; 8]).unwrap();
            let mut cost = Constrained { inner: Box::new(Late(asked, &indices)), seen: &seen, several_views: false };
            let settings = Settings { max_cost, min_triangles: 3, link_condition: false, ..Settings::default() };
            collapse(live, &mut cost, &settings).triangles.len()
        };
        let asked = std::cell::Cell::new(0);
        let found = [10.0, 1.0].map(|most| (left(most, &asked), asked.take()));
        assert!(found[0].0 < 6 && found[0].1 > 0 && found[1].0 == 6, "triangles and times asked: {found:?}");
    }
}
