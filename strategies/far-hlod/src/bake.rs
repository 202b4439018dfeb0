//! Bottom-up construction (section 3): a node is simplified from the nodes two levels below it, up to the edge of its cube over the resolution.
//!
//! Depth first, so that only the meshes beside the paths to the root are in memory, a path for each thread at work.

use farfield_core::context::{Context, collect, remembered};
use farfield_core::id::LocalPayload;
use farfield_core::octahedral::rounded;
use farfield_core::payload::{MeshPart, Part, Payload};
use farfield_core::scene::{Gathered, gather};
use farfield_core::strategy::{SceneJob, Sink};
use farfield_core::{Aabb, Fault};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::cone::Cone;
use crate::piece::Piece;
use crate::rounding::Grid;
use crate::skeleton::{Node, Skeleton};
use crate::texture;
use crate::tree::{Borders, Tree};
use crate::{PointPolygonHlod, Primitives, points};

/// Subtrees whose roots stand this deep or higher are independent jobs, up to 64 side by side, and are remembered across interruptions.
const PARALLEL_DEPTH: u32 = 2;

/// A built subtree: what the levels above still need of it.
#[derive(Serialize, Deserialize)]
struct Built {
    piece: Piece,
    /// Empty for a leaf.
    children: Vec<Piece>,
    /// Of all nodes in it, in order.
    nodes: Vec<Node>,
}

struct Baker<'a> {
    own: &'a PointPolygonHlod,
    job: &'a SceneJob<'a>,
    out: &'a dyn Sink,
    cx: &'a Context<'a>,
    tree: Tree,
    borders: Borders,
    grid: Grid,
    origin: DVec3,
}

/// Builds the whole tree.
pub(crate) fn bake(
    own: &PointPolygonHlod,
    job: &SceneJob<'_>,
    out: &dyn Sink,
    cx: &Context<'_>,
) -> Result<Skeleton, Fault> {
    let tree = Tree::over(job.scene, own.node_triangles);
    if tree.len() == 0 {
        return Ok(Skeleton::default());
    }
    // The grid's cells are parts of the smallest error that any node is allowed.
    let deepest = (0..tree.len() as u32).map(|n| tree.allowance(n, own.resolution)).fold(f32::INFINITY, f32::min);
    let grid = Grid::at_most(deepest / own.grid_steps as f32, tree.edge);
    let origin = grid.origin(job.scene.bounds.centre());
    let borders = Borders::find(job.scene, &tree, cx)?;
    let baker = Baker { own, job, out, cx, tree, borders, grid, origin };
    Ok(Skeleton { nodes: baker.subtree(0)?.nodes })
}

