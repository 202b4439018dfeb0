//! The tree under both kinds of hierarchy: four children a node, leaves that are runs of the reordered items.

use std::ops::{ControlFlow, Range};

use glam::{BVec4A, Vec3, Vec3A, Vec4};
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::Ray;
use crate::Aabb;

/// Relative slack of box tests. Four roundings lie between a plane and its t, as many in a triangle's: 8 * 2^-24 < 1e-6.
const SLACK: f32 = 1e-6;
/// Deeper trees are rebuilt balanced, so that traversal needs no heap.
const MAX_DEPTH: usize = 48;
/// Three siblings wait a level.
const STACK: usize = 3 * MAX_DEPTH + 4;

/// A node: the boxes of its children, coordinate by coordinate.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Node {
    /// Lower (0) and upper (1) planes by axis, one lane a child. A child that is not there is inside out.
    planes: [[Vec4; 3]; 2],
    /// The child's node, or its first item.
    first: [u32; 4],
    /// The child's items; 0 where it is a node.
    count: [u32; 4],
}

/// See the module.
#[derive(Clone, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// The items in leaf order, as the caller numbers them.
    pub(super) order: Vec<u32>,
    /// The box of everything in it.
    pub(super) bounds: Option<Aabb>,
}

/// A subtree still to be visited.
#[derive(Clone, Copy)]
struct Waiting {
    at: f32,
    first: u32,
    count: u32,
}

struct Item(obvhs::aabb::Aabb);

impl obvhs::Boundable for Item {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        self.0
    }
}

/// A binary tree, before it is widened.
enum Binary {
    Leaf(Range<u32>),
    Inner(Box<[Binary; 2]>),
}

/// A binary tree with boxes and with runs of items.
struct Fitted {
    bounds: Aabb,
    items: Range<u32>,
    children: Option<Box<[Fitted; 2]>>,
}

impl Binary {
    /// The tree with boxes around its items; `ends` says where each of its runs ends in `order`.
    fn fit(self, ends: &[u32], order: &[u32], boxes: &[Aabb]) -> Fitted {
        match self {
            Self::Leaf(r) => {
                let items = ends[r.start as usize]..ends[r.end as usize];
                let run = &order[items.start as usize..items.end as usize];
                let bounds = run.iter().fold(Aabb::EMPTY, |a, &i| a.union(boxes[i as usize]));
                Fitted { bounds, items, children: None }
            }
            Self::Inner(c) => {
                let c = c.map(|x| x.fit(ends, order, boxes));
                Fitted { bounds: c[0].bounds.union(c[1].bounds), items: 0..0, children: Some(Box::new(c)) }
            }
        }
    }
}

