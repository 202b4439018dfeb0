//! Taking collapses back: where a cost that looks at the whole ([`Cost::verify`]) finds triangles that are off by more than is allowed, the collapses
//! that made them go, latest first, and with them those that were made on top of them.
//!
//! Every vertex dies once, so a collapse is known by the vertex that died. It can be taken back when the vertices of the triangles that it
//! moved, and the survivor, live: the later deaths among them are taken back before it. O(collapses that go).

use std::collections::BTreeSet;

use super::mesh::LiveMesh;
use super::{Cost, Settings};

/// No vertex.
const NONE: u32 = u32::MAX;

/// What collapses changed.
#[derive(Default)]
pub(super) struct Log {
    /// In the order of time: who died.
    deaths: Vec<u32>,
    /// For each vertex its place in `deaths`.
    of: Vec<u32>,
    /// For each collapse where its records end.
    ends: Vec<u32>,
    records: Vec<Record>,
    /// For each triangle the death that changed it last.
    last: Vec<u32>,
}

/// A triangle as it was.
struct Record {
    triangle: u32,
    corners: [u32; 3],
    last: u32,
}

impl Log {
    pub(super) fn new(mesh: &LiveMesh) -> Self {
        Self { of: vec![NONE; mesh.vertices()], last: vec![NONE; mesh.all_triangles()], ..Self::default() }
    }

    /// `from` is about to die.
    pub(super) fn collapse(&mut self, mesh: &LiveMesh, from: u32) {
        let time = self.deaths.len() as u32;
        for &triangle in mesh.triangles_of(from) {
            let last = std::mem::replace(&mut self.last[triangle as usize], time);
            self.records.push(Record { triangle, corners: mesh.corners(triangle), last });
        }
        self.deaths.push(from);
        self.of[from as usize] = time;
        self.ends.push(self.records.len() as u32);
    }

    fn records(&self, time: u32) -> std::ops::Range<usize> {
        let first = time.checked_sub(1).map_or(0, |before| self.ends[before as usize]);
        first as usize..self.ends[time as usize] as usize
    }

    /// Takes back the collapses at `times` and all that were made on top of them.
    fn take_back(&mut self, mesh: &mut LiveMesh, times: BTreeSet<u32>) {
        let (mut all, mut left) = (times.clone(), Vec::from_iter(times));
        while let Some(time) = left.pop() {
            let survivor = mesh.died_into(self.deaths[time as usize]);
            let corners = self.records[self.records(time)].iter().flat_map(|r| r.corners);
            for v in corners.chain([survivor]) {
                let death = self.of[v as usize];
                if death != NONE && death > time && all.insert(death) {
                    left.push(death);
                }
            }
        }
        for &time in all.iter().rev() {
            for i in self.records(time).rev() {
                let Record { triangle, corners, last } = self.records[i];
                mesh.restore_triangle(triangle, corners);
                self.last[triangle as usize] = last;
            }
            let dead = self.deaths[time as usize];
            mesh.restore_vertex(dead);
            self.of[dead as usize] = NONE;
        }
    }
}

/// Takes collapses back until the cost finds no triangle off by more than `settings` allow. How many are left, and what the whole costs.
pub(super) fn settle<C: Cost + ?Sized>(
    mesh: &mut LiveMesh,
    cost: &mut C,
    log: &mut Log,
    settings: &Settings,
) -> (usize, f32) {
    loop {
        let off = cost.verify(mesh);
        let living = || (0..mesh.all_triangles() as u32).filter(|&t| mesh.is_alive(t));
        let too_far = |off: f32| off.is_nan() || off > settings.max_cost;
        let bad = living().filter(|&t| too_far(off[t as usize])).map(|t| log.last[t as usize]);
        let times: BTreeSet<u32> = bad.filter(|&t| t != NONE).collect();
        if times.is_empty() {
            let left = log.of.iter().filter(|&&time| time != NONE).count();
            let total = living().map(|t| off[t as usize]).fold(0.0, f32::max);
            return (left, total);
        }
        log.take_back(mesh, times);
    }
}
