//! Surface distance: how far, in pixels, what a candidate shows lies from the original surface, and the other way round.
//!
//! Every pixel of the candidate shows a surface point, taken back from its depth; with q the point of the original surface that is nearest to
//! it in space, its distance is that of q's image from the pixel's centre. And every surface point of the reference's picture, with q on what the candidate
//! draws: so an outline that is too narrow counts as well as one that is too wide. What is nearest in space need not be nearest in the picture, so that
//! the distance is never too small for a bound in space seen in pixels.
//!
//! A splat stands for surface within its radius: a pixel that shows one may be off by half the diagonal of its square beside, and a
//! reference's point counts from the sphere of its radius. A line is a pixel wide. What 32-bit positions cannot tell apart does not count: four steps of
//! the largest coordinate, as the picture shows them.
//!
//! Costs a hierarchy over all the scene's triangles (about 100 bytes each) and over every payload that was drawn, kept from frame to
//! frame; a search of O(log n) a pixel. Layered depth images have no surface that anything could be near to: frames that draw them are not
//! measured.

use std::collections::BTreeMap;
use std::sync::Arc;

use farfield_core::bvh::{BoxBvh, TriangleBvh};
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{Block, ChunkId, PayloadRef};
use farfield_core::image::SurfaceImage;
use farfield_core::payload::{Part, Payload, ProjectedPart};
use farfield_core::scene::Scene;
use farfield_core::{Aabb, Camera, Fault};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// What a measured distance may exceed a bound by and not refute it, pixels: rasterisers place vertices on a grid of a 256th, and a
/// bound of half a pixel seen at one depth grows by a thousandth where the other point is nearer.
pub const SURFACE_RESOLUTION_PX: f64 = 1.0 / 64.0;

/// Steps of 32-bit numbers by which positions may be off: placed, stored, taken back from depth, searched.
const STEPS: f32 = 4.0;

/// Triangles, points or lines that are drawn together, local frame.
pub struct Piece {
    /// Points and lines are triangles without area.
    triangles: TriangleBvh,
    /// Of every splat, scene units.
    radius: f32,
    /// The least half width that is drawn, pixels: 0 for triangles.
    half_px: f32,
    bounds: Aabb,
}

impl Piece {
    fn new(positions: &[Vec3], indices: &[u32], radius: f32, half_px: f32) -> Self {
        let triangles = TriangleBvh::build(positions, indices);
        let bounds = triangles.bounds().map_or(Aabb::EMPTY, |b| Aabb { min: b.min - radius, max: b.max + radius });
        Self { triangles, radius, half_px, bounds }
    }

    /// Of a placed chunk.
    ///
    /// # Errors
    /// What reading the geometry gives.
    pub fn of_chunk(scene: &Scene, chunk: ChunkId) -> Result<Self, Fault> {
        let placed = &scene.chunks[chunk.index()];
        let placement = scene.objects[placed.object.index()].placement;
        let mut out = None;
        scene.geometry.with(placed.source, &mut |c| {
            let at = |p: &Vec3| placement.transform_point3(p.as_dvec3()).as_vec3();
            out = Some(Self::new(&c.positions.iter().map(at).collect::<Vec<_>>(), &c.indices, 0.0, 0.0));
        })?;
        out.ok_or_else(|| Fault::Data { place: format!("{chunk:?}"), cause: "its triangles were not read".into() })
    }

    /// Of a part of a payload; `None` where that is nothing that could be near.
    pub fn of_part(origin: DVec3, part: &Part) -> Option<Self> {
        let local = |p: &[Vec3]| p.iter().map(|p| (origin + p.as_dvec3()).as_vec3()).collect::<Vec<_>>();
        Some(match part {
            Part::Mesh(m) | Part::Projected(ProjectedPart { mesh: m, .. }) => {
                Self::new(&local(&m.positions), &m.indices, 0.0, 0.0)
            }
            Part::Points(p) => {
                let each: Vec<u32> = (0..p.positions.len() as u32).flat_map(|i| [i; 3]).collect();
                Self::new(&local(&p.positions), &each, p.radius, 0.5)
            }
            Part::Lines(l) => {
                let each: Vec<u32> = l.indices.chunks_exact(2).flat_map(|l| [l[0], l[1], l[1]]).collect();
                Self::new(&local(&l.positions), &each, 0.0, 0.5)
            }
            Part::Layered(_) | Part::Atlas(_) => return None,
        })
    }
}

