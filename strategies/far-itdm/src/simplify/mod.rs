//! Simplification in two phases, both on the common collapse engine.
//!
//! Follows Wilson and Manocha 2003, section 4.2.2. **First**, collapses in the order of the quadric error, whatever the view, down to a
//! few hundred triangles: each merges a vertex into a neighbour, and all of them together are a merge tree (`tree`). **Then**, a static
//! cut through the tree (`cut`): a merge is done where, from every extreme viewpoint of the region, it moves the surface by no more than
//! a number of pixels: half a pixel at the mesh's borders and on its silhouettes, which are those of all extreme viewpoints together
//! (`extremes`), and a number of its own inside.
//!
//! Readings of ours: merges go onto one of the two vertices, so that no position is new and borders of two meshes that met before still do where
//! neither moved; pixels are the sample's own (what is finer than those was never seen); the cut is drawn by running the
//! engine again with the tree's merges as its only edges, so that no merge folds a triangle that the first run found flat;
//! on the edges of the cube vertices slide along the edge alone, so that every triangle stays in the picture that textures it.
//!
//! At borders the distance is that of every vertex that went from the border that is left. Elsewhere it is the quadric error, a root mean
//! square over the planes of what was merged: an estimate and no bound, at silhouettes too.
//!
//! O(n log n) for n triangles, each phase.

mod cut;
mod extremes;
mod tree;

use farfield_core::Fault;
use farfield_core::collapse::{LiveMesh, Settings, collapse};
use glam::Vec3;

pub(crate) use extremes::Extremes;

use crate::dense::Dense;
use cut::Cut;
use tree::Tree;

/// How far the surface may move, pixels of the sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// At borders and silhouettes.
    pub(crate) border_px: f32,
    /// Elsewhere.
    pub(crate) interior_px: f32,
    /// The first phase ends at so many triangles.
    pub(crate) tree_triangles: u32,
}

/// A simplified mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Simplified {
    /// Relative to the sample's eye.
    pub(crate) positions: Vec<Vec3>,
    /// Three a triangle.
    pub(crate) indices: Vec<u32>,
    /// For each triangle the picture that shows it.
    pub(crate) views: Vec<u8>,
}

/// Simplifies a dense mesh.
///
/// # Errors
/// [`Fault::Data`] where there are too many triangles for the engine.
pub(crate) fn simplify(mesh: &Dense, extremes: &Extremes, limits: &Limits) -> Result<Simplified, Fault> {
    let knots = mesh.knots();
    let live = LiveMesh::new(&mesh.positions, &mesh.indices, &knots)?;
    let mut tree = Tree::new(&live, mesh, extremes);
    let few = Settings { min_triangles: limits.tree_triangles as usize, ..Settings::default() };
    collapse(live, &mut tree, &few);
    let silhouette = extremes.silhouettes(mesh);
    let live = LiveMesh::new(&mesh.positions, &mesh.indices, &knots)?;
    let mut cut = Cut::new(tree.merges, &live, &silhouette, limits);
    let done = collapse(live, &mut cut, &Settings::default());
    let mut new = vec![u32::MAX; mesh.positions.len()];
    let mut out =
        Simplified { views: done.triangles.iter().map(|&t| mesh.views[t as usize]).collect(), ..Default::default() };
    for v in done.indices {
        if new[v as usize] == u32::MAX {
            new[v as usize] = out.positions.len() as u32;
            out.positions.push(done.positions[v as usize]);
        }
        out.indices.push(new[v as usize]);
    }
    Ok(out)
}
