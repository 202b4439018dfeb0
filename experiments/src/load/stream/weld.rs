//! Names of positions and smooth normals of a mesh that does not fit in memory: those of `core::scene::cut`, bit for bit.
//!
//! A position's name is its rank among the mesh's different positions, by first use. First the vertices are numbered by first
//! use, in one pass over the triangles. Then vertices are spilled by a hash of their position; equal ones meet in one part of
//! the spill, where the one that was used first stands for all. A bit for each that stands for others, counted up to a place,
//! gives the rank. Normals are the sums, by name, of the triangles' area vectors, added in the triangles' order. O(n) in passes
//! over files; in memory, 3/16 of a byte a vertex and what `memory_bytes` allows.

use std::io;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::array::{Array, Places};
use super::cut::{Scope, Section};
use super::spill::Spill;
use crate::load::sink::Corner;

/// Names and, where they are needed, sums of area vectors.
pub(super) struct Welded {
    /// The number of the first position.
    first: u32,
    /// By position, from the first on.
    names: Array<u32>,
    /// How many names there are.
    pub(super) count: u32,
    /// By name.
    sums: Option<Array<[f64; 3]>>,
}

/// Welds a mesh; `smooth` asks for normals too.
pub(super) fn weld<C: Corner>(scope: &Scope<'_, '_, C>, sections: &[Section], smooth: bool) -> io::Result<Welded> {
    let range = scope.mesh.positions.clone();
    let mut order = Array::filled(scope.intake.work.folder, range.len() as u64, u32::MAX)?;
    let mut used = 0;
    for s in sections {
        scope.batches(s, &mut |_, corners| {
            let places = Places::of(corners.as_flattened().iter().map(|c| c.position() - range.start).collect());
            let mut numbers = order.gather(&places)?;
            for c in corners.as_flattened() {
                let n = &mut numbers[places.slot(c.position() - range.start)];
                if *n == u32::MAX {
                    *n = used;
                    used += 1;
                }
            }
            order.scatter(&places, &numbers)
        })?;
    }
    let ranks = stand_ins(scope, &mut order, used)?;
    let count = ranks.count();
    let window = scope.intake.work.batch as u64;
    for at in (0..order.len()).step_by(window as usize) {
        let range = at..(at + window).min(order.len());
        let names: Vec<u32> = order.read(range.clone())?.into_iter().map(|n| ranks.below(n)).collect();
        order.scatter(&Places::Range(range.start as u32..range.end as u32), &names)?;
    }
    let mut out = Welded { first: range.start, names: order, count, sums: None };
    if smooth {
        let mut sums = Array::filled(scope.intake.work.folder, count.into(), [0.0; 3])?;
        for s in sections {
            scope.batches(s, &mut |_, corners| out.add_areas(scope, corners, &mut sums))?;
        }
        out.sums = Some(sums);
    }
    Ok(out)
}

/// Replaces each vertex's number by that of the first used one at its position; returns which numbers stand.
fn stand_ins<C: Corner>(scope: &Scope<'_, '_, C>, order: &mut Array<u32>, used: u32) -> io::Result<Ranks> {
    // A record takes 20 bytes, and as much again while it is sorted and put back.
    let parts = (u64::from(used) * 80).div_ceil(scope.intake.work.memory_bytes).clamp(1, 1 << 12) as usize;
    let mut spill: Spill<[u32; 5]> = Spill::new(scope.intake.work.folder, parts, scope.intake.work.memory_bytes / 8)?;
    let window = scope.intake.work.batch as u64;
    for at in (0..order.len()).step_by(window as usize) {
        let range = at..(at + window).min(order.len());
        let numbers = order.read(range.clone())?;
        let first = u64::from(scope.mesh.positions.start);
        let positions = scope.intake.positions.read(first + range.start..first + range.end)?;
        for (i, (&n, &p)) in numbers.iter().zip(&positions).enumerate().filter(|(_, (n, _))| **n != u32::MAX) {
            // + 0.0: -0 counts as 0.
            let [x, y, z] = (scope.place(p) + Vec3::ZERO).to_array().map(f32::to_bits);
            let hash = (x.wrapping_mul(0x9e37_79b1) ^ y.rotate_left(11).wrapping_mul(0x85eb_ca77))
                .wrapping_add(z.rotate_left(22).wrapping_mul(0xc2b2_ae3d));
            let part = ((u64::from(hash ^ (hash >> 15)) * parts as u64) >> 32) as usize;
            spill.push(part, [x, y, z, n, (at + i as u64) as u32])?;
        }
    }
    spill.finish()?;
    let mut ranks = Ranks::new(used);
    for part in 0..parts {
        let mut all = vec![];
        spill.read(part, &mut all)?;
        all.par_sort_unstable();
        for i in 0..all.len() {
            if i > 0 && all[i][..3] == all[i - 1][..3] {
                all[i][3] = all[i - 1][3];
            } else {
                ranks.set(all[i][3]);
            }
        }
        all.par_sort_unstable_by_key(|r| r[4]);
        let places = Places::List(all.iter().map(|r| r[4]).collect());
        let numbers: Vec<u32> = all.iter().map(|r| r[3]).collect();
        order.scatter(&places, &numbers)?;
    }
    ranks.finish();
    Ok(ranks)
}