impl Baker<'_> {
    fn subtree(&self, node: u32) -> Result<Built, Fault> {
        self.cx.check()?;
        let depth = self.tree.octree.nodes[node as usize].depth;
        if self.tree.is_leaf(node) {
            return self.leaf(node);
        }
        if depth == 0 || depth > PARALLEL_DEPTH {
            return self.built(node);
        }
        let payloads = |b: &Built| {
            let stored = (node..).zip(&b.nodes).filter(|(_, n)| n.parts > 0);
            stored.map(|(id, _)| LocalPayload(id)).collect()
        };
        remembered(&node.to_le_bytes(), &payloads, &mut || self.built(node), self.out, self.cx)
    }

    /// A subtree of several nodes.
    fn built(&self, node: u32) -> Result<Built, Fault> {
        let children: Vec<u32> = self.tree.octree.children(node).collect();
        let below = if self.tree.octree.nodes[node as usize].depth < PARALLEL_DEPTH {
            collect(self.cx.run, children.len(), &|i| self.subtree(children[i]))?
        } else {
            children.iter().map(|&c| self.subtree(c)).collect::<Result<Vec<_>, _>>()?
        };
        self.inner(node, below)
    }

    fn leaf(&self, node: u32) -> Result<Built, Fault> {
        let (scene, own) = (self.job.scene, &self.tree.octree.nodes[node as usize]);
        let mut mesh = gather(scene, own.chunks.iter().copied(), self.origin)?;
        // Rounding to 32 bits around the scene's middle counts too.
        let error = texture::off(&mesh, &scene.textures, self.own.max_albedo_off) + self.tree.edge * f32::EPSILON;
        mesh.textured = vec![];
        let spans = mesh.names.iter().map(|&n| self.borders.span(n, node)).collect();
        let piece = Piece { mesh, spans, error };
        let node = Node { chunks: own.chunks.clone(), ..self.put(node, &piece, &[])? };
        Ok(Built { piece, children: vec![], nodes: vec![node] })
    }

    fn inner(&self, node: u32, mut below: Vec<Built>) -> Result<Built, Fault> {
        let sources: Vec<&Piece> = below
            .iter()
            .flat_map(|b| if b.children.is_empty() { std::slice::from_ref(&b.piece) } else { &b.children })
            .collect();
        let allowance = self.tree.allowance(node, self.own.resolution);
        let mut piece = Piece::joined(&sources);
        // Only its children are needed above: at the root there is more in what it is made of than in all else.
        below.iter_mut().for_each(|b| b.children = vec![]);
        piece.smooth(&self.tree.below(node), allowance);
        let piece =
            piece.simplified(&self.tree.below(node), allowance - self.grid_of(node).error(), &*self.own.metric)?;
        let roots: Vec<&Node> = below.iter().filter_map(|b| b.nodes.first()).collect();
        let own = self.put(node, &piece, &roots)?;
        let mut nodes = vec![own];
        let mut children = vec![];
        for b in below {
            nodes.extend(b.nodes);
            children.push(b.piece);
        }
        Ok(Built { piece, children, nodes })
    }

    /// Where positions inside a node are rounded to: parts of what the node may be off by. Those that others share are on the finest grid of all.
    fn grid_of(&self, node: u32) -> Grid {
        let step = self.tree.allowance(node, self.own.resolution) / self.own.grid_steps as f32;
        Grid::at_most(step.max(self.grid.step), self.tree.edge)
    }

    /// A node's geometry as it is stored.
    fn rounded(&self, node: u32, piece: &Piece) -> Gathered {
        let (mut mesh, grid) = (piece.mesh.clone(), self.grid_of(node));
        for (p, outside) in mesh.positions.iter_mut().zip(piece.outside(&self.tree.below(node))) {
            *p = if outside { self.grid.round(*p) } else { grid.round(*p) };
        }
        mesh.wedges.iter_mut().for_each(|w| w.normal = rounded(w.normal, self.own.normal_bits));
        mesh
    }

    /// Rounds and stores a node's geometry.
    fn put(&self, node: u32, piece: &Piece, children: &[&Node]) -> Result<Node, Fault> {
        let grid = self.grid_of(node);
        let round = |positions: &mut [Vec3], normals: &mut [Vec3]| {
            positions.iter_mut().for_each(|p| *p = grid.round(*p));
            normals.iter_mut().for_each(|n| *n = rounded(*n, self.own.normal_bits));
        };
        let mesh = &self.rounded(node, piece);
        // Cones are of all triangles, drawn as such or as points.
        let mut parts = mesh.parts(&mesh.corners, &mesh.two_sided);
        let cones: Vec<Cone> = children.iter().map(|c| c.cone).collect();
        let cone = if parts.iter().any(|p| p.two_sided) { Cone::ALL } else { cone(piece, &parts, &cones) };
        let local = |p: &Vec3| (self.origin + p.as_dvec3()).as_vec3();
        let bounds = Aabb::of(parts.iter().flat_map(|p| &p.positions).map(local));
        let whole = children.iter().map(|c| c.bounds).fold(bounds, Aabb::union);
        let whole = whole.union(self.tree.octree.nodes[node as usize].loose);
        let error = piece.error + grid.error();
        // Points alone are as far apart as the node's error may be; then they are what it is.
        let error = if self.own.primitives == Primitives::Points {
            error.max(self.tree.allowance(node, self.own.resolution))
        } else {
            error
        };
        let split = match self.own.primitives {
            Primitives::Triangles => None,
            p => Some(points::split(mesh, error, p == Primitives::Points, self.own.point_cost)),
        };
        let mut splats = vec![];
        if let Some(split) = split.filter(|s| !s.points.is_empty()) {
            let kept = &split.kept;
            let corners: Vec<_> = kept.iter().map(|&t| mesh.corners[t as usize]).collect();
            let two_sided: Vec<_> = kept.iter().map(|&t| mesh.two_sided[t as usize]).collect();
            parts = mesh.parts(&corners, &two_sided);
            splats = split.points;
            for p in &mut splats {
                round(&mut p.positions, &mut p.normals);
                p.radius += grid.error();
            }
        }
        let triangles = parts.iter().map(|p| p.indices.len() as u32 / 3).sum();
        let points = splats.iter().map(|p| p.positions.len() as u32).sum();
        let parts = parts.into_iter().map(Part::Mesh).chain(splats.into_iter().map(Part::Points));
        let parts: Vec<Part> = parts.collect();
        let bytes = |p: &Part| match p {
            Part::Mesh(m) => m.bytes(),
            Part::Points(p) => p.bytes(),
            _ => 0,
        };
        let own = Node {
            bounds: whole,
            error,
            cone,
            end: self.tree.below(node).end,
            depth: self.tree.octree.nodes[node as usize].depth as u8,
            parts: parts.len() as u8,
            triangles,
            points,
            bytes: parts.iter().map(bytes).sum(),
            object: most(&piece.mesh) + 1,
            chunks: vec![],
        };
        if !parts.is_empty() {
            self.out.put(LocalPayload(node), &Payload { origin: self.origin, bounds, parts })?;
        }
        Ok(own)
    }
}

/// Over the triangles as they are drawn, as they were before rounding, and over what is below.
fn cone(piece: &Piece, parts: &[MeshPart], below: &[Cone]) -> Cone {
    let face = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).try_normalize();
    let before = piece.mesh.corners.iter().filter_map(|&c| face(piece.mesh.places(c)));
    let drawn = parts.iter().flat_map(|p| {
        p.indices.chunks_exact(3).filter_map(move |t| face([t[0], t[1], t[2]].map(|i| p.positions[i as usize])))
    });
    Cone::over(before.chain(drawn), below)
}

/// The object of most triangles, the first of equals; 0 where there are none.
fn most(mesh: &Gathered) -> u32 {
    let mut objects: Vec<u32> = mesh.corners.iter().map(|&c| mesh.names[mesh.vertices(c)[0] as usize].0.0).collect();
    objects.sort_unstable();
    let runs = objects.chunk_by(|a, b| a == b);
    runs.fold((0, 0), |most, run| if run.len() > most.1 { (run[0], run.len()) } else { most }).0
}
