//! Every strategy, registered by name.
//!
//! Strategies make themselves known to serde through `typetag`; this list says beside it, explicitly and in alphabetical order, what
//! there is, with summaries, sources and settings, for `list`, for the book and for finding mistakes in experiment files. A
//! test holds the two equal.

use farfield_core::registry::{Entry, Kind, settings_of};

pub use {
    farfield_far_baselines as far_baselines, farfield_far_cluster_lod as far_cluster_lod,
    farfield_far_hlod as far_hlod, farfield_far_itdm as far_itdm, farfield_far_ldi as far_ldi,
    farfield_far_textured_mesh as far_textured_mesh, farfield_metrics as metrics,
    farfield_partition_adaptive_grid as partition_adaptive_grid, farfield_partition_hex as partition_hex,
    farfield_partition_octree as partition_octree, farfield_partition_single_cell as partition_single_cell,
    farfield_schedulers as schedulers,
};

/// The paper of the textured LOD meshes, before a section's number.
macro_rules! textured {
    ($section:literal) => {
        concat!("Textured LOD meshes (Chen, Lin, Chen, Chuang 2003), section ", $section)
    };
}

/// The paper of image placement, before a section's number.
macro_rules! placement {
    ($section:literal) => {
        concat!(
            "Automatic image placement to provide a guaranteed frame rate (Aliaga, Lastra 1999), section ",
            $section
        )
    };
}

/// The paper of the incremental textured depth meshes, before a section's number.
macro_rules! incremental {
    ($section:literal) => {
        concat!(
            "Simplifying complex environments using incremental textured depth meshes (Wilson, Manocha 2003), section ",
            $section
        )
    };
}

/// The paper of the point-polygon hierarchy, before a section's number.
macro_rules! hierarchy {
    ($section:literal) => {
        concat!(
            "Real-time appearance preserving out-of-core rendering with shadows (Guthe, Borodin, Balazs, Klein 2004), section ",
            $section
        )
    };
}