impl Welded {
    /// Names at positions, in their order, with the places.
    fn names(&self, positions: impl Iterator<Item = u32>) -> io::Result<(Places, Vec<u32>)> {
        let places = Places::of(positions.map(|p| p - self.first).collect());
        let names = self.names.gather(&places)?;
        Ok((places, names))
    }

    fn add_areas<C: Corner>(
        &self,
        scope: &Scope<'_, '_, C>,
        corners: &[[C; 3]],
        sums: &mut Array<[f64; 3]>,
    ) -> io::Result<()> {
        let (places, positions) = scope.positions(corners)?;
        let (at, names) = self.names(corners.as_flattened().iter().map(|c| c.position()))?;
        let named = |c: C| names[at.slot(c.position() - self.first)];
        let targets = Places::of(corners.as_flattened().iter().map(|&c| named(c)).collect());
        let mut all = sums.gather(&targets)?;
        for t in corners {
            let place = |c: C| positions[places.slot(c.position())];
            let [a, b, c] = match scope.areas_mirrored() {
                true => scope.turned(*t).map(|c| scope.mirror(place(c)).as_dvec3()),
                false => t.map(|c| place(c).as_dvec3()),
            };
            let n = (b - a).cross(c - a);
            if n.is_finite() {
                for &c in t {
                    let sum = &mut all[targets.slot(named(c))];
                    *sum = (DVec3::from(*sum) + n).to_array();
                }
            }
        }
        sums.scatter(&targets, &all)
    }

    /// Names and smooth normals of positions; (0, 1, 0) where normals were not asked for. Positions that no triangle uses have
    /// neither.
    pub(super) fn of(&self, positions: &[u32]) -> io::Result<(Vec<u32>, Vec<Vec3>)> {
        let (places, names) = self.names(positions.iter().copied())?;
        let names: Vec<u32> = positions.iter().map(|p| names[places.slot(p - self.first)]).collect();
        let Some(sums) = &self.sums else { return Ok((names, vec![Vec3::Y; positions.len()])) };
        let at = Places::of(names.iter().copied().filter(|n| *n != u32::MAX).collect());
        let all = sums.gather(&at)?;
        let normal = |n: &u32| match *n {
            u32::MAX => Vec3::Y,
            n => DVec3::from(all[at.slot(n)]).try_normalize().map_or(Vec3::Y, |n| n.as_vec3()),
        };
        let normals = names.iter().map(normal).collect();
        Ok((names, normals))
    }
}

/// A set of numbers that tells how many of them are below one.
struct Ranks {
    bits: Vec<u64>,
    /// Members before each word.
    before: Vec<u32>,
}

impl Ranks {
    fn new(len: u32) -> Self {
        Self { bits: vec![0; (len as usize).div_ceil(64)], before: vec![] }
    }

    fn set(&mut self, n: u32) {
        self.bits[n as usize / 64] |= 1 << (n % 64);
    }

    fn finish(&mut self) {
        let mut sum = 0;
        self.before = self
            .bits
            .iter()
            .map(|w| {
                sum += w.count_ones();
                sum - w.count_ones()
            })
            .collect();
    }

    fn count(&self) -> u32 {
        self.bits.iter().map(|w| w.count_ones()).sum()
    }

    /// How many members are below `n`; numbers beyond all stay as they are.
    fn below(&self, n: u32) -> u32 {
        match self.before.get(n as usize / 64) {
            Some(before) => before + (self.bits[n as usize / 64] & ((1 << (n % 64)) - 1)).count_ones(),
            None => n,
        }
    }
}
