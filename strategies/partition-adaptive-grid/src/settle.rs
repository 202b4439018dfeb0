//! Where grid points are needed: dividing until every point can serve its star-shape.
//!
//! A point is judged without placing an image. Where it sees more than the budget in some view, an image has to replace
//! enough of what lies wholly beyond its star-shape, so that the image is in front of every eye that may use it. If more than the
//! optimisation budget is left for some view even when all of that is replaced, the point is divided (one that keeps the
//! budget itself is not, where no smaller star-shape would bring the rest down to it): it and its neighbours come to have smaller
//! star-shapes. Points only come, and others only make a star-shape smaller, so a point that passed stays as it is and
//! keeps the radius with which it passed. Neighbours are held within one level of each other.
//!
//! The points of a round are judged in parallel, against the points at the round's start.

use farfield_core::Fault;
use farfield_core::context::{Context, collect};
use glam::DVec3;

use crate::cone::Cone;
use crate::directions;
use crate::lattice::{Blocks, Lattice, Site, Sites};
use crate::leaves::Leaves;
use crate::star::Stars;

/// More points than this are not divided: something is wrong with settings or scene, and the work would not end.
const MAX_POINTS: usize = 2_000_000;
/// An image is this much farther than the star-shape's border, relatively: no eye stands in its plane.
pub(crate) const CLEAR: f64 = 1.0001;
/// Sampled rays meet a model space that is larger by this many spacings.
const PAD: f64 = 0.02;
/// Distance to the points looked at first, in spacings: most star-shapes are decided within.
const FIRST: f64 = 4.6;

/// What points are judged by.
pub(crate) struct Judge<'a> {
    /// The model.
    pub(crate) leaves: &'a Leaves,
    /// The bins of pitches.
    pub(crate) cones: &'a [Cone],
    /// The sampled views.
    pub(crate) stars: Stars,
    /// Where eyes may be.
    pub(crate) space: [DVec3; 2],
    /// The most triangles of any view.
    pub(crate) budget: u64,
    /// The most triangles that images are to leave, where dividing can help.
    pub(crate) aim: u64,
    /// The greatest level.
    pub(crate) max_level: u32,
}

/// A point that serves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Serves {
    /// The radius of its star-shape, scene units.
    pub(crate) radius: f64,
    /// Some view from it needs an image.
    pub(crate) images: bool,
}

enum Verdict {
    /// No eye in the model space uses it.
    Apart,
    Serves(Serves),
    /// What is left of some view when all is replaced that may be, and that anywhere ahead.
    Divide {
        left: u64,
        at_least: Option<u64>,
    },
}

/// The points, and what each serves; `None` for those that no eye uses.
pub(crate) fn settle(
    judge: &Judge<'_>,
    lattice: Lattice,
    cx: &Context<'_>,
) -> Result<(Sites, Vec<Option<Serves>>), Fault> {
    let mut sites = Sites::coarsest(lattice);
    let mut settled: Vec<Option<Serves>> = vec![None; sites.all.len()];
    let mut pending: Vec<u32> = (0..sites.all.len() as u32).collect();
    while !pending.is_empty() {
        let blocks = Blocks::of(&sites);
        let verdicts = collect(cx.run, pending.len(), &|i| {
            cx.check()?;
            Ok(judge.verdict(&sites, &blocks, pending[i]))
        })?;
        let mut divide = vec![];
        for (&i, verdict) in pending.iter().zip(verdicts) {
            match verdict {
                Verdict::Apart => {}
                Verdict::Serves(s) => settled[i as usize] = Some(s),
                Verdict::Divide { left, at_least } => {
                    judge.may_divide(&sites, sites.all[i as usize], left, at_least)?;
                    divide.push(i);
                }
            }
        }
        let before = sites.all.len() as u32;
        divide.iter().for_each(|&i| sites.divide(i));
        sites.balance();
        if sites.all.len() > MAX_POINTS {
            return Err(Fault::Refused(format!(
                "adaptive-grid: more than {MAX_POINTS} grid points, and not every view is within budget = {}; raise budget",
                judge.budget
            )));
        }
        settled.resize(sites.all.len(), None);
        pending = divide;
        pending.extend(before..sites.all.len() as u32);
    }
    Ok((sites, settled))
}

impl Judge<'_> {
    fn verdict(&self, sites: &Sites, blocks: &Blocks<'_>, i: u32) -> Verdict {
        let Site { key, level } = sites.all[i as usize];
        let at = sites.lattice.place(key);
        let spacing = f64::from(sites.lattice.cube(level)) * sites.lattice.unit;
        let near = |d: f64| blocks.near(key, (d / sites.lattice.unit).ceil().min(1e9) as i32);
        // A model space thinner than the spacing, as eyes of one height have it, still has to be met by sampled rays.
        let pad = (0.5 * (spacing - (self.space[1] - self.space[0]))).max(DVec3::splat(PAD * spacing));
        let space = [self.space[0] - pad - at, self.space[1] + pad - at];
        let Some(radius) = self.stars.radius(space, FIRST * spacing, &near) else { return Verdict::Apart };
        if self.leaves.total <= self.budget {
            return Verdict::Serves(Serves { radius, images: false });
        }
        let mut images = false;
        for (cone, spans) in self.cones.iter().zip(directions::spans(self.leaves, at, self.cones)) {
            if directions::most(self.leaves, &spans) <= self.budget {
                continue;
            }
            images = true;
            let left = |depth: f64| directions::most_before(self.leaves, &spans, at, cone, depth);
            let kept = left(radius * CLEAR);
            // What cannot come within the optimisation budget even with everything ahead replaced need not be tried.
            let helps = || level < self.max_level && left(f64::MIN_POSITIVE) <= self.aim;
            if kept > self.budget || (kept > self.aim && helps()) {
                let inside = self.space[0].cmple(at).all() && self.space[1].cmpge(at).all();
                return Verdict::Divide { left: kept, at_least: inside.then(|| left(f64::MIN_POSITIVE)) };
            }
        }
        Verdict::Serves(Serves { radius, images })
    }

    fn may_divide(&self, sites: &Sites, site: Site, left: u64, at_least: Option<u64>) -> Result<(), Fault> {
        let at = sites.lattice.place(site.key);
        let place = format!("({:.3}, {:.3}, {:.3})", at.x, at.y, at.z);
        let budget = self.budget;
        if let Some(least) = at_least.filter(|&least| least > budget) {
            return Err(Fault::Refused(format!(
                "adaptive-grid: budget = {budget}, and from {place} some view has {least} triangles in leaves that reach to \
                 the viewer's side, where no image can replace them; raise budget, or leaf_depth if leaves hold more than a chunk"
            )));
        }
        if site.level >= self.max_level {
            return Err(Fault::Refused(format!(
                "adaptive-grid: at {place} a view of {left} triangles does not come within budget = {budget} by level \
                 {} (spacing {:.4}); raise budget or max_level",
                site.level,
                f64::from(sites.lattice.cube(site.level)) * sites.lattice.unit
            )));
        }
        Ok(())
    }
}
