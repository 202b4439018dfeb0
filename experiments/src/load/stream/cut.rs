//! A mesh in temporary files to chunks: the chunks of `core::scene::cut`, bit for bit and in the same order.
//!
//! A mesh that fits is put together and cut in memory. Another is welded ([`super::weld`]) and its triangles are divided on disk,
//! three levels of the octree at a pass, until a cell fits; that is put together with its names and normals and cut from there
//! on. Triangles keep their numbers, so that cells that were apart on disk come back in the file's order.
//! O(n log n) in passes over files.

use std::io;
use std::ops::Range;

use farfield_core::Aabb;
use farfield_core::id::MaterialId;
use farfield_core::mesh::{ChunkMesh, MeshChunk, TriangleMesh};
use farfield_core::scene::{Cell, Cutter, MAX_CHUNK_TRIANGLES, centroid, cut};
use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::array::Places;
use super::intake::{Intake, Mesh};
use super::spill::Spill;
use super::weld::{Welded, weld};
use crate::chunks::Writer;
use crate::load::merge;
use crate::load::sink::Corner;

/// Levels of the octree that one pass divides.
const LEVELS: u32 = 3;
/// Cells of one pass.
const CELLS: usize = 1 << (3 * LEVELS);

/// Turns x round.
pub(super) const MIRROR: DAffine3 = DAffine3::from_cols(DVec3::new(-1.0, 0.0, 0.0), DVec3::Y, DVec3::Z, DVec3::ZERO);

/// Gets a batch of triangles and the number of the first.
type Each<'f, C> = dyn FnMut(u64, &[[C; 3]]) -> io::Result<()> + 'f;

/// Triangles of one material, as ranges of the intake's.
pub(super) struct Section {
    material: u32,
    runs: Vec<Range<u64>>,
}

/// One mesh of an intake.
pub(super) struct Scope<'a, 'i, C> {
    pub(super) intake: &'a Intake<'i, C>,
    pub(super) mesh: &'a Mesh,
    /// What positions are relative to.
    pub(super) origin: DVec3,
    /// Whether x is turned round, as placements that mirror need it.
    pub(super) mirrored: bool,
}

impl<C: Corner> Scope<'_, '_, C> {
    /// Writes the mesh's chunks; returns their descriptions and how many positions differ.
    pub(super) fn write(&self, writer: &mut Writer) -> io::Result<(Vec<MeshChunk>, u32)> {
        let sections = self.sections();
        if self.mesh.triangles() <= self.intake.work.batch as u64 {
            let whole = self.whole(&sections)?;
            let made = cut(whole, MAX_CHUNK_TRIANGLES);
            made.chunks.iter().try_for_each(|c| writer.chunk(c))?;
            return Ok((made.infos, made.vertex_ids));
        }
        let welded = weld(self, &sections, self.mesh.normals_missing)?;
        let mut infos = vec![];
        let mut emit = |info: MeshChunk, chunk: ChunkMesh| {
            infos.push(info);
            writer.chunk(&chunk)
        };
        for s in &sections {
            let mut bounds = Aabb::EMPTY;
            self.batches(s, &mut |_, corners| {
                bounds = self.centroids(corners)?.into_iter().fold(bounds, |b, c| b.union(Aabb::of([c])));
                Ok(())
            })?;
            self.divide(s, &welded, Cell::root(bounds), &mut emit)?;
        }
        Ok((infos, welded.count))
    }

    fn sections(&self) -> Vec<Section> {
        let mut out: Vec<Section> = vec![];
        for (material, range) in &self.mesh.runs {
            match out.iter_mut().find(|s| s.material == *material) {
                Some(s) => s.runs.push(range.clone()),
                None => out.push(Section { material: *material, runs: vec![range.clone()] }),
            }
        }
        out.sort_by_key(|s| s.material);
        out
    }

    /// A position as it is in the mesh, but for mirroring.
    pub(super) fn place(&self, p: [f64; 3]) -> Vec3 {
        (DVec3::from(p) - self.origin).as_vec3()
    }

