//! The unseen solid angle: from a random viewpoint of a cell, all round.
//!
//! Six pictures of a cube show the original far chunks alone, and what the far field draws alone. A pixel is unseen where the first show a
//! surface and the second show nothing, or something farther away by more than [`DEPTH_OFF`]; its solid angle counts whole. So along an
//! outline the measurement is off by about half a pixel. Surfaces that stand *before* the right one (skins) hide nothing of the
//! far field's own and are not unseen here: the depth metric of pictures finds them. A face that another cell serves does not count.

use farfield_core::backend::Backend;
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::panorama::pixel_solid_angle_sr;
use farfield_core::{Camera, Fault};
use glam::DVec3;
use rand::{Rng, RngExt};

use super::{CANDIDATE, CellAudit, REFERENCE, SERVED_TRIES};
use crate::measure::DEPTH_OFF;

/// Edge of a cube's picture, pixels.
pub(super) const FACE_PX: u32 = 128;
/// The solid angle of a pixel in the middle of a face, (2 / 128)^2: less cannot be told from nothing.
pub(super) const RESOLUTION_SR: f64 = 4.0 / (FACE_PX as f64 * FACE_PX as f64);

impl CellAudit<'_> {
    /// From one viewpoint, steradians; `None` where the cell serves no picture of any that was tried.
    pub(super) fn unseen_solid_angle(
        &self,
        backend: &mut dyn Backend,
        rng: &mut impl Rng,
    ) -> Result<Option<f64>, Fault> {
        let mine = |c: &Camera| self.cells.find(c) == Some(self.cell.outline.id);
        for _ in 0..SERVED_TRIES {
            let Some(eye) = self.cell.outline.region.sample(std::array::from_fn(|_| rng.random())) else {
                return Ok(None);
            };
            let cube = self.cube(eye.as_dvec3());
            let served: Vec<&Camera> = cube.iter().filter(|c| mine(c)).collect();
            if served.is_empty() {
                continue;
            }
            let all = served.into_iter().map(|c| self.unseen_in(backend, c));
            return all.sum::<Result<f64, Fault>>().map(Some);
        }
        Ok(None)
    }

    fn cube(&self, eye: DVec3) -> [Camera; 6] {
        Camera::cube(eye, FACE_PX, self.views.near)
    }

    fn unseen_in(&self, backend: &mut dyn Backend, camera: &Camera) -> Result<f64, Fault> {
        let split = self.cells.active(self.cell, camera).split;
        let far = self.scene.cull(&self.cell.splits[split.index()].far, camera);
        let reference = vec![Draw { what: DrawWhat::Chunks(far), bounds: self.scene.bounds, error_px: 0.0 }];
        let pass = |writes, draws| Pass { kind: PassKind::Surface, camera: *camera, writes, draws };
        let passes = vec![pass(REFERENCE, reference), pass(CANDIDATE, (self.draws)(camera))];
        backend.render(&DrawList { passes })?;
        let (r, c) = (backend.read_surface(REFERENCE)?, backend.read_surface(CANDIDATE)?);
        let unseen = |i: usize| r.hit(i) && !(c.hit(i) && c.depth[i] <= r.depth[i] * (1.0 + DEPTH_OFF));
        let [w, h] = r.size;
        let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
        Ok(pixels.filter(|&(x, y)| unseen(r.at(x, y))).map(|(x, y)| pixel_solid_angle_sr(camera, x, y)).sum())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use farfield_core::backend::BlockData;
    use farfield_core::camera::ViewModel;
    use farfield_core::cell::Cell;
    use farfield_core::claim::{Claim, Quantity};
    use farfield_core::context::{Context, Forget, Serial};
    use farfield_core::id::{AssetId, Block, CellId, ChunkId, MaterialId};
    use farfield_core::mesh::TriangleMesh;
    use farfield_core::scene::{ChunkSet, Material, Placement, Scene, SceneBuilder};
    use farfield_core::strategy::{Cells, Partition};
    use farfield_cpu::{CpuBackend, CpuOptions};
    use farfield_strategies::partition_single_cell::SingleCell;
    use glam::{DAffine3, DVec3, Vec3};

    use super::*;
    use crate::audit::{Measured, join};
    use crate::build::NoCapture;

    /// A ball of radius 1 of flat triangles, seen from outside.
    fn ball(n: u32) -> TriangleMesh {
        let mut m = TriangleMesh::default();
        for r in 0..=n {
            for s in 0..2 * n {
                let (p, a) = (f64::from(r), f64::from(s));
                let (p, a) = (p * std::f64::consts::PI / f64::from(n), a * std::f64::consts::PI / f64::from(n));
                m.positions.push(DVec3::new(p.sin() * a.cos(), p.cos(), p.sin() * a.sin()).as_vec3());
                let at = |r: u32, s: u32| r * 2 * n + s % (2 * n);
                if r < n {
                    m.indices.extend([
                        at(r, s),
                        at(r + 1, s + 1),
                        at(r + 1, s),
                        at(r, s),
                        at(r, s + 1),
                        at(r + 1, s + 1),
                    ]);
                }
            }
        }
        m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
        m
    }

    /// Balls of radius 2, 10 away from the origin along each of `towards`, and one of radius 8 at 30 behind the first.
    fn scene(towards: &[Vec3]) -> Scene {
        let mut b = SceneBuilder::default();
        b.materials.push(Material::default());
        let mesh = b.mesh("ball", ball(40)).unwrap();
        let place = |at: Vec3, size: f64| Placement {
            mesh,
            transform: DAffine3::from_translation(at.as_dvec3()) * DAffine3::from_scale(DVec3::splat(size)),
        };
        towards.iter().for_each(|t| b.place(place(*t * 10.0, 2.0)));
        b.place(place(towards[0] * 30.0, 8.0));
        b.build().unwrap()
    }

    /// Measures what a far field leaves out that draws all far chunks but these objects'.
    fn measured(scene: &Scene, dropped: &[u32], claimed: f64) -> Vec<Measured> {
        let views = ViewModel {
            fov_y_rad: 1.0,
            resolution: [64, 64],
            near: 0.05,
            eye_height: [0.0; 2],
            pitch_rad: [0.0; 2],
            max_speed: 1.0,
            max_turn_rad: 1.0,
        };
        // The world's origin in the scene's local frame; viewpoints within 0.1 of it.
        let middle = (-scene.origin).as_vec3();
        let (lo, hi) = (middle - 0.05, middle + 0.05);
        let go = AtomicBool::new(false);
        let cx = Context { capture: &NoCapture, run: &Serial, memo: &Forget, cancel: &go };
        let region = Some([lo.x, lo.y, lo.z, hi.x, hi.y, hi.z]);
        let cells: Box<dyn Cells> = SingleCell { region }.divide(scene, &views, &cx).unwrap();
        let cell: Cell = cells.inside(CellId(0), scene, &cx).unwrap();
        assert_eq!(cell.splits[0].far.len(), scene.chunks.len());
        let mut backend = CpuBackend::new(scene, CpuOptions::default()).unwrap();
        for id in scene.mesh_chunk_ids() {
            let up = &mut |c: &farfield_core::mesh::ChunkMesh| {
                backend.upload(Block::Chunk(id), &BlockData::Chunk(c)).unwrap();
            };
            scene.geometry.with(id, up).unwrap();
        }
        let kept: ChunkSet = (0..scene.chunks.len() as u32)
            .map(ChunkId)
            .filter(|c| !dropped.contains(&scene.chunks[c.index()].object.0))
            .collect();
        let draws =
            |_: &Camera| vec![Draw { what: DrawWhat::Chunks(kept.clone()), bounds: scene.bounds, error_px: 0.0 }];
        let claim = Claim { quantity: Quantity::UnseenSolidAngle, payload: None, max: claimed };
        let audit = CellAudit {
            truth: None,
            scene,
            views: &views,
            cell: &cell,
            cells: &*cells,
            asset: AssetId(1),
            claims: &[claim],
            draws: &draws,
        };
        audit.sample(&mut backend, 4, 7).unwrap()
    }

    /// 2 pi (1 - cos), sin = radius over distance.
    fn cap(radius: f64, distance: f64) -> f64 {
        std::f64::consts::TAU * (1.0 - (1.0 - (radius / distance).powi(2)).sqrt())
    }

    #[test]
    fn what_a_far_field_drops_is_measured_as_the_solid_angle_that_it_has() {
        let diagonal = Vec3::ONE.normalize();
        for towards in [[Vec3::X, Vec3::Y], [diagonal, -diagonal], [Vec3::new(0.0, 0.7, 0.7).normalize(), Vec3::X]] {
            let scene = scene(&towards);
            // The first ball stands before a larger one, which is farther away; the second before nothing.
            for (dropped, expected) in [
                (vec![], 0.0),
                (vec![0], cap(2.0, 10.0)),
                (vec![0, 1], 2.0 * cap(2.0, 10.0)),
                (vec![0, 2], cap(8.0, 30.0)),
                (vec![2], cap(8.0, 30.0) - cap(2.0, 10.0)),
            ] {
                let found = measured(&scene, &dropped, 1.0);
                assert!(!found.is_empty(), "nothing was measured");
                for m in found {
                    // Viewpoints off the middle by 0.09, pixels along the outline.
                    assert!(
                        (m.measured - expected).abs() <= 0.03 * expected,
                        "{towards:?} without {dropped:?}: {} sr, not {expected}",
                        m.measured
                    );
                }
            }
        }
    }

    #[test]
    fn a_claim_is_violated_by_more_than_a_pixel() {
        let scene = scene(&[Vec3::X, Vec3::Z]);
        let violations = |claimed: f64| {
            let rows = join("far", &measured(&scene, &[1], claimed));
            assert_eq!((rows.len(), rows[0].samples, rows[0].quantity), (1, 4, Quantity::UnseenSolidAngle));
            rows[0].violations
        };
        assert_eq!((violations(0.2), violations(0.1), violations(0.0)), (0, 4, 4));
        let none = join("far", &measured(&scene, &[], 0.0));
        assert_eq!((none[0].violations, none[0].measured_max), (0, 0.0));
    }
}