/// A place of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// On the triangle or the line, or the middle of the splat.
    pub point: Vec3,
    /// From it, less the splat's radius; scene units.
    pub distance: f32,
    /// Which piece.
    pub piece: usize,
    /// Which triangle, point or line of the piece.
    pub triangle: u32,
    /// Weights of a triangle's vertices.
    pub weights: [f32; 3],
}

/// Pieces, to search together.
pub struct Surface {
    pieces: Vec<Arc<Piece>>,
    boxes: BoxBvh,
}

impl Surface {
    /// Of some pieces.
    pub fn new(pieces: Vec<Arc<Piece>>) -> Self {
        let boxes = BoxBvh::build(&pieces.iter().map(|p| p.bounds).collect::<Vec<_>>());
        Self { pieces, boxes }
    }

    /// The nearest place; `None` where there is none. O(log n).
    pub fn nearest(&self, p: Vec3) -> Option<Nearest> {
        let mut best: Option<Nearest> = None;
        self.boxes.around(p, f32::INFINITY, |i, limit2| {
            let piece = &self.pieces[i as usize];
            let limit = best.map_or(f32::INFINITY, |b| b.distance);
            let Some(found) = piece.triangles.closest_point(p, (limit + piece.radius).next_up()) else { return };
            let distance = (found.distance - piece.radius).max(0.0);
            if best.is_none_or(|b| distance < b.distance || distance == b.distance && (i as usize) < b.piece) {
                *limit2 = (distance * distance).next_up();
                best = Some(Nearest {
                    point: found.point,
                    distance,
                    piece: i as usize,
                    triangle: found.triangle,
                    weights: found.weights,
                });
            }
        });
        best
    }

    /// How far from its point the pixels reach that show what was found, pixels; `px` are those of a scene unit there.
    fn reach_px(&self, found: &Nearest, px: f32) -> f32 {
        let piece = &self.pieces[found.piece];
        std::f32::consts::SQRT_2 * piece.half_px.max(piece.radius * px)
    }
}

/// The original surface, and pieces of what is drawn, made once.
pub struct Pieces {
    chunks: Arc<[Arc<Piece>]>,
    payloads: BTreeMap<(PayloadRef, u16), Option<Arc<Piece>>>,
}

impl Pieces {
    /// Of all of a scene, in parallel. O(n log n), all of it in memory.
    ///
    /// # Errors
    /// What reading the geometry gives.
    pub fn new(scene: &Scene) -> Result<Self, Fault> {
        let all = (0..scene.chunks.len() as u32).into_par_iter();
        let chunks: Vec<_> = all.map(|c| Piece::of_chunk(scene, ChunkId(c)).map(Arc::new)).collect::<Result<_, _>>()?;
        Ok(Self { chunks: chunks.into(), payloads: BTreeMap::new() })
    }

    /// The surface of some chunks.
    pub fn of_chunks(&self, chunks: impl IntoIterator<Item = ChunkId>) -> Surface {
        Surface::new(chunks.into_iter().filter_map(|c| self.chunks.get(c.index()).cloned()).collect())
    }

    /// The surface of the scene.
    pub fn original(&self) -> Surface {
        Surface::new(self.chunks.to_vec())
    }

    /// The same scene for another pipeline, whose payloads are others.
    pub fn for_another(&self) -> Self {
        Self { chunks: self.chunks.clone(), payloads: BTreeMap::new() }
    }

    /// What was drawn; `None` where part of it has no surface.
    ///
    /// # Errors
    /// What `fetch` gives, which reads payloads.
    pub fn drawn(
        &mut self,
        draws: &[Draw],
        fetch: &dyn Fn(Block) -> Result<Payload, Fault>,
    ) -> Result<Option<Surface>, Fault> {
        let mut out = vec![];
        for d in draws {
            match &d.what {
                DrawWhat::Chunks(set) => out.extend(set.iter().filter_map(|c| self.chunks.get(c.index()).cloned())),
                &DrawWhat::Payload { id, part, .. } => {
                    if !self.payloads.contains_key(&(id, part)) {
                        let payload = fetch(Block::Payload(id))?;
                        for (i, p) in (0u16..).zip(&payload.parts) {
                            self.payloads.insert((id, i), Piece::of_part(payload.origin, p).map(Arc::new));
                        }
                    }
                    match self.payloads.get(&(id, part)) {
                        Some(Some(piece)) => out.push(piece.clone()),
                        _ => return Ok(None),
                    }
                }
            }
        }
        Ok(Some(Surface::new(out)))
    }
}

