//! Bounding volume hierarchies: over triangles (rays, nearest points) and over boxes (a level above).
//!
//! Topology comes from obvhs: parallel locally-ordered clustering (Meister and Bittner 2018) with reinsertion (Meister and
//! Bittner 2017), on boxes that are scaled to the unit cube first, so that nothing depends on the scene's unit. It is then
//! widened to four children a node with boxes of our own, because obvhs's traversal knows absolute epsilons and ours
//! must not: box tests are those of Ize ("Robust BVH Ray Traversal", 2013), triangle tests those of Woop, Benthin and
//! Wald ("Watertight Ray/Triangle Intersection", 2013).
//!
//! Positions are 32 bit, relative to whatever origin the caller chose; a ray's origin is 64 bit, so that an eye close to a
//! surface far from that origin sees it sharply.
//!
//! Everything is deterministic: equal distances are decided by the lower index. Triangles and boxes that are not finite are
//! left out. O(n log n) to build, O(log n) a query in practice.

mod boxes;
mod nearest;
mod ray;
mod tree;
mod triangles;

pub use boxes::BoxBvh;
pub use nearest::{Nearest, nearest_on_triangle};
pub use ray::Ray;
pub use triangles::{Hit, TriangleBvh};