    /// Whether area vectors are those of the mirrored mesh: normals that the file gives in part are made before it is mirrored.
    pub(super) fn areas_mirrored(&self) -> bool {
        self.mirrored && !self.mesh.normals_given
    }

    /// A section's triangles, a batch at a time, with the number of the first in the section.
    pub(super) fn batches(&self, section: &Section, f: &mut Each<'_, C>) -> io::Result<()> {
        let (most, mut held, mut number) = (self.intake.work.batch as u64, vec![], 0);
        for run in &section.runs {
            let mut at = run.start;
            while at < run.end {
                let end = run.end.min(at + most - held.len() as u64);
                held.extend(self.intake.triangles.read(at..end)?);
                at = end;
                self.intake.work.go_on()?;
                if held.len() as u64 == most {
                    f(number, &held)?;
                    number += most;
                    held.clear();
                }
            }
        }
        if held.is_empty() { Ok(()) } else { f(number, &held) }
    }

    /// The positions of some triangles, not mirrored.
    pub(super) fn positions(&self, corners: &[[C; 3]]) -> io::Result<(Places, Vec<Vec3>)> {
        let places = Places::of(corners.as_flattened().iter().map(|c| c.position()).collect());
        let all = self.intake.positions.gather(&places)?.into_iter().map(|p| self.place(p)).collect();
        Ok((places, all))
    }

    /// What triangles count as in the octree.
    fn centroids(&self, corners: &[[C; 3]]) -> io::Result<Vec<Vec3>> {
        let (places, positions) = self.positions(corners)?;
        let of = |t: &[C; 3]| centroid(self.turned(*t).map(|c| self.mirror(positions[places.slot(c.position())])));
        Ok(corners.iter().map(of).collect())
    }

    /// As merging meshes does it, to the sign of zero.
    pub(super) fn mirror(&self, v: Vec3) -> Vec3 {
        if self.mirrored { MIRROR.transform_point3(v.as_dvec3()).as_vec3() } else { v }
    }

    /// A mirrored triangle is turned so that it stays counter-clockwise.
    pub(super) fn turned<T: Copy>(&self, [a, b, c]: [T; 3]) -> [T; 3] {
        if self.mirrored { [a, c, b] } else { [a, b, c] }
    }

    fn divide(
        &self,
        section: &Section,
        welded: &Welded,
        root: Cell,
        emit: &mut dyn FnMut(MeshChunk, ChunkMesh) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut spill = self.spill()?;
        self.batches(section, &mut |first, corners| {
            let records = corners.iter().zip(first..).map(|(&t, n)| C::pack(t, n as u32)).collect::<Vec<_>>();
            self.sort_out(root, &records, &mut spill)
        })?;
        spill.finish()?;
        let all = Cells { scope: self, welded, material: MaterialId(section.material), spill };
        all.cut(root, 0..CELLS, emit)
    }

    fn spill(&self) -> io::Result<Spill<C::Record>> {
        Spill::new(self.intake.work.folder, CELLS, self.intake.work.memory_bytes / 8)
    }

    /// Appends triangles to the cells [`LEVELS`] below `cell`.
    fn sort_out(&self, cell: Cell, records: &[C::Record], spill: &mut Spill<C::Record>) -> io::Result<()> {
        let corners: Vec<[C; 3]> = records.iter().map(|&r| C::unpack(r).0).collect();
        for (&r, p) in records.iter().zip(self.centroids(&corners)?) {
            let (mut at, mut number) = (cell, 0);
            for _ in 0..LEVELS {
                let octant = at.octant(p);
                number = number << 3 | octant;
                at = at.child(octant);
            }
            spill.push(number, r)?;
        }
        Ok(())
    }