impl Tree {
    /// Builds over boxes with at most about `leaf` items a leaf. Boxes that are empty or not finite are left out.
    pub(super) fn build(boxes: &[Aabb], leaf: u32) -> Self {
        let kept: Vec<u32> = (0..boxes.len() as u32)
            .filter(|&i| {
                let b = &boxes[i as usize];
                b.min.is_finite() && b.max.is_finite() && !b.is_empty()
            })
            .collect();
        if kept.is_empty() {
            return Self::default();
        }
        let bounds = kept.iter().fold(Aabb::EMPTY, |b, &i| b.union(boxes[i as usize]));
        // Equal boxes are one item to the clustering, which would chain them up.
        let key = |i: u32| {
            let b = &boxes[i as usize];
            [b.min, b.max].map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits))
        };
        let mut order = kept;
        order.sort_by_key(|&i| (key(i), i));
        let starts: Vec<u32> =
            (0..order.len()).filter(|&k| k == 0 || key(order[k - 1]) != key(order[k])).map(|k| k as u32).collect();
        let mut groups: Vec<u32> = (0..starts.len() as u32).collect();
        let first = |g: u32| boxes[order[starts[g as usize] as usize] as usize];
        let flat = cluster(&groups.iter().map(|&g| first(g)).collect::<Vec<_>>(), &bounds, leaf);
        let binary = match unfold(&flat, 0, 0) {
            Some(b) => {
                groups = flat.primitive_indices;
                b
            }
            None => balanced(&mut groups, 0, &first, leaf as usize),
        };
        // From groups to their items: runs of groups become runs of items.
        let mut ends = vec![0];
        let mut items = Vec::with_capacity(order.len());
        for g in groups {
            let end = starts.get(g as usize + 1).map_or(order.len(), |&e| e as usize);
            items.extend_from_slice(&order[starts[g as usize] as usize..end]);
            ends.push(items.len() as u32);
        }
        let fitted = binary.fit(&ends, &items, boxes);
        let mut tree = Self { nodes: vec![], order: items, bounds: Some(bounds) };
        tree.widen(&fitted);
        // Nodes were pushed one by one: what is held is what is told.
        tree.nodes.shrink_to_fit();
        tree
    }

    /// Writes a node over up to four descendants of `f`, the ones with the largest boxes opened first.
    fn widen(&mut self, f: &Fitted) -> u32 {
        let area = |f: &Fitted| {
            let s = f.bounds.size().as_dvec3();
            s.x * s.y + s.y * s.z + s.z * s.x
        };
        let mut open = vec![f];
        while open.len() < 4 {
            let inner = (0..open.len()).filter(|&i| open[i].children.is_some());
            let widest = inner.max_by(|&i, &j| area(open[i]).total_cmp(&area(open[j])));
            let Some(children) = widest.and_then(|i| open.remove(i).children.as_deref()) else { break };
            open.extend(children);
        }
        let at = self.nodes.len();
        let empty = [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]];
        self.nodes.push(Node { planes: empty, first: [0; 4], count: [0; 4] });
        for (i, child) in open.into_iter().enumerate() {
            let (first, count) = match child.children {
                None => (child.items.start, child.items.end - child.items.start),
                Some(_) => (self.widen(child), 0),
            };
            let node = &mut self.nodes[at];
            for axis in 0..3 {
                node.planes[0][axis][i] = child.bounds.min[axis];
                node.planes[1][axis][i] = child.bounds.max[axis];
            }
            (node.first[i], node.count[i]) = (first, count);
        }
        at as u32
    }

    /// Calls `leaf` with runs of the order that the ray may meet at some t in `ray.t_min..=t_max`, about from near to far;
    /// `leaf` may lower `t_max` and may break off.
    #[inline]
    pub(super) fn cast(&self, ray: &Ray, t_max: f32, leaf: &mut impl FnMut(Range<u32>, &mut f32) -> ControlFlow<()>) {
        if self.nodes.is_empty() {
            return;
        }
        let mut limit = t_max;
        let mut stack = [Waiting { at: 0.0, first: 0, count: 0 }; STACK];
        let (mut node, mut top) = (0u32, 0usize);
        let origin = [0, 1, 2].map(|k| Vec4::splat(ray.origin[k]));
        let rest = [0, 1, 2].map(|k| Vec4::splat(ray.rest[k]));
        let inverse = [0, 1, 2].map(|k| Vec4::splat(ray.inverse[k]));
        loop {
            let n = &self.nodes[node as usize];
            let (mut near, mut far) = (Vec4::splat(ray.t_min), Vec4::splat(limit));
            if ray.any_parallel {
                for k in 0..3 {
                    let (lo, hi) = (n.planes[0][k] - origin[k] - rest[k], n.planes[1][k] - origin[k] - rest[k]);
                    if ray.parallel[k] {
                        let inside = lo.cmple(Vec4::ZERO) & hi.cmpge(Vec4::ZERO);
                        near = Vec4::select(inside, near, Vec4::INFINITY);
                    } else {
                        let (a, b) = if ray.negative[k] == 1 { (hi, lo) } else { (lo, hi) };
                        (near, far) = (near.max(a * inverse[k]), far.min(b * inverse[k]));
                    }
                }
            } else {
                for k in 0..3 {
                    let s = ray.negative[k] & 1;
                    near = near.max((n.planes[s][k] - origin[k] - rest[k]) * inverse[k]);
                    far = far.min((n.planes[1 - s][k] - origin[k] - rest[k]) * inverse[k]);
                }
            }
            let near = near * (1.0 - SLACK);
            let met: BVec4A = near.cmple(far * (1.0 + SLACK));
            let mut mask = met.bitmask();
            // The children that are met go on the stack, the nearest last.
            let first = top;
            while mask != 0 {
                let i = mask.trailing_zeros() as usize & 3;
                mask &= mask - 1;
                let w = Waiting { at: near[i], first: n.first[i], count: n.count[i] };
                let mut j = top;
                while j > first && stack[j - 1].at < w.at {
                    stack[j] = stack[j - 1];
                    j -= 1;
                }
                stack[j] = w;
                top += 1;
            }
            // Down to the next node, through the leaves before it.
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let w = stack[top];
                if w.at > limit {
                    continue;
                }
                if w.count == 0 {
                    node = w.first;
                    break;
                }
                if leaf(w.first..w.first + w.count, &mut limit).is_break() {
                    return;
                }
            }
        }
    }

    /// Calls `leaf` with runs of the order whose box lies within `distance2` (squared) of `p`, about from near to far; `leaf`
    /// may lower `distance2`.
    pub(super) fn around(&self, p: Vec3, distance2: f32, leaf: &mut impl FnMut(Range<u32>, &mut f32)) {
        if self.nodes.is_empty() {
            return;
        }
        let mut limit = distance2;
        let mut waiting = vec![Waiting { at: 0.0, first: 0, count: 0 }];
        while let Some(w) = waiting.pop() {
            if w.at > limit {
                continue;
            }
            if w.count > 0 {
                leaf(w.first..w.first + w.count, &mut limit);
                continue;
            }
            let n = &self.nodes[w.first as usize];
            let mut d2 = Vec4::ZERO;
            for k in 0..3 {
                let q = Vec4::splat(p[k]);
                let out = (n.planes[0][k] - q).max(q - n.planes[1][k]).max(Vec4::ZERO);
                d2 += out * out;
            }
            let d2 = d2 * (1.0 - SLACK);
            let first = waiting.len();
            for i in (0..4).filter(|&i| d2[i] <= limit && n.planes[0][0][i] <= n.planes[1][0][i]) {
                waiting.push(Waiting { at: d2[i], first: n.first[i], count: n.count[i] });
            }
            waiting[first..].sort_by(|a, b| b.at.total_cmp(&a.at));
        }
    }

    /// Bytes that it holds.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.order[..])
    }
}

