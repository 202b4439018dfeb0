//! Every real model either loads, and agrees with the manifest that came with it, or is refused for the reason listed here.
//!
//! Needs the folder that `FARFIELD_MODELS` names; without it the tests are skipped, visibly, and fail where
//! `FARFIELD_EXPECT_MODELS=1`. The manifest was made by other programs, so it is independent of the readers. Definitions:
//! - triangles: those loaded and those kept out for having no area, over all instances, are the manifest's;
//! - degenerate: at most the manifest's, which counts everything below 1e-14 of the squared box diagonal;
//! - duplicates: equal where the manifest has no degenerate triangles; glTF at most (there they are counted once a mesh);
//! - objects: meshes of OBJ, PLY and STL; primitives of glTF, whose instances are primitives a node;
//! - vertices: positions that differ, for OBJ, PLY and STL, at most the manifest's and, where no triangle was kept out, equal; box: within 1e-5 of its diagonal and the manifest's six digits.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use farfield_core::mesh::{TriangleMesh, position_ids};
use farfield_experiments::load::{LoadOptions, load, load_mesh};
use glam::Vec3;

/// Files that are refused, with what the error must say beside the file's name.
const REFUSED: [(&str, &str); 9] = [
    ("nasty/Cray_right.obj", "the square of its diagonal overflows 32-bit floats"),
    ("nasty/parser/OutOfMemory.off", "format .off: cannot be loaded; supported are .obj, .ply, .gltf, .glb and .stl"),
    ("nasty/parser/empty.obj", "the whole file: holds no triangles"),
    ("nasty/parser/empty.ply", "header: the file is empty"),
    ("nasty/parser/issue623.ply", "line 14 (vertex 0): Expected element of type"),
    ("nasty/parser/malformed.obj", "line 23: the face names vertex 12; 8 are defined before it"),
    ("nasty/parser/trimesh_empty.stl", "the whole file: holds no triangles"),
    ("nasty/parser/trimesh_points_emptyface.ply", "the whole file: holds no triangles"),
    ("textured/chess-board.glb", "extensionsRequired: KHR_draco_mesh_compression is required and not supported"),
];

/// Files with a concave polygon: the manifest's fan has a duplicate triangle there that ears have not.
const CONCAVE: [&str; 1] = ["nasty/parser/concave_polygon.obj"];

/// No file takes longer, unoptimised on a busy machine.
const MAX_TIME: Duration = Duration::from_secs(30);

fn models() -> Option<PathBuf> {
    match std::env::var_os("FARFIELD_MODELS") {
        Some(path) => Some(path.into()),
        None if std::env::var_os("FARFIELD_EXPECT_MODELS").is_some_and(|v| v == "1") => {
            panic!("FARFIELD_EXPECT_MODELS=1, but FARFIELD_MODELS is not set")
        }
        None => {
            eprintln!("SKIPPED: models: set FARFIELD_MODELS");
            None
        }
    }
}

type Row = BTreeMap<String, String>;

fn manifest(folder: &Path) -> Vec<Row> {
    let text = std::fs::read_to_string(folder.join("MANIFEST.tsv")).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split('\t').collect();
    lines.map(|l| head.iter().zip(l.split('\t')).map(|(k, v)| (k.to_string(), v.to_owned())).collect()).collect()
}

fn count(row: &Row, key: &str) -> Option<usize> {
    row[key].parse().ok()
}

fn point(row: &Row, key: &str) -> Vec3 {
    let v: Vec<f32> = row[key].split_whitespace().map(|w| w.parse().unwrap()).collect();
    Vec3::from_slice(&v)
}

fn distinct(m: &TriangleMesh) -> usize {
    position_ids(&m.positions).iter().enumerate().filter(|&(i, &id)| i == id as usize).count()
}