    /// The whole mesh, as it would have been loaded.
    fn whole(&self, sections: &[Section]) -> io::Result<TriangleMesh> {
        let mut corners = vec![];
        let mut parts = vec![];
        for s in sections {
            let start = 3 * corners.len() as u32;
            for r in &s.runs {
                corners.extend(self.intake.triangles.read(r.clone())?);
            }
            parts.push((start..3 * corners.len() as u32, MaterialId(s.material)));
        }
        let unique = Unique::of(&corners);
        // Vertices are numbered by first use; those that no triangle uses are dropped.
        let mut new = vec![u32::MAX; unique.corners.len()];
        let (mut used, mut indices) = (vec![], vec![]);
        for &c in corners.as_flattened() {
            let slot = unique.slot(c);
            if new[slot] == u32::MAX {
                new[slot] = used.len() as u32;
                used.push(slot);
            }
            indices.push(new[slot]);
        }
        let of = |slots: &[usize]| slots.iter().map(|&s| unique.corners[s]).collect::<Vec<C>>();
        let (mut mesh, normals) = self.vertices(&of(&used))?;
        (mesh.indices, mesh.sections) = (indices, parts);
        if self.mesh.normals_given {
            if self.mesh.normals_missing {
                mesh.smooth_normals();
            } else {
                mesh.normals = vec![Vec3::Y; normals.len()];
            }
            mesh.normals.iter_mut().zip(normals).for_each(|(n, given)| *n = given.unwrap_or(*n));
        }
        Ok(if self.mirrored { merge(&[(&mesh, MIRROR)]) } else { mesh })
    }

    /// Vertices with their attributes, and the normals that they have of their own. Not mirrored.
    fn vertices(&self, corners: &[C]) -> io::Result<(TriangleMesh, Vec<Option<Vec3>>)> {
        let (intake, mut out) = (self.intake, TriangleMesh::default());
        let at = Places::of(corners.iter().map(|c| c.position()).collect());
        let positions = intake.positions.gather(&at)?;
        out.positions = corners.iter().map(|c| self.place(positions[at.slot(c.position())])).collect();
        if let Some(colors) = intake.colors.array.as_ref().filter(|_| self.mesh.colors) {
            let all = colors.gather(&at)?;
            out.colors =
                corners.iter().map(|c| all[at.slot(c.position())]).map(|[r, g, b, _]| [r, g, b, 255]).collect();
        }
        if let Some(uvs) = intake.uvs.array.as_ref().filter(|_| self.mesh.uvs) {
            let at = Places::of(corners.iter().filter_map(|c| c.uv()).collect());
            let all = uvs.gather(&at)?;
            let uv = |c: &C| c.uv().map(|i| Vec2::from(all[at.slot(i)])).filter(|uv| uv.is_finite());
            out.uvs = corners.iter().map(|c| uv(c).unwrap_or_default()).collect();
        }
        let mut given = vec![None; corners.len()];
        if let Some(normals) = intake.normals.array.as_ref().filter(|_| self.mesh.normals_given) {
            let at = Places::of(corners.iter().filter_map(|c| c.normal()).collect());
            let all = normals.gather(&at)?;
            let normal = |c: &C| c.normal().and_then(|i| Vec3::from(all[at.slot(i)]).try_normalize());
            given = corners.iter().map(normal).collect();
        }
        Ok((out, given))
    }

    /// Triangles of a cell with their names and normals, to be cut.
    fn part(&self, corners: &[[C; 3]], welded: &Welded) -> io::Result<(TriangleMesh, Vec<u32>)> {
        let unique = Unique::of(corners);
        let (mut mesh, given) = self.vertices(&unique.corners)?;
        let (names, smooth) = welded.of(&unique.corners.iter().map(|c| c.position()).collect::<Vec<u32>>())?;
        mesh.normals = smooth.iter().zip(given).map(|(s, g)| g.unwrap_or(*s)).collect();
        if self.mirrored {
            mesh.positions.iter_mut().for_each(|p| *p = self.mirror(*p));
            // Where the file gives none, they are made of what is mirrored already.
            if self.mesh.normals_given {
                let turn = MIRROR.matrix3.inverse().transpose();
                let turned = |n: Vec3| (turn * n.as_dvec3()).try_normalize().map_or(Vec3::Y, |n| n.as_vec3());
                mesh.normals.iter_mut().for_each(|n| *n = turned(*n));
            }
        }
        mesh.indices = corners.iter().flat_map(|t| self.turned(*t).map(|c| unique.slot(c) as u32)).collect();
        Ok((mesh, names))
    }
}