/// obvhs's medium build, step by step: its helper would check the tree by recursion in debug builds, however deep it is. Boxes
/// are scaled to the unit cube and blown up a little, so that areas tell them apart even along a line.
fn cluster(boxes: &[Aabb], bounds: &Aabb, leaf: u32) -> Bvh2 {
    let centre = bounds.centre();
    // Half a size at a time: a box from -MAX to MAX has no finite size.
    let half = (bounds.max * 0.5 - bounds.min * 0.5).max_element();
    let scale = if half > 0.0 { (0.5 / half).min(f32::MAX) } else { 1.0 };
    let unit = |p: Vec3| Vec3A::from((p - centre) * scale).clamp(Vec3A::NEG_ONE, Vec3A::ONE);
    let item = |b: &Aabb| Item(obvhs::aabb::Aabb::new(unit(b.min) - 1e-6, unit(b.max) + 1e-6));
    let items: Vec<Item> = boxes.iter().map(item).collect();
    let indices = (0..boxes.len() as u32).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Medium,
        &items,
        indices,
        SortPrecision::U64,
        3,
    );
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut tree, 0.05, None);
    collapse(&mut tree, leaf, 3.0);
    optimizer.run(&mut tree, 0.1, None);
    tree
}

/// The subtree at a node; `None` where it is too deep.
fn unfold(flat: &Bvh2, node: usize, depth: usize) -> Option<Binary> {
    let n = flat.nodes.get(node)?;
    if n.is_leaf() {
        return Some(Binary::Leaf(n.first_index..n.first_index + n.prim_count));
    }
    if depth == MAX_DEPTH {
        return None;
    }
    let child = |i: usize| unfold(flat, n.first_index as usize + i, depth + 1);
    Some(Binary::Inner(Box::new([child(0)?, child(1)?])))
}

/// Halves the items again and again by their centres along the longest axis: at most log2(n) deep, whatever they are.
fn balanced(items: &mut [u32], start: u32, of: &impl Fn(u32) -> Aabb, leaf: usize) -> Binary {
    if items.len() <= leaf.max(1) {
        return Binary::Leaf(start..start + items.len() as u32);
    }
    let size = Aabb::of(items.iter().map(|&i| of(i).centre())).size();
    let axis = (0..3).fold(0, |a, k| if size[k] > size[a] { k } else { a });
    items.sort_by(|&a, &b| of(a).centre()[axis].total_cmp(&of(b).centre()[axis]).then(a.cmp(&b)));
    let (low, high) = items.split_at_mut(items.len() / 2);
    let middle = start + low.len() as u32;
    Binary::Inner(Box::new([balanced(low, start, of, leaf), balanced(high, middle, of, leaf)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The way out where clustering goes too deep.
    #[test]
    fn a_balanced_tree_holds_every_item_once_and_is_shallow() {
        let boxes: Vec<Aabb> =
            (0..1000).map(|i| Aabb::of([Vec3::new((i % 7) as f32, (i / 500) as f32, 0.0)])).collect();
        let mut items: Vec<u32> = (0..1000).collect();
        let tree = balanced(&mut items, 0, &|i| boxes[i as usize], 6);
        fn runs(b: &Binary, depth: usize, out: &mut Vec<(Range<u32>, usize)>) {
            match b {
                Binary::Leaf(r) => out.push((r.clone(), depth)),
                Binary::Inner(c) => c.iter().for_each(|c| runs(c, depth + 1, out)),
            }
        }
        let mut leaves = vec![];
        runs(&tree, 0, &mut leaves);
        assert!(leaves.iter().all(|(r, depth)| r.len() <= 6 && *depth <= 8));
        assert_eq!(leaves.iter().flat_map(|(r, _)| r.clone()).collect::<Vec<_>>(), (0..1000).collect::<Vec<_>>());
        items.sort_unstable();
        assert_eq!(items, (0..1000).collect::<Vec<_>>());
    }

    /// What clusters into a chain deeper than the limit is built balanced instead.
    #[test]
    fn no_tree_is_deeper_than_the_stack() {
        let boxes: Vec<Aabb> = (0..100).map(|k| Aabb::of([Vec3::ZERO, Vec3::splat(0.8f32.powi(k))])).collect();
        let tree = Tree::build(&boxes, 1);
        let mut depth = vec![0usize; tree.nodes.len()];
        for (i, n) in tree.nodes.iter().enumerate() {
            for k in (0..4).filter(|&k| n.count[k] == 0 && n.planes[0][0][k] <= n.planes[1][0][k]) {
                depth[n.first[k] as usize] = depth[i] + 1;
            }
        }
        assert!(depth.into_iter().all(|d| d <= MAX_DEPTH));
        let mut seen = tree.order.clone();
        seen.sort_unstable();
        assert_eq!(seen, (0..100).collect::<Vec<_>>());
    }
}