/// The distances of a frame, pixels, from the least to the largest: of every pixel of the candidate that shows a surface, then of the
/// reference, infinite where there is nothing to be near to.
///
/// # Panics
/// When the two, or the camera, differ in size.
pub fn surface_distances(
    camera: &Camera,
    [reference, candidate]: [&SurfaceImage; 2],
    original: &Surface,
    drawn: &Surface,
) -> Vec<f32> {
    assert!(reference.size == camera.size && candidate.size == camera.size, "surfaces of different size are compared");
    let pixels = 0..camera.size[0] as usize * camera.size[1] as usize;
    let way = |image: &SurfaceImage, shown: Option<&Surface>, to: &Surface| -> Vec<f32> {
        let one = |i: usize| image.hit(i).then(|| distance(camera, i, image.depth[i], shown, to));
        pixels.clone().into_par_iter().filter_map(one).collect()
    };
    let mut all = way(candidate, Some(drawn), original);
    all.extend(way(reference, None, drawn));
    all.sort_by(f32::total_cmp);
    all
}

/// Of pixel `i`, which shows something of `shown` at a depth.
fn distance(camera: &Camera, i: usize, depth: f32, shown: Option<&Surface>, to: &Surface) -> f32 {
    let at = [i % camera.size[0] as usize, i / camera.size[0] as usize].map(|c| c as f32 + 0.5);
    let ray = camera.ray(at[0], at[1]);
    let point = (camera.eye + ray.as_dvec3() * f64::from(depth)).as_vec3();
    let px = camera.px_per_tan() / depth;
    // What a length in any direction is stretched by beside the picture's middle: 1 / cos^2.
    let stretch = ray.length_squared();
    let steps = STEPS * f32::EPSILON * point.abs().max_element() * px * stretch;
    let reach = shown.and_then(|s| s.nearest(point).map(|n| s.reach_px(&n, px))).unwrap_or(0.0);
    let Some(found) = to.nearest(point) else { return f32::INFINITY };
    // Of a splat the nearest place of its sphere.
    let off = found.point - point;
    let found = point + off.normalize_or_zero() * found.distance;
    let Some(image) = camera.project((found.as_dvec3() - camera.eye).as_vec3()) else { return f32::INFINITY };
    ((image.x - at[0]).hypot(image.y - at[1]) - reach - steps).max(0.0)
}

/// The distances of a frame in short.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceErrors {
    /// The largest, pixels.
    pub max_px: f64,
    /// The 99.9th percentile, pixels.
    pub p999_px: f64,
    /// Of the pixels, those beyond what the far field claims; 0 where it claims nothing.
    pub beyond: u64,
    /// Pixels looked at, of both pictures.
    pub pixels: u64,
}

