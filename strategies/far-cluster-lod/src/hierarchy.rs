//! The hierarchy of one object: rounds in which the clusters that there are get grouped, and each group is replaced by fewer triangles.
//!
//! A round's clusters cover the object once. Groups are chosen so that clusters of one group share many vertices (meshoptimizer's
//! partition); vertices that two groups share are locked, so that each group may be replaced or not, whatever its neighbours do. The
//! next round's groups straddle the locked borders of this one's. A group that does not get simpler hands its clusters on to the next
//! round as they are, where they meet other neighbours; where no group does, groups are made twice as large.
//!
//! Round 1 starts from the scene's own chunks. All clusters of one group are replaced together, so clusters below the first groups
//! would never be told apart: a chunk is as fine as what could be drawn.
//!
//! One-sided and two-sided triangles are hierarchies of their own, since meshes have sides as a whole; vertices that both use stay.
//! O(n log n) for n triangles: each round has about half the triangles of the one before.

use farfield_core::context::{Context, Executor, collect};
use farfield_core::scene::Gathered;
use farfield_core::{Aabb, Fault};

use crate::ClusterLod;
use crate::group::{Simplified, simplify};

/// A chunk or a cluster.
pub(crate) struct Unit {
    /// The group that made it; `None` of a chunk.
    pub(crate) made_by: Option<u32>,
    /// The group that replaces it.
    pub(crate) replaced_by: Option<u32>,
    /// A wedge a corner.
    pub(crate) corners: Vec<[u32; 3]>,
    /// Its box, or for a cluster that of the group that made it, local frame.
    pub(crate) bounds: Aabb,
    /// The original wears a texture here.
    pub(crate) textured: bool,
    /// Seen from behind too.
    pub(crate) two_sided: bool,
}

/// What stands for several units together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Made {
    /// Holds the bounds of all units that it replaces, local frame.
    pub(crate) bounds: Aabb,
    /// Not less than that of any group below it, scene units.
    pub(crate) error: f32,
}

/// Groups in an order in which those that made a group's units come before it.
pub(crate) struct Hierarchy {
    /// The chunks first, in the order they were given.
    pub(crate) units: Vec<Unit>,
    pub(crate) groups: Vec<Made>,
}

/// The hierarchy over an object's chunks.
///
/// # Errors
/// [`Fault::Cancelled`], or what meshoptimizer does not take.
pub(crate) fn build(
    own: &ClusterLod,
    source: &Gathered,
    chunks: Vec<Unit>,
    run: &dyn Executor,
    cx: &Context<'_>,
) -> Result<Hierarchy, Fault> {
    let mut out = Hierarchy { units: chunks, groups: vec![] };
    let mut sides = [vec![false; source.positions.len()], vec![false; source.positions.len()]];
    for u in &out.units {
        let vertices = u.corners.iter().flat_map(|&c| source.vertices(c));
        vertices.for_each(|v| sides[usize::from(u.two_sided)][v as usize] = true);
    }
    let both: Vec<bool> = sides[0].iter().zip(&sides[1]).map(|(a, b)| a & b).collect();
    for two_sided in [false, true] {
        let mut live: Vec<usize> = (0..out.units.len()).filter(|&u| out.units[u].two_sided == two_sided).collect();
        let mut widened = 1;
        loop {
            cx.check()?;
            let triangles: usize = live.iter().map(|&u| out.units[u].corners.len()).sum();
            if triangles / 2 < own.least_triangles as usize {
                break;
            }
            let size = widened * own.cluster_triangles as usize * own.group_clusters as usize * live.len() / triangles;
            let groups = partition(source, &out.units, &live, size.max(1));
            let locked = locks(source, &out.units, &groups, &both);
            let done = collect(run, groups.len(), &|g| {
                cx.check()?;
                let all: Vec<[u32; 3]> = groups[g].iter().flat_map(|&u| &out.units[u].corners).copied().collect();
                simplify(own, source, &all, &locked)
            })?;
            let (alone, before) = (groups.len() == 1, out.groups.len());
            live.clear();
            for (units, made) in groups.into_iter().zip(done) {
                match made {
                    Some(made) => out.replace(own, &units, made, &mut live),
                    None => live.extend(units),
                }
            }
            widened = match out.groups.len() > before {
                true => 1,
                false if alone => break,
                false => 2 * widened,
            };
        }
    }
    Ok(out)
}

impl Hierarchy {
    /// Adds a group that replaces `units`; its clusters join the next round.
    fn replace(&mut self, own: &ClusterLod, units: &[usize], made: Simplified, live: &mut Vec<usize>) {
        let id = self.groups.len() as u32;
        let (mut bounds, mut error, mut textured, mut two_sided) = (Aabb::EMPTY, made.error, false, false);
        for &u in units {
            let unit = &mut self.units[u];
            unit.replaced_by = Some(id);
            bounds = bounds.union(unit.bounds);
            error = error.max(unit.made_by.map_or(0.0, |g| self.groups[g as usize].error));
            (textured, two_sided) = (textured | unit.textured, unit.two_sided);
        }
        if textured && own.keep_textures {
            error = error.max(made.mean_edge);
        }
        self.groups.push(Made { bounds, error });
        for corners in made.clusters {
            live.push(self.units.len());
            self.units.push(Unit { made_by: Some(id), replaced_by: None, corners, bounds, textured, two_sided });
        }
    }
}

/// Units in groups of about `size`.
fn partition(source: &Gathered, units: &[Unit], live: &[usize], size: usize) -> Vec<Vec<usize>> {
    if live.len() <= size {
        return vec![live.to_vec()];
    }
    let counts: Vec<u32> = live.iter().map(|&u| 3 * units[u].corners.len() as u32).collect();
    let corners = live.iter().flat_map(|&u| &units[u].corners);
    let indices: Vec<u32> = corners.flat_map(|&c| source.vertices(c)).collect();
    let mut group_of = vec![0; live.len()];
    let groups = match meshopt::VertexDataAdapter::new(bytemuck::cast_slice(&source.positions), 12, 0) {
        Ok(v) => meshopt::partition_clusters_with_positions(&mut group_of, &indices, &counts, &v, size),
        // By shared vertices alone.
        Err(_) => meshopt::partition_clusters(&mut group_of, &indices, &counts, source.positions.len(), size),
    };
    let mut out = vec![vec![]; groups];
    live.iter().zip(group_of).for_each(|(&u, g)| out[g as usize].push(u));
    out
}

/// Which welded vertices two groups share, or `both` sides.
fn locks(source: &Gathered, units: &[Unit], groups: &[Vec<usize>], both: &[bool]) -> Vec<bool> {
    let mut first = vec![u32::MAX; both.len()];
    let mut locked = both.to_vec();
    for (g, group) in (0u32..).zip(groups) {
        let corners = group.iter().flat_map(|&u| &units[u].corners);
        for v in corners.flat_map(|&c| source.vertices(c)).map(|v| v as usize) {
            locked[v] |= first[v] != u32::MAX && first[v] != g;
            first[v] = g;
        }
    }
    locked
}
