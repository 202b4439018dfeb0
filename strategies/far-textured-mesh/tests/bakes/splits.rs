//! A cell with two splits: each draws its own far chunks through its own windows, and what both share is baked once.

use std::collections::BTreeSet;

use crate::common::*;
use farfield_core::cell::{Active, Sector, Split};
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, Block, ChunkId, MaterialId, SectorId, SplitId};
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{ChunkSet, Material, Placement, Scene, SceneBuilder};
use farfield_core::strategy::View;
use glam::{DAffine3, DVec3, Vec3};

/// Three octahedra ahead of the origin, and one there that keeps it in the middle.
fn scene() -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material::default());
    let mut m = TriangleMesh {
        positions: [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z].map(|p| (p + Vec3::Y) * 3.0).to_vec(),
        indices: vec![0, 1, 2, 1, 3, 2, 3, 4, 2, 4, 0, 2, 1, 0, 5, 3, 1, 5, 4, 3, 5, 0, 4, 5],
        ..TriangleMesh::default()
    };
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    let mesh = b.mesh("octahedron", m).unwrap();
    for (x, z) in [(0.0, 0.0), (-15.0, -40.0), (0.0, -40.0), (15.0, -40.0), (0.0, 40.0)] {
        b.place(Placement { mesh, transform: DAffine3::from_translation(DVec3::new(x, 0.0, z)) });
    }
    b.build().unwrap()
}

#[test]
fn each_split_draws_its_own_and_what_they_share_is_baked_once() {
    let s = scene();
    let v = views(3.0, 256);
    let cells = hexagons(&s, &v, 10.0, 1.0);
    let baker = Baker::new(&s, &v);
    let mut cell = baker.inside(&*cells, cell_at(&*cells, &v, 10.0, 0));
    let of = |objects: &[u32]| -> ChunkSet {
        let ids = (0..s.chunks.len() as u32).map(ChunkId);
        ids.filter(|c| objects.contains(&s.chunks[c.index()].object.0)).collect()
    };
    let far = [of(&[1, 2]), of(&[2, 3])];
    let windows = cell.sectors.clone();
    let through = |k: usize| {
        let far = &far;
        windows.iter().map(move |w| Sector {
            split: SplitId(k as u32),
            seen: w.seen.intersection(&far[k]),
            ..w.clone()
        })
    };
    cell.sectors = through(0).chain(through(1)).collect();
    cell.splits = far.iter().map(|f| Split { far: f.clone(), near_budget: None }).collect();
    let kept = baker.bake(&*textured(""), &cell, cells.outlines()).unwrap();
    let meshes = kept.payloads.values().filter(|p| p.triangles() > 0).count();
    assert_eq!(meshes, 3, "one an object, whatever the splits");
    assert!(triangles(&kept) <= 3 * 8);

    let open = textured("").open(None, (AssetId(3), &kept.index)).unwrap();
    let camera = v.camera(cell.outline.centre.as_dvec3(), 0.0, 0.0);
    for (split, expected) in [(0, [2, 3]), (1, [3, 4])] {
        // All windows of both splits are given: those of the other show nothing.
        let at = Active {
            cell: cell.outline.id,
            split: SplitId(split),
            sectors: (0..cell.sectors.len() as u32).map(SectorId).collect(),
        };
        let view =
            View { scene: &s, camera: &camera, at: &at, tolerance: &|_| 0.0, budget: Default::default(), cell: None };
        let (mut draws, mut wanted): (Vec<Draw>, Vec<_>) = (vec![], vec![]);
        assert_eq!(open.draw(&|_| true, &view, &mut draws).missing, 0);
        open.wanted(&view, &mut wanted);
        let drawn = draws.iter().map(|d| match &d.what {
            DrawWhat::Payload { object, .. } => *object,
            DrawWhat::Chunks(_) => panic!("plain geometry"),
        });
        assert_eq!(drawn.collect::<BTreeSet<u32>>(), BTreeSet::from(expected), "split {split}");
        assert_eq!(wanted.iter().map(|c| c.block).collect::<BTreeSet<Block>>().len(), wanted.len(), "a block twice");
        assert_eq!(
            wanted.len(),
            kept.payloads.len(),
            "payloads of the other split are wanted too, for when it becomes active"
        );
        let seen = wanted.iter().filter(|c| c.in_view && c.after.is_some()).count();
        assert_eq!(seen, 2);
    }
}
