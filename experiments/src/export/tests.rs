//! What is written is read back as the same scene.

use farfield_core::id::{MaterialId, TextureId};
use farfield_core::scene::{Material, Texture};
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3};

use super::*;
use crate::load::{LoadOptions, load, load_mesh, merge};

type Made = (Vec<(String, TriangleMesh)>, Vec<(usize, DAffine3)>, Vec<Material>, Vec<Texture>);

fn scene() -> Made {
    let mut tetrahedron = TriangleMesh {
        positions: vec![Vec3::new(0.1, 0.2, 0.3), Vec3::X, Vec3::Y, Vec3::Z],
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE],
        colors: vec![[0, 1, 2, 255], [10, 100, 200, 255], [127, 128, 129, 255], [255, 254, 3, 255]],
        indices: vec![0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3],
        sections: vec![(0..6, MaterialId(0)), (6..12, MaterialId(1))],
        ..Default::default()
    };
    tetrahedron.smooth_normals();
    let flat = TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        indices: vec![0, 1, 2],
        sections: vec![(0..3, MaterialId(1))],
        ..Default::default()
    };
    let turned = DAffine3::from_scale_rotation_translation(
        DVec3::new(2.0, 2.0, 2.0),
        DQuat::from_rotation_y(0.5),
        DVec3::new(10.0, 0.0, -3.0),
    );
    let mirrored = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let materials = vec![
        Material { name: "red stone".into(), base_color: [0.5, 0.1, 0.1, 1.0], texture: None, two_sided: true },
        Material { name: "cloth".into(), base_color: [1.0; 4], texture: Some(TextureId(0)), two_sided: false },
    ];
    let texture = Texture { name: "t".into(), size: [2, 1], rgba: vec![[1, 2, 3, 255], [200, 100, 50, 255]] };
    let meshes = vec![("tetra hedron".to_owned(), tetrahedron), ("flat".to_owned(), flat)];
    (meshes, vec![(0, turned), (0, mirrored), (1, DAffine3::IDENTITY)], materials, vec![texture])
}

/// Triangles as corner positions with colours, in an order that does not depend on the numbering.
fn triangles(m: &TriangleMesh) -> Vec<[[f32; 3]; 3]> {
    let mut out: Vec<_> = m
        .indices
        .chunks_exact(3)
        .map(|t| {
            let mut t = [0, 1, 2].map(|k| m.positions[t[k] as usize].to_array());
            // Turn the least corner to the front: the winding stays.
            let least = (0..3).min_by(|&a, &b| t[a].partial_cmp(&t[b]).unwrap()).unwrap();
            t.rotate_left(least);
            t
        })
        .collect();
    out.sort_by(|a, b| a.partial_cmp(b).unwrap());
    out
}

fn assert_close(a: &TriangleMesh, b: &TriangleMesh) {
    let (a, b) = (triangles(a), triangles(b));
    assert_eq!(a.len(), b.len());
    for (x, y) in a.iter().flatten().flatten().zip(b.iter().flatten().flatten()) {
        assert!((x - y).abs() <= 1e-5 * x.abs().max(1.0), "{x} {y}");
    }
}

#[test]
fn every_format_gives_the_same_triangles_back() {
    let (meshes, placements, materials, textures) = scene();
    let dir = tempfile::tempdir().unwrap();
    let placed: Vec<_> = placements.iter().map(|(i, t)| (&meshes[*i].1, *t)).collect();
    let want = merge(&placed);
    let one = Export { meshes: &meshes, placements: &placements, materials: &materials, textures: &textures };
    for name in ["a.glb", "a.obj", "a.ply"] {
        let path = dir.path().join(name);
        export(&path, &one).unwrap();
        let (mesh, got, pictures) = load_mesh(&path, &LoadOptions::default()).unwrap();
        assert_close(&want, &mesh);
        assert_eq!(mesh.normals.len(), mesh.positions.len(), "{name}");
        let first = std::fs::read(&path).unwrap();
        export(&path, &one).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), first, "{name}: the same scene gives the same bytes");
        if name != "a.ply" {
            assert_eq!(pictures[0].rgba, textures[0].rgba, "{name}");
            let red = got.iter().find(|m| m.name.starts_with("red")).unwrap();
            assert!(red.base_color.iter().zip([0.5, 0.1, 0.1, 1.0]).all(|(a, b)| (a - b).abs() < 1e-5), "{red:?}");
            assert!(got.iter().any(|m| m.texture == Some(TextureId(0))));
        }
    }
}