/// Cells of a section, on disk.
struct Cells<'s, 'a, 'i, C: Corner> {
    scope: &'s Scope<'a, 'i, C>,
    welded: &'s Welded,
    material: MaterialId,
    spill: Spill<C::Record>,
}

impl<C: Corner> Cells<'_, '_, '_, C> {
    /// Cuts a cell that has been divided into these sequences of the spill.
    fn cut(
        &self,
        cell: Cell,
        cells: Range<usize>,
        emit: &mut dyn FnMut(MeshChunk, ChunkMesh) -> io::Result<()>,
    ) -> io::Result<()> {
        let count: u64 = cells.clone().map(|i| self.spill.len(i)).sum();
        if count == 0 {
            return Ok(());
        }
        let most = self.scope.intake.work.batch;
        if count <= most as u64 {
            let mut records = vec![];
            cells.into_iter().try_for_each(|i| self.spill.read(i, &mut records))?;
            records.sort_unstable_by_key(|&r| C::unpack(r).1);
            return self.finish(cell, &records, emit);
        }
        if cells.len() > 1 {
            let step = cells.len() / 8;
            return (0..8).try_for_each(|i| {
                let start = cells.start + i * step;
                self.cut(cell.child(i), start..start + step, emit)
            });
        }
        if cell.depth >= Cell::MAX_DEPTH {
            // Cut by number: whole chunks at a time.
            let most = most / MAX_CHUNK_TRIANGLES * MAX_CHUNK_TRIANGLES;
            return self.spill.batches(cells.start, most, &mut |records| self.finish(cell, &records, emit));
        }
        let mut spill = self.scope.spill()?;
        self.spill.batches(cells.start, most, &mut |r| self.scope.sort_out(cell, &r, &mut spill))?;
        spill.finish()?;
        let below = Cells { scope: self.scope, welded: self.welded, material: self.material, spill };
        below.cut(cell, 0..CELLS, emit)
    }

    fn finish(
        &self,
        cell: Cell,
        records: &[C::Record],
        emit: &mut dyn FnMut(MeshChunk, ChunkMesh) -> io::Result<()>,
    ) -> io::Result<()> {
        let corners: Vec<[C; 3]> = records.iter().map(|&r| C::unpack(r).0).collect();
        let (mesh, names) = self.scope.part(&corners, self.welded)?;
        let mut done = Ok(());
        let all = (0..corners.len() as u32).collect();
        Cutter::new(&mesh, &names, MAX_CHUNK_TRIANGLES).cut(cell, all, self.material, &mut |info, chunk| {
            if done.is_ok() {
                done = emit(info, chunk);
            }
        });
        done
    }
}

/// The different corners of some triangles, and perhaps more.
struct Unique<C> {
    corners: Vec<C>,
    /// The first position, where corners are all positions of a range.
    first: Option<u32>,
}

impl<C: Corner> Unique<C> {
    fn of(triangles: &[[C; 3]]) -> Self {
        let all = triangles.as_flattened();
        let ends = Places::of(all.iter().map(|c| c.position()).collect());
        if let Places::Range(r) = &ends
            && let Some(corners) = C::all(r.clone())
        {
            return Self { corners, first: Some(r.start) };
        }
        let mut corners = all.to_vec();
        corners.sort_unstable();
        corners.dedup();
        Self { corners, first: None }
    }

    fn slot(&self, c: C) -> usize {
        match self.first {
            Some(first) => (c.position() - first) as usize,
            None => self.corners.binary_search(&c).expect("one of the corners"),
        }
    }
}
