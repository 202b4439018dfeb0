//! The levels of one object: collapsed one after the other, each with how far it is off.
//!
//! The edge collapse of Garland and Heckbert (1997) on the welded vertices, survivors on original places; the quadrics go on from
//! level to level, so a level is what one long collapse would leave. Colours enter the cost beside the planes, as an edge's length times the
//! difference of its ends' albedo (simpler than the quadrics over attributes of Garland and Heckbert 1998: nothing is remembered). A corner whose vertex died takes the survivor's wedge that
//! looks most like its own: corners stay on their side of a seam. O(n log n).

use farfield_core::Fault;
use farfield_core::collapse::{
    Candidate, Cost, LiveMesh, Place, Placement, QuadricSettings, Quadrics, Settings, collapse,
};
use farfield_core::context::Context;
use farfield_core::payload::MeshPart;
use farfield_core::scene::{Gathered, Texture, WedgesOfVertices};
use glam::Vec3;

use super::StaticLod;
use super::deviation::Original;

use super::index::MOST_LEVELS;

/// A level of detail.
pub(super) struct Level {
    /// A wedge a corner.
    pub(super) corners: Vec<[u32; 3]>,
    /// One-sided before two-sided; none is empty.
    pub(super) parts: Vec<MeshPart>,
    /// How far it is off, scene units; not less than the level's before.
    pub(super) error: f32,
}

/// The levels below the original, finest first; none where the object has too few triangles.
///
/// # Errors
/// [`Fault::Cancelled`], or [`Fault::Data`] where the mesh contradicts itself.
pub(super) fn levels(
    own: &StaticLod,
    source: &Gathered,
    textures: &[Texture],
    cx: &Context<'_>,
) -> Result<Vec<Level>, Fault> {
    let target = |n: usize| (n as f64 * f64::from(own.ratio)).round() as usize;
    let mut out: Vec<Level> = vec![];
    let mut corners = source.corners.clone();
    if target(corners.len()) < own.least_triangles as usize {
        return Ok(out);
    }
    let original = Original::new(source, textures);
    let wedges = source.wedges_of_vertices();
    let (mut two_sided, mut quadrics) = (source.two_sided.clone(), None);
    // A chain may end early: ids of levels are counted to a bound.
    while target(corners.len()) >= own.least_triangles as usize && out.len() < MOST_LEVELS as usize {
        cx.check()?;
        let indices: Vec<u32> = corners.iter().flat_map(|&c| source.vertices(c)).collect();
        let live = LiveMesh::new(&source.positions, &indices, &[])?;
        let half_edge = QuadricSettings { placement: Placement::HalfEdge, ..QuadricSettings::default() };
        let cost = quadrics.get_or_insert_with(|| Coloured {
            quadrics: Quadrics::new(&live, half_edge),
            source,
            wedges: &wedges,
        });
        // Small closed parts may vanish, as they have to in scenes of many; a survivor on an original place opens no surface.
        let settings = Settings { min_triangles: target(corners.len()), link_condition: false, ..Settings::default() };
        let left = collapse(live, cost, &settings);
        let kept: Vec<[u32; 3]> = left
            .triangles
            .iter()
            .map(|&t| {
                corners[t as usize].map(|w| {
                    let wedge = &source.wedges[w as usize];
                    let vertex = left.remap[wedge.vertex as usize];
                    if vertex == wedge.vertex { w } else { source.alike(wedges.of(vertex), wedge) }
                })
            })
            .collect();
        // Where the collapse gets stuck, a level that saves less than half of what it should is not worth its bytes.
        let least_saved = 0.5 * (1.0 - f64::from(own.ratio)) * corners.len() as f64;
        if kept.is_empty() || ((corners.len() - kept.len()) as f64) < least_saved {
            break;
        }
        two_sided = left.triangles.iter().map(|&t| two_sided[t as usize]).collect();
        let error = original.deviation(&kept, own.max_albedo_off).max(out.last().map_or(0.0, |l| l.error));
        out.push(Level { parts: source.parts(&kept, &two_sided), corners: kept.clone(), error });
        corners = kept;
    }
    Ok(out)
}

/// How much of its length an edge from black to white costs: a wrong colour over a length weighs as the surface half as far off.
const COLOUR_WEIGHT: f32 = 0.5;

/// cost = sqrt(quadric error^2 + (COLOUR_WEIGHT |albedo difference| length)^2), scene units; albedo 0..1, display space. The difference is that
/// between a dying vertex's wedges and the survivor's most like them; of several wedges the worst served counts.
struct Coloured<'a> {
    quadrics: Quadrics,
    source: &'a Gathered,
    wedges: &'a WedgesOfVertices,
}

impl Coloured<'_> {
    fn off(&self, dying: u32, onto: u32) -> f32 {
        let albedo = |w: &u32| unit(self.source.wedges[*w as usize].albedo);
        let least = |w: &u32| {
            let all = self.wedges.of(onto).iter().map(|o| albedo(o).distance(albedo(w)));
            all.fold(f32::INFINITY, f32::min)
        };
        self.wedges.of(dying).iter().map(least).fold(0.0, f32::max)
    }
}

impl Cost for Coloured<'_> {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        self.quadrics.costs(mesh, edges, out);
        for (&[a, b], out) in edges.iter().zip(out) {
            let off = if matches!(out.place, Place::Second) { self.off(a, b) } else { self.off(b, a) };
            out.cost = out.cost.hypot(COLOUR_WEIGHT * off * mesh.position(a).distance(mesh.position(b)));
        }
    }

    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        self.quadrics.collapsed(mesh, from, onto, at);
    }
}

fn unit(c: [u8; 4]) -> Vec3 {
    Vec3::new(f32::from(c[0]), f32::from(c[1]), f32::from(c[2])) / 255.0
}
