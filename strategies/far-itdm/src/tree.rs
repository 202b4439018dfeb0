//! The dependency tree of a group of samples.
//!
//! Follows Wilson and Manocha 2003, section 4.1: the sample nearest to the centroid of all is the *intra* sample, which depends on no
//! other; the tree is a minimum spanning tree of the complete graph whose edges weigh the cubed distance, rooted there. Distances
//! are taken in units of the largest one, in 64 bits: cubes of large coordinates would overflow. O(n^2 log n).

use glam::DVec3;
use petgraph::algo::min_spanning_tree;
use petgraph::data::FromElements;
use petgraph::graph::{NodeIndex, UnGraph};
use petgraph::visit::Bfs;

/// Each sample's parent; `None` for the intra sample.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Tree {
    pub(crate) parent: Vec<Option<usize>>,
    /// From the root outwards: every sample after its parent.
    pub(crate) order: Vec<usize>,
}

impl Tree {
    /// The tree of samples at these places.
    pub(crate) fn new(eyes: &[DVec3]) -> Self {
        let n = eyes.len();
        let Some(root) = intra(eyes) else { return Self { parent: vec![], order: vec![] } };
        let pairs = || (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
        let largest = pairs().map(|(i, j)| eyes[i].distance(eyes[j])).fold(f64::MIN_POSITIVE, f64::max);
        let mut graph: UnGraph<(), f64> = UnGraph::default();
        (0..n).for_each(|_| _ = graph.add_node(()));
        for (i, j) in pairs() {
            graph.add_edge(NodeIndex::new(i), NodeIndex::new(j), (eyes[i].distance(eyes[j]) / largest).powi(3));
        }
        let spanning: UnGraph<(), f64> = UnGraph::from_elements(min_spanning_tree(&graph));
        let (mut parent, mut order) = (vec![None; n], vec![]);
        let mut walk = Bfs::new(&spanning, NodeIndex::new(root));
        while let Some(at) = walk.next(&spanning) {
            order.push(at.index());
            for next in spanning.neighbors(at).map(NodeIndex::index) {
                if next != root && parent[next].is_none() && parent[at.index()] != Some(next) {
                    parent[next] = Some(at.index());
                }
            }
        }
        Self { parent, order }
    }

    /// The roots, then all samples whose parents are among those, and so on.
    pub(crate) fn generations(&self) -> Vec<Vec<usize>> {
        let mut out: Vec<Vec<usize>> = vec![];
        for &i in &self.order {
            let depth = self.ancestors(i).count();
            out.resize_with(out.len().max(depth + 1), Vec::new);
            out[depth].push(i);
        }
        out
    }

    /// A sample's ancestors, its parent first.
    pub(crate) fn ancestors(&self, of: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(self.parent[of], |&i| self.parent[i])
    }
}

/// The sample nearest to the centroid; of equally near ones the first.
fn intra(eyes: &[DVec3]) -> Option<usize> {
    let centroid = eyes.iter().sum::<DVec3>() / eyes.len().max(1) as f64;
    (0..eyes.len()).min_by(|&a, &b| eyes[a].distance(centroid).total_cmp(&eyes[b].distance(centroid)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Prim's algorithm, written down the obvious way: the total weight of a minimum spanning tree.
    fn prim(eyes: &[DVec3]) -> f64 {
        let mut inside = vec![0];
        let mut total = 0.0;
        while inside.len() < eyes.len() {
            let best = (0..eyes.len())
                .filter(|i| !inside.contains(i))
                .map(|i| (inside.iter().map(|&j| eyes[i].distance(eyes[j]).powi(3)).fold(f64::INFINITY, f64::min), i))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap();
            total += best.0;
            inside.push(best.1);
        }
        total
    }

    proptest! {
        #[test]
        fn it_spans_all_samples_at_the_least_cubed_distance(
            places in prop::collection::vec((-1e3f64..1e3, -1e3f64..1e3), 1..20)
        ) {
            let eyes: Vec<DVec3> = places.iter().map(|&(x, z)| DVec3::new(x, 1.6, z)).collect();
            let t = Tree::new(&eyes);
            prop_assert_eq!(t.parent.iter().filter(|p| p.is_none()).count(), 1);
            prop_assert_eq!(t.order.len(), eyes.len());
            let weight: f64 = (0..eyes.len())
                .filter_map(|i| t.parent[i].map(|p| eyes[i].distance(eyes[p]).powi(3)))
                .sum();
            let least = prim(&eyes);
            prop_assert!((weight - least).abs() <= 1e-9 * least.max(1e-300));
            for (k, &i) in t.order.iter().enumerate() {
                prop_assert!(t.parent[i].is_none_or(|p| t.order[..k].contains(&p)));
                prop_assert!(t.ancestors(i).count() < eyes.len());
            }
        }
    }

    #[test]
    fn huge_and_coincident_places_have_a_tree() {
        let far = [DVec3::splat(1e120), DVec3::splat(-1e120), DVec3::ZERO, DVec3::ZERO];
        let t = Tree::new(&far);
        assert_eq!(t.parent[2], None);
        assert_eq!(t.parent[3], Some(2));
        assert_eq!(t.order.len(), 4);
        assert!(Tree::new(&[]).order.is_empty());
        assert_eq!(Tree::new(&[DVec3::ONE; 3]).order.len(), 3);
    }
}