/// Every strategy, by kind, then by name.
pub fn registry() -> Vec<Entry> {
    vec![
        Entry {
            kind: Kind::FarField,
            name: "cluster-lod",
            summary: "A hierarchy of clusters of triangles, cut to the view without cracks",
            source: "Nanite: a deep dive (Karis, Stubbe, Wihlidal 2021), the part on cluster hierarchies",
            settings: settings_of::<far_cluster_lod::ClusterLod>(),
        },
        Entry {
            kind: Kind::FarField,
            name: "geometry",
            summary: "No far field: all geometry, or what frustum culling leaves of it",
            source: textured!("4, configurations A and B"),
            settings: settings_of::<far_baselines::AllGeometry>(),
        },
        Entry {
            kind: Kind::FarField,
            name: "incremental-tdm",
            summary: "Panoramic samples as depth meshes, each with only what its ancestors have not seen",
            source: incremental!("3 and 4"),
            settings: settings_of::<far_itdm::IncrementalTdm>(),
        },
        Entry {
            kind: Kind::FarField,
            name: "layered-depth-image",
            summary: "What is far as pictures with several samples a pixel, warped to the eye",
            source: placement!("4"),
            settings: settings_of::<far_ldi::LayeredDepthImage>(),
        },
        Entry {
            kind: Kind::FarField,
            name: "point-polygon-hlod",
            summary: "One octree of simplified nodes for near and far, with a bound of the error on screen",
            source: hierarchy!("3 and 4"),
            settings: settings_of::<far_hlod::PointPolygonHlod>(),
        },
        Entry {
            kind: Kind::FarField,
            name: "static-lod",
            summary: "A chain of discrete levels of detail an object, chosen by projected error",
            source: incremental!("5.4, its baseline"),
            settings: settings_of::<far_baselines::StaticLod>(),
        },
        Entry {
            kind: Kind::FarField,
            name: "textured-depth-mesh",
            summary: "One panoramic sample as a depth mesh with its skins",
            source: incremental!("5.4, the baseline"),
            settings: settings_of::<far_itdm::TexturedDepthMesh>(),
        },
        Entry {
            kind: Kind::FarField,
            name: "textured-lod-mesh",
            summary: "Distant objects as small meshes that wear pictures of themselves",
            source: textured!("3.1.2-3.1.5 and 3.2"),
            settings: settings_of::<far_textured_mesh::TexturedLodMesh>(),
        },
        Entry {
            kind: Kind::Partition,
            name: "adaptive-grid",
            summary: "A grid of viewpoints, as dense as a triangle budget for every view demands",
            source: "Automatic image placement (Aliaga, Lastra 1999), sections 3 and 5",
            settings: settings_of::<partition_adaptive_grid::AdaptiveGrid>(),
        },
        Entry {
            kind: Kind::Partition,
            name: "hex-cells",
            summary: "Hexagonal cells of viewpoints on the ground plane, six windows each",
            source: textured!("3.1.1"),
            settings: settings_of::<partition_hex::HexCells>(),
        },
        Entry {
            kind: Kind::Partition,
            name: "octree-regions",
            summary: "Cubes of an octree, as large as a number of triangles inside allows",
            source: incremental!("3.1.1 and 5.1"),
            settings: settings_of::<partition_octree::OctreeRegions>(),
        },
        Entry {
            kind: Kind::Partition,
            name: "single-cell",
            summary: "One cell for every viewpoint, or for a box of them",
            source: "farfield",
            settings: settings_of::<partition_single_cell::SingleCell>(),
        },
        Entry {
            kind: Kind::Scheduler,
            name: "load-on-entry",
            summary: "Fetches what the active cell wants when it is entered, frees the rest",
            source: "farfield; the baseline without prefetching",
            settings: settings_of::<schedulers::LoadOnEntry>(),
        },
        Entry {
            kind: Kind::Scheduler,
            name: "movement-priority",
            summary: "Fetches in the order of the movement that the viewer would need before a block matters",
            source: hierarchy!("4.3"),
            settings: settings_of::<schedulers::MovementPriority>(),
        },
        Entry {
            kind: Kind::Scheduler,
            name: "near-to-far-lru",
            summary: "Fetches what stands within a radius near to far, frees what was used longest ago",
            source: placement!("5"),
            settings: settings_of::<schedulers::NearToFarLru>(),
        },
        Entry {
            kind: Kind::SimplificationMetric,
            name: "appearance",
            summary: "Distance from the original surface and to the original's looks, a bound and an estimate",
            source: hierarchy!("3.1"),
            settings: settings_of::<metrics::Appearance>(),
        },
        Entry {
            kind: Kind::SimplificationMetric,
            name: "hausdorff",
            summary: "A bound on the two-sided distance from the original surface",
            source: hierarchy!("3, its purely geometric measure"),
            settings: settings_of::<metrics::Hausdorff>(),
        },
        Entry {
            kind: Kind::SimplificationMetric,
            name: "quadric",
            summary: "How far a collapse moves the surface, in pixels",
            source: "Surface simplification using quadric error metrics (Garland, Heckbert 1997), sections 5 and 6",
            settings: settings_of::<metrics::Quadric>(),
        },
        Entry {
            kind: Kind::SimplificationMetric,
            name: "silhouette-weighted",
            summary: "Bend, projected length and importance on depth images",
            source: textured!("3.1.3.3"),
            settings: settings_of::<metrics::SilhouetteWeighted>(),
        },
        Entry {
            kind: Kind::VisibilityMetric,
            name: "self-occlusion",
            summary: "How far a viewer can look behind an object's own silhouette, in pixels",
            source: textured!("3.1.2"),
            settings: settings_of::<metrics::SelfOcclusion>(),
        },
        Entry {
            kind: Kind::VisibilityMetric,
            name: "void-surface",
            summary: "The solid angle in which viewpoints may see what no sample saw",
            source: incremental!("3.3 to 3.5"),
            settings: settings_of::<metrics::VoidSurface>(),
        },
    ]
}

/// Keeps the strategies' self-registration in the program. A library that nothing names may be left out by the linker; a
/// program that reads strategies by name calls this once.
pub fn link() -> usize {
    registry().len()
}

#[cfg(test)]
mod tests;