#[test]
fn every_model_loads_as_the_manifest_says_or_is_refused_as_listed() {
    let Some(folder) = models() else { return };
    let rows = manifest(&folder);
    assert!(rows.len() >= 70, "{} rows", rows.len());
    let mut wrong = vec![];
    for row in &rows {
        let name = row["path"].as_str();
        let started = Instant::now();
        let loaded = load(&folder.join(name), &LoadOptions::default());
        let merged = load_mesh(&folder.join(name), &LoadOptions::default());
        let took = started.elapsed();
        let mut check = |ok: bool, what: String| {
            if !ok {
                wrong.push(format!("{name}: {what}"));
            }
        };
        check(took < MAX_TIME, format!("took {took:?}"));
        let refused = REFUSED.iter().find(|(path, _)| *path == name).map(|(_, cause)| *cause);
        let (loaded, mesh) = match (loaded, merged, refused) {
            (Ok(l), Ok((m, ..)), None) => (l, m),
            (Err(a), Err(b), Some(cause)) => {
                let (a, b) = (a.to_string(), b.to_string());
                check(a == b && a.contains(name) && a.contains(cause), format!("refused with {a} and {b}"));
                continue;
            }
            (l, m, _) => {
                check(false, format!("{:?} {:?}, listed: {refused:?}", l.err().map(|e| e.to_string()), m.err()));
                continue;
            }
        };
        let c = loaded.counts;
        let gltf = name.contains(".gl");
        let same = |a: usize, key: &str| (Some(a) == count(row, key), format!("{a} {key}, not {}", row[key]));
        let most = |a: usize, key: &str| (Some(a) <= count(row, key), format!("{a} {key}, above {}", row[key]));
        let mut agree = |(ok, what): (bool, String)| check(ok, what);
        agree(same(c.triangles + c.degenerate_triangles, "triangles"));
        agree((mesh.triangles() == c.triangles, format!("{} merged, {} placed", mesh.triangles(), c.triangles)));
        agree(most(c.degenerate_triangles, "degenerate_faces"));
        agree(most(c.duplicate_triangles, "duplicate_faces"));
        if !gltf && row["degenerate_faces"] == "0" && !CONCAVE.contains(&name) {
            agree(same(c.duplicate_triangles, "duplicate_faces"));
        }
        agree(same(if gltf { c.parts } else { c.meshes }, "objects"));
        agree(same(c.placed_parts.min(if gltf { usize::MAX } else { c.meshes }), "instances"));
        if !gltf {
            agree(most(distinct(&mesh), "vertices_welded"));
            if c.degenerate_triangles == 0 {
                agree(same(distinct(&mesh), "vertices_welded"));
            }
        }
        let b = farfield_core::Aabb::of(mesh.positions.iter().copied());
        let (low, high) = (point(row, "bbox_min"), point(row, "bbox_max"));
        let tolerance = 1e-5 * ((high - low).length() + low.abs().max_element().max(high.abs().max_element()));
        let off = (b.min - low).abs().max_element().max((b.max - high).abs().max_element());
        agree((off <= tolerance, format!("box {} .. {}, off by {off}", b.min, b.max)));
        agree((mesh.colors.is_empty() == (row["colour"] != "yes"), format!("colour: {}", row["colour"])));
        agree((mesh.uvs.is_empty() == (row["uv"] != "yes"), format!("uv: {}", row["uv"])));
        if !name.contains(".stl") {
            agree((mesh.normals.is_empty() == (row["normals"] != "yes"), format!("normals: {}", row["normals"])));
        }
        let used = loaded.builder.textures.len();
        agree((used <= count(row, "texture_images").unwrap_or(0), format!("{used} textures")));
        let placed = c.triangles;
        match loaded.builder.build() {
            Ok(scene) => {
                agree((scene.triangles() as usize == placed, format!("{} triangles built", scene.triangles())))
            }
            Err(e) => agree((false, e.to_string())),
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), rows.len(), wrong.join("\n"));
    if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
        let peak = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).unwrap();
        let kib: u64 = peak.split_whitespace().next().unwrap().parse().unwrap();
        assert!(kib < 1_500_000, "peak memory {kib} KiB");
    }
}

#[test]
fn textures_are_found_beside_their_materials() {
    let Some(folder) = models() else { return };
    for (name, textures) in [
        ("architecture/sterngarten/Sterngarten_Wien_innerArea-optimized.obj.gz", 15),
        ("architecture/vianney_house_2/scene.gltf", 2),
        ("textured/FlightHelmet/FlightHelmet.gltf", 5),
        ("textured/Duck.glb", 1),
    ] {
        let got = load(&folder.join(name), &LoadOptions::default()).unwrap();
        assert_eq!(got.builder.textures.len(), textures, "{name}: {:?}", got.warnings);
        assert!(got.builder.textures.iter().all(|t| t.rgba.len() == (t.size[0] * t.size[1]) as usize));
    }
}

/// Triangles as corners, in an order that does not depend on their numbering.
fn sorted(mut t: Vec<[Vec3; 3]>) -> Vec<[[f32; 3]; 3]> {
    let mut out: Vec<_> = t.drain(..).map(|t| t.map(|p| p.to_array())).collect();
    out.sort_by(|a, b| a.partial_cmp(b).unwrap());
    out
}

#[test]
fn obj_agrees_with_tobj_triangle_by_triangle() {
    let Some(folder) = models() else { return };
    let mut compared = 0;
    for row in manifest(&folder) {
        let name = &row["path"];
        if !name.contains(".obj") || REFUSED.iter().any(|(r, _)| r == name) {
            continue;
        }
        let raw = std::fs::read(folder.join(name)).unwrap();
        let mut data = vec![];
        if name.ends_with(".gz") {
            std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&raw[..]), &mut data).unwrap();
        } else {
            data = raw;
        }
        let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
        let none = |_: &Path| tobj::load_mtl_buf(&mut &b""[..]);
        // What tobj itself cannot read: UTF-16, `usemtl` without a name, attributes of some faces only.
        let Ok((models, _)) = tobj::load_obj_buf(&mut &data[..], &options, none) else {
            eprintln!("tobj does not read {name}");
            continue;
        };
        if row["non_triangle_polygons"] != "0" {
            continue;
        }
        let mut theirs = vec![];
        for m in &models {
            let at = |i: u32| Vec3::from_slice(&m.mesh.positions[3 * i as usize..3 * i as usize + 3]);
            theirs.extend(m.mesh.indices.chunks_exact(3).map(|t| [at(t[0]), at(t[1]), at(t[2])]));
        }
        theirs.retain(|t| {
            let [a, b, c] = t.map(|p| p.as_dvec3());
            (b - a).cross(c - a) != glam::DVec3::ZERO
        });
        let (mesh, ..) = load_mesh(&folder.join(name), &LoadOptions::default()).unwrap();
        let ours = mesh.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|k| mesh.positions[t[k] as usize])).collect();
        let (ours, theirs) = (sorted(ours), sorted(theirs));
        assert_eq!(ours.len(), theirs.len(), "{name}");
        if let Some(i) = (0..ours.len()).find(|&i| ours[i] != theirs[i]) {
            panic!("{name}: triangle {i}: {:?}, tobj {:?}", ours[i], theirs[i]);
        }
        compared += 1;
    }
    assert!(compared >= 30, "{compared} files compared");
}