impl SurfaceErrors {
    /// Of sorted distances, held against a claim.
    pub fn of(sorted: &[f32], claimed_px: Option<f64>) -> Self {
        let within = |&d: &f32| claimed_px.is_none_or(|c| f64::from(d) <= c + SURFACE_RESOLUTION_PX);
        let rank = (0.999 * sorted.len() as f64).ceil() as usize;
        Self {
            max_px: sorted.last().copied().unwrap_or(0.0).into(),
            p999_px: sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0).into(),
            beyond: (sorted.len() - sorted.partition_point(within)) as u64,
            pixels: sorted.len() as u64,
        }
    }

    /// Of two frames: the larger values, the pixels of both.
    pub fn joined(self, other: Self) -> Self {
        Self {
            max_px: self.max_px.max(other.max_px),
            p999_px: self.p999_px.max(other.p999_px),
            beyond: self.beyond + other.beyond,
            pixels: self.pixels + other.pixels,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::id::{AssetId, LocalPayload};
    use farfield_core::payload::{LinesPart, MeshPart, PointsPart};

    /// A square of 2 x 2 units that faces +z, at a height.
    fn square(z: f32) -> Part {
        let positions = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, z));
        Part::Mesh(MeshPart {
            positions: positions.to_vec(),
            normals: vec![Vec3::Z; 4],
            albedo: vec![[9; 4]; 4],
            indices: vec![0, 1, 2, 0, 2, 3],
            two_sided: false,
        })
    }

    fn points(at: Vec3, radius: f32) -> Part {
        let (normals, albedo) = (vec![Vec3::Z], vec![[9; 4]]);
        Part::Points(PointsPart { positions: vec![at], normals, albedo, radius, two_sided: false })
    }

    fn surface(parts: &[Part]) -> Surface {
        Surface::new(parts.iter().filter_map(|p| Piece::of_part(DVec3::ZERO, p).map(Arc::new)).collect())
    }

    /// From (0, 0, 11), 100 pixels a unit tangent.
    fn camera() -> Camera {
        let camera = Camera::looking(DVec3::Z * 11.0, -Vec3::Z, Vec3::Y, 1.0, [40, 40], 0.1);
        Camera { left: -0.2, right_tan: 0.2, bottom: -0.2, top: 0.2, ..camera }
    }

    /// All pixels at one depth.
    fn flat(depth: f32) -> SurfaceImage {
        let object = vec![u32::from(depth.is_finite()); 1600];
        SurfaceImage { size: [40, 40], object, depth: vec![depth; 1600], ..Default::default() }
    }

    fn close(a: f32, b: f32) -> bool {
        (a - b).abs() < 2e-3
    }

    #[test]
    fn a_surface_that_is_shown_beside_the_original_is_as_far_as_the_picture_shows() {
        // At the square's depth, 11, the picture spans 4.4 units, of which the square covers 2.
        let (original, none) = (surface(&[square(0.0)]), flat(f32::INFINITY));
        let all = surface_distances(&camera(), [&none, &flat(11.0)], &original, &original);
        assert!(all.len() == 1600 && all[0] == 0.0 && all.is_sorted());
        // The corner pixel's centre lies 0.195 unit tangents from the middle in x and in y.
        let beside = (0.195 * 11.0 - 1.0) / 11.0 * 100.0;
        assert!(close(all[1599], beside * 2f32.sqrt()), "{}", all[1599]);
        // Off along the ray is off by nothing in the middle, and aside by the tangent's part.
        let all = surface_distances(&camera(), [&none, &flat(10.0)], &original, &original);
        let corner = 0.195f32 * 10.0;
        let aside = (0.195 - corner.min(1.0) / 11.0) * 100.0;
        assert!(close(all[1599], aside * 2f32.sqrt()) && all[0] < 0.1, "{}", all[1599]);
    }

    #[test]
    fn what_the_reference_shows_counts_from_what_was_drawn() {
        // The reference shows the square alone: 18 x 18 pixels.
        let (original, none, mut seen) = (surface(&[square(0.0)]), flat(f32::INFINITY), flat(11.0));
        for (i, o) in seen.object.iter_mut().enumerate() {
            *o = u32::from((11..29).contains(&(i % 40)) && (11..29).contains(&(i / 40)));
        }
        // Half of the square is missing: from the pixels farthest to the right it is 8.5 pixels to where it ends.
        let Part::Mesh(mut half) = square(0.0) else { panic!() };
        half.positions.iter_mut().for_each(|p| p.x = p.x.min(0.0));
        let half = surface(&[Part::Mesh(half)]);
        let worst = |drawn: &Surface| *surface_distances(&camera(), [&seen, &none], &original, drawn).last().unwrap();
        assert!(close(worst(&half), 8.5) && worst(&original) == 0.0, "{}", worst(&half));
        assert_eq!(worst(&surface(&[])), f32::INFINITY);
        assert!(surface_distances(&camera(), [&none, &none], &original, &half).is_empty());
    }

    #[test]
    fn a_splat_may_be_off_by_its_square_and_stands_for_its_sphere() {
        // One unit of radius, 1 beside the square: the square's edge is a unit from the middle of the splat.
        let (original, splat) = (surface(&[square(0.0)]), surface(&[points(Vec3::new(2.0, 0.0, 0.0), 1.0)]));
        let found = splat.nearest(Vec3::ZERO).unwrap();
        assert!((found.distance, found.point) == (1.0, Vec3::new(2.0, 0.0, 0.0)));
        assert_eq!(splat.nearest(Vec3::new(1.5, 0.5, 0.0)).unwrap().distance, 0.0);
        // Of the reference's picture: from the corner, 2.145 units from the middle in x and y, to the sphere, on the line to its middle.
        let (none, seen) = (flat(f32::INFINITY), flat(11.0));
        let all = surface_distances(&camera(), [&seen, &none], &original, &splat);
        let farthest = (4.145f32.hypot(2.145) - 1.0) * 100.0 / 11.0;
        assert!(close(all[1599], farthest), "{} for {farthest}", all[1599]);
        // Of the candidate's: what is less than the splat's half diagonal beside the original is right.
        let all = surface_distances(&camera(), [&none, &seen], &original, &splat);
        let beyond = ((2.145 - 1.0) - 1.0) * 2f32.sqrt() * 100.0 / 11.0;
        assert!(all[0] == 0.0 && close(all[1599], beyond), "{} for {beyond}", all[1599]);
        // A smaller one beside a larger is not nearer for it.
        let both = surface(&[points(Vec3::X * 3.0, 0.1), points(Vec3::X * 4.0, 2.5), square(-9.0)]);
        assert!((both.nearest(Vec3::ZERO).unwrap().piece, both.nearest(Vec3::ZERO).unwrap().distance) == (1, 1.5));
    }

    #[test]
    fn lines_are_near_along_their_length_and_layers_are_no_surface() {
        let line = Part::Lines(LinesPart {
            positions: vec![Vec3::ZERO, Vec3::X * 4.0],
            normals: vec![Vec3::Z; 2],
            albedo: vec![[9; 4]; 2],
            indices: vec![0, 1],
        });
        let found = surface(&[line]).nearest(Vec3::new(3.0, 2.0, 0.0)).unwrap();
        assert!(found.point.distance(Vec3::X * 3.0) < 1e-6 && found.distance == 2.0);
        let id = PayloadRef { asset: AssetId(0), id: LocalPayload(3) };
        let mut pieces = Pieces { chunks: Arc::new([]), payloads: BTreeMap::new() };
        let draw =
            |part| [Draw { what: DrawWhat::Payload { id, part, object: 1 }, bounds: Aabb::EMPTY, error_px: 0.0 }];
        let fetch = |_: Block| {
            let parts = vec![square(0.0), Part::Atlas(Default::default())];
            Ok(Payload { origin: DVec3::Z * 5.0, bounds: Aabb::EMPTY, parts })
        };
        let drawn = pieces.drawn(&draw(0), &fetch).unwrap().unwrap();
        assert_eq!(drawn.nearest(Vec3::Z * 7.0).unwrap().distance, 2.0);
        assert!(pieces.drawn(&draw(1), &fetch).unwrap().is_none());
        // Kept: nothing is read twice.
        assert!(pieces.drawn(&draw(0), &|_| Err(Fault::Cancelled)).unwrap().is_some());
    }

    #[test]
    fn frames_in_short() {
        let sorted: Vec<f32> = (0..2000).map(|i| i as f32 / 2000.0).collect();
        let e = SurfaceErrors::of(&sorted, Some(0.5));
        assert_eq!((e.pixels, e.p999_px, e.max_px), (2000, f64::from(sorted[1997]), f64::from(sorted[1999])));
        // Those above 0.5 + 1 / 64.
        assert_eq!(e.beyond, 2000 - 1032);
        assert_eq!((SurfaceErrors::of(&sorted, None).beyond, SurfaceErrors::of(&[], Some(0.5)).max_px), (0, 0.0));
        let joined = e.joined(SurfaceErrors { max_px: 3.0, p999_px: 0.1, beyond: 2, pixels: 4 });
        assert_eq!((joined.max_px, joined.beyond, joined.pixels), (3.0, e.beyond + 2, 2004));
    }
}
