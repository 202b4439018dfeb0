//! A small map from the vertices of a ring to edges, made anew for every collapse.
//!
//! A ring of usual valence fits a few cache lines that stay in the first cache, which a table over all vertices does not, and is
//! searched without a branch; the table is there for hubs alone, so that a look-up costs O(1) there too.

use super::mesh::DEAD;

/// Entries that are searched all at once.
const FEW: usize = 16;

#[derive(Clone, Copy)]
struct Spot {
    /// The map that this belongs to.
    map: u32,
    edge: u32,
}

pub(super) struct Spots {
    vertices: [u32; FEW],
    /// Edge ids plus one.
    edges: [u32; FEW],
    filled: usize,
    /// For what does not fit; empty until then.
    more: Vec<Spot>,
    map: u32,
    /// Number of vertices of the mesh.
    all: usize,
}

impl Spots {
    pub(super) fn new(vertices: usize) -> Self {
        Self { vertices: [DEAD; FEW], edges: [0; FEW], filled: 0, more: Vec::new(), map: 0, all: vertices }
    }

    /// Empties the map.
    #[inline]
    pub(super) fn clear(&mut self) {
        self.vertices = [DEAD; FEW];
        if self.filled > FEW {
            if self.map == u32::MAX {
                self.more.fill(Spot { map: 0, edge: 0 });
                self.map = 0;
            }
            self.map += 1;
        }
        self.filled = 0;
    }

    /// Maps a vertex to an edge; the same one where it is mapped already.
    #[inline]
    pub(super) fn insert(&mut self, vertex: u32, edge: u32) {
        if self.filled < FEW {
            (self.vertices[self.filled], self.edges[self.filled]) = (vertex, edge + 1);
            self.filled += 1;
        } else {
            self.insert_more(vertex, edge);
        }
    }

    #[cold]
    fn insert_more(&mut self, vertex: u32, edge: u32) {
        if self.more.is_empty() {
            self.more.resize(self.all, Spot { map: 0, edge: 0 });
            self.map = 1;
        }
        self.more[vertex as usize] = Spot { map: self.map, edge };
        self.filled = FEW + 1;
    }

    #[inline]
    pub(super) fn get(&self, vertex: u32) -> Option<u32> {
        let mut found = 0;
        for (v, e) in self.vertices.iter().zip(&self.edges) {
            found |= if *v == vertex { *e } else { 0 };
        }
        if found == 0 && self.filled > FEW {
            let spot = self.more[vertex as usize];
            return (spot.map == self.map).then_some(spot.edge);
        }
        found.checked_sub(1)
    }
}