#[test]
fn glb_keeps_instances_and_every_colour() {
    let (mut meshes, placements, materials, textures) = scene();
    let all: Vec<[u8; 4]> = (0..=255).map(|c| [c, 255 - c, c, 255]).collect();
    let n = all.len() as u32;
    let strip: Vec<u32> = (0..n - 2).flat_map(|i| [i, i + 1, i + 2]).collect();
    meshes[0].1 = TriangleMesh {
        positions: (0..n).map(|i| Vec3::new(i as f32, (i % 2) as f32, (i / 7) as f32 * 0.5)).collect(),
        colors: all,
        sections: vec![(0..strip.len() as u32, MaterialId(0))],
        indices: strip,
        ..Default::default()
    };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("b.glb");
    export(&path, &Export { meshes: &meshes, placements: &placements, materials: &materials, textures: &textures })
        .unwrap();
    let loaded = load(&path, &LoadOptions::default()).unwrap();
    assert_eq!((loaded.counts.meshes, loaded.counts.placed_parts), (2, 3));
    let (mesh, ..) = load_mesh(&path, &LoadOptions::default()).unwrap();
    for (p, c) in mesh.positions.iter().zip(&mesh.colors).filter(|(p, _)| p.x <= 0.0 && p.z >= 0.0) {
        // The mirrored copy stands at x = -i.
        let i = (-p.x).round() as u8;
        assert!([[i, 255 - i, i, 255], [255; 4]].contains(c), "{p} {c:?}");
    }
    let scene = loaded.builder.build().unwrap();
    assert_eq!(scene.objects.len(), 3);
    assert!(scene.objects.iter().all(|o| o.placement.matrix3.determinant() > 0.0), "mirrors are in the meshes");
}

#[test]
fn ply_multiplies_base_colours_in() {
    let (meshes, _, materials, textures) = scene();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("c.ply");
    let placements = [(1, DAffine3::IDENTITY)];
    let mut materials = materials;
    materials[1].base_color = [0.214_041_14, 1.0, 0.0, 1.0];
    export(&path, &Export { meshes: &meshes, placements: &placements, materials: &materials, textures: &textures })
        .unwrap();
    let (mesh, ..) = load_mesh(&path, &LoadOptions::default()).unwrap();
    // sRGB 0.5 is linear 0.21404; 0.5 x 255 rounds to 128.
    assert!(mesh.colors.iter().all(|c| *c == [128, 255, 0, 255]), "{:?}", mesh.colors);
}

#[test]
fn what_cannot_be_written_is_refused() {
    let (meshes, placements, materials, textures) = scene();
    let say = |path: &str, e: &Export| export(Path::new(path), e).unwrap_err().to_string();
    let ok = Export { meshes: &meshes, placements: &placements, materials: &materials, textures: &textures };
    assert!(say("a.fbx", &ok).contains("a.fbx: scenes are written as .glb, .obj or .ply"));
    assert!(say("/nowhere/a.glb", &ok).contains("/nowhere/a.glb: cannot be written"));
    assert!(say("a.glb", &Export { placements: &[(7, DAffine3::IDENTITY)], ..ok }).contains("mesh 7 of 2"));
    assert!(say("a.glb", &Export { materials: &materials[..1], ..ok }).contains("material 1 of 1"));
    assert!(say("a.glb", &Export { textures: &[], ..ok }).contains("texture does not exist"));
}
