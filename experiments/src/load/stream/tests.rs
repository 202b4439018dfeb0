//! Scenes on disk are those in memory, bit for bit.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use farfield_core::mesh::ChunkMesh;
use farfield_core::scene::Scene;
use glam::Vec3;
use rand::SeedableRng;

use super::*;
use crate::load;

static NEVER: AtomicBool = AtomicBool::new(false);

fn store(folder: &Path) -> Store {
    Store::open(folder, Arc::new(|m| panic!("{m}"))).unwrap()
}

/// The scene of a file on disk, cut with a limit that makes it divide several times.
fn streamed(
    path: &Path,
    options: &LoadOptions,
    store: &Store,
    memory_bytes: u64,
) -> Result<(Scene, Vec<String>), LoadError> {
    let keep = Keep { store, memory_bytes, cancel: &NEVER, say: &|_| () };
    let s = open(path, options, &keep)?;
    Ok((s.builder.build_over(Box::new(s.file)).unwrap(), s.warnings))
}

fn chunks(scene: &Scene) -> Vec<ChunkMesh> {
    let mut out = vec![];
    for id in scene.mesh_chunk_ids() {
        scene.geometry.with(id, &mut |c| out.push(c.clone())).unwrap();
    }
    out
}

/// Both ways of loading give the same scene.
#[track_caller]
fn check_same(path: &Path, options: &LoadOptions) -> Scene {
    let held = load::load(path, options).unwrap();
    let (warnings, held) = (held.warnings, held.builder.build().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let (disk, told) = streamed(path, options, &store(folder.path()), 3 << 20).unwrap();
    let counted = |w: &&String| !w.contains("duplicate triangles");
    assert_eq!(warnings.iter().filter(counted).collect::<Vec<_>>(), told.iter().collect::<Vec<_>>());
    assert_eq!(held.meshes.len(), disk.meshes.len());
    for (a, b) in held.meshes.iter().zip(&disk.meshes) {
        assert_eq!((&a.name, a.triangles, a.vertex_ids), (&b.name, b.triangles, b.vertex_ids));
        assert_eq!(a.chunks, b.chunks, "{}", a.name);
    }
    for (i, (a, b)) in chunks(&held).iter().zip(&chunks(&disk)).enumerate() {
        // -0 and 0 differ here.
        assert_eq!(format!("{a:?}"), format!("{b:?}"), "chunk {i}");
    }
    assert_eq!(held.materials, disk.materials);
    assert_eq!(held.textures, disk.textures);
    assert_eq!(held.digest, disk.digest);
    disk
}

/// A bumpy ball of `12 n^2` triangles: positions and triangles, in a random order where `shuffle`.
fn ball(n: u32, shuffle: bool) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let rings = 2 * n;
    let around = 3 * n;
    let mut positions = vec![];
    for r in 0..=rings {
        for a in 0..around {
            let (t, p) = (
                f64::from(r) / f64::from(rings) * std::f64::consts::PI,
                f64::from(a) / f64::from(around) * std::f64::consts::TAU,
            );
            let radius = 5.0 + 0.3 * (9.0 * p).sin() * (7.0 * t).sin();
            let q = DVec3::new(t.sin() * p.cos(), t.cos(), t.sin() * p.sin()) * radius;
            positions.push(q.as_vec3().to_array());
        }
    }
    let mut triangles = vec![];
    for r in 0..rings {
        for a in 0..around {
            let at = |r: u32, a: u32| r * around + a % around;
            triangles.push([at(r, a), at(r, a + 1), at(r + 1, a)]);
            triangles.push([at(r, a + 1), at(r + 1, a + 1), at(r + 1, a)]);
        }
    }
    if shuffle {
        use rand::seq::SliceRandom;
        triangles.shuffle(&mut rng);
        let mut names: Vec<u32> = (0..positions.len() as u32).collect();
        names.shuffle(&mut rng);
        let mut moved = positions.clone();
        names.iter().zip(&positions).for_each(|(&n, &p)| moved[n as usize] = p);
        positions = moved;
        triangles.iter_mut().for_each(|t| *t = t.map(|v| names[v as usize]));
    }
    (positions, triangles)
}

enum Ply {
    Ascii,
    Little,
    Big,
}

/// The ball as PLY, with attributes where asked for.
fn ply(kind: Ply, (positions, triangles): &(Vec<[f32; 3]>, Vec<[u32; 3]>), normals: bool, colors: bool) -> Vec<u8> {
    let format = match kind {
        Ply::Ascii => "ascii",
        Ply::Little => "binary_little_endian",
        Ply::Big => "binary_big_endian",
    };
    let mut out = format!(
        "ply\nformat {format} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n",
        positions.len()
    );
    if normals {
        out += "property float nx\nproperty float ny\nproperty float nz\n";
    }
    if colors {
        out += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    }
    out += &format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", triangles.len());
    let mut out = out.into_bytes();
    let floats = |out: &mut Vec<u8>, values: &[f32]| {
        for v in values {
            match kind {
                Ply::Ascii => out.extend(format!("{v} ").bytes()),
                Ply::Little => out.extend(v.to_le_bytes()),
                Ply::Big => out.extend(v.to_be_bytes()),
            }
        }
    };
    for (i, p) in positions.iter().enumerate() {
        floats(&mut out, p);
        if normals {
            // Every ninth vertex has none.
            let n = if i % 9 == 0 { Vec3::ZERO } else { Vec3::from(*p).normalize() };
            floats(&mut out, &n.to_array());
        }
        let color = [i as u8, (i / 3) as u8, 9];
        match kind {
            Ply::Ascii if colors => out.extend(color.iter().flat_map(|c| format!("{c} ").into_bytes())),
            _ if colors => out.extend(color),
            _ => {}
        }
        if matches!(kind, Ply::Ascii) {
            out.push(b'\n');
        }
    }
    for t in triangles {
        match kind {
            Ply::Ascii => out.extend(format!("3 {} {} {}\n", t[0], t[1], t[2]).bytes()),
            Ply::Little => {
                out.push(3);
                t.iter().for_each(|v| out.extend((*v as i32).to_le_bytes()));
            }
            Ply::Big => {
                out.push(3);
                t.iter().for_each(|v| out.extend((*v as i32).to_be_bytes()));
            }
        }
    }
    out
}

fn put(folder: &Path, name: &str, data: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, data).unwrap();
    path
}

fn packed(data: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut out = flate2::write::GzEncoder::new(vec![], flate2::Compression::fast());
    out.write_all(data).unwrap();
    out.finish().unwrap()
}

#[test]
fn a_ply_on_disk_is_the_ply_in_memory() {
    let dir = tempfile::tempdir().unwrap();
    let options = LoadOptions::default();
    // Ten batches of triangles and more; the seam and the poles have several vertices a position.
    let (plain, mixed) = (ball(90, false), ball(90, true));
    let scene = check_same(&put(dir.path(), "a.ply", &ply(Ply::Little, &plain, false, false)), &options);
    assert!(scene.triangles() > 95_000 && scene.meshes[0].vertex_ids < plain.0.len() as u32);
    check_same(&put(dir.path(), "b.ply", &ply(Ply::Big, &mixed, false, true)), &options);
    check_same(&put(dir.path(), "c.ply", &ply(Ply::Little, &mixed, true, false)), &options);
    check_same(&put(dir.path(), "d.ply.gz", &packed(&ply(Ply::Ascii, &ball(50, true), true, true))), &options);
    let far = LoadOptions { up: load::Up::Z, scale: 0.01, two_sided: Some(false) };
    let moved = (plain.0.iter().map(|p| [p[0] + 5e4, p[1], p[2]]).collect(), plain.1.clone());
    check_same(&put(dir.path(), "e.ply", &ply(Ply::Little, &moved, false, false)), &far);
}

/// The ball as OBJ: two meshes, three materials that take turns, texture coordinates and normals at some corners, colours.
fn obj((positions, triangles): &(Vec<[f32; 3]>, Vec<[u32; 3]>), colors: bool) -> String {
    use std::fmt::Write;
    let mut out = String::from("mtllib a.mtl\n");
    for (i, p) in positions.iter().enumerate() {
        write!(out, "v {} {} {}", p[0], p[1], p[2]).unwrap();
        out += if colors && i % 2 == 0 { " 0.5 0.25 1\n" } else { "\n" };
    }
    for k in 0..50 {
        writeln!(out, "vt {} 0.{k}", f64::from(k) / 7.0).unwrap();
    }
    out += "vn 0 0 2\nvn 0 1 0\n";
    for (i, [a, b, c]) in triangles.iter().map(|t| t.map(|v| v + 1)).enumerate() {
        if i == triangles.len() / 3 {
            out += "o second\n";
        }
        if i % 1000 == 0 {
            writeln!(out, "usemtl {}", ["stone", "moss", "gold"][i / 1000 % 3]).unwrap();
        }
        match i % 4 {
            0 => writeln!(out, "f {a} {b} {c}"),
            1 => writeln!(out, "f {a}/{0} {b}/{0} {c}/1", 1 + i % 50),
            2 => writeln!(out, "f {a}//1 {b}//2 {c}//1"),
            _ => writeln!(out, "f {a}/{0}/2 {b}/2/2 {c}/3/1", 1 + i % 50),
        }
        .unwrap();
    }
    // A quad that is not planar, a polygon that is not convex, triangles without area.
    out + "o last\nv 0 0 20\nv 1 0 20\nv 1 1 21\nv 0 1 20\nf -4 -3 -2 -1\nv 0 0 30\nv 2 0 30\nv 0.4 0.4 30\nv 0 2 30\n\
           f -4 -3 -2 -1\nf -1 -1 -2\n"
}

#[test]
fn an_obj_on_disk_is_the_obj_in_memory() {
    let dir = tempfile::tempdir().unwrap();
    let mut png = std::io::Cursor::new(vec![]);
    image::RgbaImage::from_fn(4, 2, |x, y| image::Rgba([x as u8 * 60, y as u8 * 200, 7, 255]))
        .write_to(&mut png, image::ImageFormat::Png)
        .unwrap();
    put(dir.path(), "moss.png", &png.into_inner());
    put(dir.path(), "a.mtl", b"newmtl stone\nKd 0.5 0.5 0.4\nnewmtl moss\nmap_Kd moss.png\nnewmtl iron\n");
    for (name, colors, mixed) in [("a.obj", false, false), ("b.obj", true, true)] {
        let scene =
            check_same(&put(dir.path(), name, obj(&ball(60, mixed), colors).as_bytes()), &LoadOptions::default());
        assert_eq!(scene.meshes.len(), 3);
        assert_eq!((scene.materials.len(), scene.textures.len()), (4, 1));
    }
    // All model files of a folder are one scene.
    put(dir.path(), "c.ply", &ply(Ply::Little, &ball(20, false), false, false));
    assert_eq!(check_same(dir.path(), &LoadOptions::default()).meshes.len(), 7);
}

/// The ball as glTF with its buffer in a file or in a GLB: placed three times, mirrored once; strips and fans that share vertices.
fn gltf((positions, triangles): &(Vec<[f32; 3]>, Vec<[u32; 3]>), glb: bool, normals: bool) -> (Vec<u8>, Vec<u8>) {
    let mut bin: Vec<u8> = positions.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let at_normals = bin.len();
    for p in positions {
        bin.extend((Vec3::from(*p) + 0.1).normalize().to_array().iter().flat_map(|v| v.to_le_bytes()));
    }
    let at_indices = bin.len();
    bin.extend(triangles.iter().flatten().flat_map(|v| v.to_le_bytes()));
    let at_strip = bin.len();
    bin.extend((500_u32..9000).flat_map(u32::to_le_bytes));
    let (n, t) = (positions.len(), 3 * triangles.len());
    let normal = if normals { ", \"NORMAL\": 1" } else { "" };
    let uri = if glb { "" } else { "\"uri\": \"a.bin\", " };
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 1, 2]}}],
        "nodes": [{{"mesh": 0}}, {{"mesh": 0, "translation": [20, 0, 0], "scale": [-1, 1, 2]}}, {{"mesh": 1, "translation": [0, 30, 0]}}],
        "meshes": [{{"name": "ball", "primitives": [{{"attributes": {{"POSITION": 0{normal}}}, "indices": 2, "material": 1}},
            {{"attributes": {{"POSITION": 0}}, "indices": 3, "mode": 5, "material": 0}}]}},
            {{"primitives": [{{"attributes": {{"POSITION": 0, "NORMAL": 1}}, "indices": 3, "mode": 6}}]}}],
        "materials": [{{"name": "a"}}, {{"name": "b", "doubleSided": true}}],
        "buffers": [{{{uri}"byteLength": {}}}],
        "bufferViews": [{{"buffer": 0, "byteLength": {at_normals}}}, {{"buffer": 0, "byteOffset": {at_normals}, "byteLength": {at_normals}}},
            {{"buffer": 0, "byteOffset": {at_indices}, "byteLength": {}}}, {{"buffer": 0, "byteOffset": {at_strip}, "byteLength": 34000}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": {n}, "type": "VEC3", "min": [-9, -9, -9], "max": [9, 9, 9]}},
            {{"bufferView": 1, "componentType": 5126, "count": {n}, "type": "VEC3"}},
            {{"bufferView": 2, "componentType": 5125, "count": {t}, "type": "SCALAR"}},
            {{"bufferView": 3, "componentType": 5125, "count": 8500, "type": "SCALAR"}}]}}"#,
        bin.len(),
        4 * t
    );
    if !glb {
        return (json.into_bytes(), bin);
    }
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    for n in [2, 28 + json.len() + bin.len(), json.len()] {
        out.extend((n as u32).to_le_bytes());
    }
    out.extend(b"JSON");
    out.extend(&json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(&bin);
    (out, bin)
}

/// A pipe would make whoever opens it wait for a writer.
#[test]
fn a_buffer_that_is_a_pipe_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = put(dir.path(), "a.gltf", &gltf(&ball(60, true), false, true).0);
    let made = std::process::Command::new("mkfifo").arg(dir.path().join("a.bin")).status();
    assert!(made.unwrap().success());
    let store = store(&dir.path().join("store"));
    let keep = Keep { store: &store, memory_bytes: 2 << 20, cancel: &NEVER, say: &|_| () };
    let refused = open(&path, &LoadOptions::default(), &keep).map(drop).unwrap_err().to_string();
    assert!(refused.contains("a.bin") && refused.contains("not a plain file"), "{refused}");
}

#[test]
fn a_gltf_on_disk_is_the_gltf_in_memory() {
    let dir = tempfile::tempdir().unwrap();
    let options = LoadOptions::default();
    for (glb, normals, mixed) in [(false, false, true), (true, true, false), (true, false, false)] {
        let (file, bin) = gltf(&ball(60, mixed), glb, normals);
        put(dir.path(), "a.bin", &bin);
        let path = put(dir.path(), if glb { "a.glb" } else { "a.gltf" }, &file);
        let scene = check_same(&path, &options);
        assert_eq!(
            scene.meshes.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(),
            ["ball", "ball (mirrored)", "mesh 1"]
        );
        assert!(scene.meshes[0].chunks.len() > 12 && scene.meshes[2].triangles > 4000);
        if glb {
            check_same(&put(dir.path(), "b.glb.gz", &packed(&file)), &options);
        }
    }
}

#[test]
fn the_paper_models_and_the_nasty_ones_are_the_same_both_ways() {
    let Some(models) = std::env::var_os("FARFIELD_MODELS") else {
        return eprintln!(
            "SKIPPED: the_paper_models_and_the_nasty_ones_are_the_same_both_ways: FARFIELD_MODELS is not set"
        );
    };
    let (mut same, mut refused, mut whole) = (0, 0, vec![]);
    let mut folders = vec![PathBuf::from(models)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if Format::of(&path).is_some() && std::fs::metadata(&path).unwrap().len() < 6 << 20 {
                let store_folder = tempfile::tempdir().unwrap();
                let disk = streamed(&path, &LoadOptions::default(), &store(store_folder.path()), 3 << 20);
                let told = disk.err().map(|e| e.to_string()).unwrap_or_default();
                match load::load(&path, &LoadOptions::default()) {
                    Ok(_) if told.contains(WHOLE) => whole.push(path),
                    Ok(_) => {
                        check_same(&path, &LoadOptions::default());
                        same += 1;
                    }
                    Err(held) => {
                        println!("{held}\n{told}\n");
                        assert!(told.contains(&path.display().to_string()), "{held} / {told}");
                        refused += 1;
                    }
                }
            }
        }
    }
    println!("{same} the same, {refused} refused, whole only: {whole:?}");
    assert!(same > 8 && whole.len() < 4);
}

fn scenes(store: &Store) -> Vec<PathBuf> {
    std::fs::read_dir(store.root().join("scenes")).into_iter().flatten().map(|e| e.unwrap().path()).collect()
}

#[test]
fn any_number_of_threads_and_any_limit_give_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let path = put(dir.path(), "a.ply", &ply(Ply::Little, &ball(100, true), true, true));
    let made = |threads: usize, memory_bytes: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path());
        pool.install(|| streamed(&path, &LoadOptions::default(), &store, memory_bytes).unwrap());
        std::fs::read(&scenes(&store)[0]).unwrap()
    };
    let one = made(1, 3 << 20);
    for (threads, memory_bytes) in [(2, 3 << 20), (5, 3 << 20), (3, 20 << 20), (2, 1 << 30)] {
        assert!(one == made(threads, memory_bytes), "{threads} threads, {memory_bytes} bytes");
    }
}

#[test]
fn the_limit_holds_while_a_scene_is_used_and_the_file_is_opened_again_as_it_is() {
    let dir = tempfile::tempdir().unwrap();
    let path = put(dir.path(), "a.ply", &ply(Ply::Little, &ball(100, false), false, false));
    let store = store(&dir.path().join("store"));
    let told = std::sync::Mutex::new(vec![]);
    let say = |line: &str| told.lock().unwrap().push(line.to_owned());
    let keep = |memory_bytes| Keep { store: &store, memory_bytes, cancel: &NEVER, say: &say };
    drop(open(&path, &LoadOptions::default(), &keep(3 << 20)).unwrap());
    assert_eq!(told.lock().unwrap().len(), 1);
    let bytes = std::fs::read(&scenes(&store)[0]).unwrap();
    let file = open(&path, &LoadOptions::default(), &keep(1 << 20)).unwrap().file;
    assert_eq!(told.lock().unwrap().len(), 1, "it is not cut again");
    let ids: Vec<_> = (0..file.kept().blocks[0].len() as u32)
        .map(|chunk| farfield_core::id::MeshChunkId { mesh: farfield_core::id::MeshId(0), chunk })
        .collect();
    use farfield_core::scene::Geometry;
    use rayon::prelude::*;
    let sum = |_| {
        ids.par_iter()
            .map(|&id| {
                let mut n = 0;
                file.with(id, &mut |c| n = c.indices.len() / 3).unwrap();
                n
            })
            .sum::<usize>()
    };
    assert_eq!((0..3).map(sum).collect::<Vec<_>>(), [file.kept().meshes[0].triangles as usize; 3]);
    assert!(file.peak_bytes() <= 1 << 20 && (bytes.len() as u64) > 2 * file.peak_bytes(), "{}", file.peak_bytes());
    // Damage to the header is seen at once, and the file made again.
    let mut bad = bytes.clone();
    bad[20] ^= 1;
    std::fs::write(&scenes(&store)[0], &bad).unwrap();
    drop(open(&path, &LoadOptions::default(), &keep(3 << 20)).unwrap());
    let told = told.lock().unwrap();
    assert!(told.len() == 3 && told[1].contains("header fails; it is made anew"), "{told:?}");
    assert!(std::fs::read(&scenes(&store)[0]).unwrap() == bytes);
}

#[test]
fn files_beside_the_model_count() {
    let dir = tempfile::tempdir().unwrap();
    let path = put(dir.path(), "a.obj", format!("{}usemtl iron\nf 1 2 3\n", obj(&ball(4, false), false)).as_bytes());
    let store = store(&dir.path().join("store"));
    let color = || streamed(&path, &LoadOptions::default(), &store, 3 << 20).unwrap().0.materials[0].base_color;
    let grey = color();
    put(dir.path(), "a.mtl", b"newmtl stone\nKd 1 0 0\n");
    let red = color();
    assert_eq!(red, [1.0, 0.0, 0.0, 1.0]);
    put(dir.path(), "a.mtl", b"newmtl stone\nKd 0 1 0\n");
    assert_eq!(color(), [0.0, 1.0, 0.0, 1.0]);
    std::fs::remove_file(dir.path().join("a.mtl")).unwrap();
    assert_eq!(color(), grey);
    assert_eq!(scenes(&store).len(), 1);
}

#[test]
fn a_file_that_changes_while_it_is_cut_is_told_and_not_kept() {
    let dir = tempfile::tempdir().unwrap();
    let balls = [20, 21].map(|n| ply(Ply::Little, &ball(n, false), false, false));
    let path = put(dir.path(), "a.ply", &balls[0]);
    let store = store(&dir.path().join("store"));
    // Between the digest and the reading.
    let change = |said: &str| {
        if said.contains("is cut into chunks") {
            put(dir.path(), "a.ply", &balls[1]);
        }
    };
    let keep = Keep { store: &store, memory_bytes: 2 << 20, cancel: &NEVER, say: &change };
    let e = open(&path, &LoadOptions::default(), &keep).err().unwrap().to_string();
    assert!(e.contains("a.ply") && e.contains("changed while it was read"), "{e}");
    assert!(scenes(&store).is_empty() && std::fs::read_dir(store.aside()).unwrap().count() == 0);
    // The next time it is what it has become.
    let (scene, _) = streamed(&path, &LoadOptions::default(), &store, 2 << 20).unwrap();
    assert_eq!(scene.triangles(), check_same(&path, &LoadOptions::default()).triangles());
    assert!(scene.triangles() > 12 * 20 * 20);
}

#[test]
fn interruption_and_bad_input_leave_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    let good = ply(Ply::Little, &ball(100, true), false, false);
    let path = put(dir.path(), "a.ply", &good);
    let store = store(&dir.path().join("store"));
    let left = || std::fs::read_dir(store.aside()).unwrap().count() + scenes(&store).len();
    let (mut stopped, mut whole) = (0, 0);
    for delay_ms in [0, 10, 30, 60, 100, 150, 250, 100_000] {
        let cancel = AtomicBool::new(false);
        let keep = Keep { store: &store, memory_bytes: 2 << 20, cancel: &cancel, say: &|_| () };
        let done = AtomicBool::new(false);
        let result = std::thread::scope(|s| {
            s.spawn(|| {
                let start = std::time::Instant::now();
                while start.elapsed().as_millis() < delay_ms && !done.load(Ordering::Relaxed) {
                    std::thread::sleep(std::time::Duration::from_millis(1));
                }
                cancel.store(true, Ordering::Relaxed);
            });
            let result = open(&path, &LoadOptions::default(), &keep).map(drop);
            done.store(true, Ordering::Relaxed);
            result
        });
        match result {
            Ok(()) => {
                whole += 1;
                assert_eq!(left(), 1);
                std::fs::remove_dir_all(store.root().join("scenes")).unwrap();
            }
            Err(e) => {
                assert!(matches!(e, LoadError::Cancelled), "{e}");
                assert_eq!(left(), 0);
                stopped += 1;
            }
        }
    }
    assert!(stopped > 0 && whole > 0, "{stopped} stopped, {whole} whole");
    // The last face names a vertex that is not there; the file ends too early.
    let mut bad = good.clone();
    let end = bad.len();
    bad[end - 4..].copy_from_slice(&i32::MAX.to_le_bytes());
    for (bytes, cause) in [(&bad[..], "names vertex 2147483647"), (&good[..end - 3], "failed to fill whole buffer")] {
        let e = streamed(&put(dir.path(), "b.ply", bytes), &LoadOptions::default(), &store, 2 << 20).err().unwrap();
        assert!(e.to_string().contains("b.ply: ") && e.to_string().contains(cause), "{e}");
        assert_eq!(left(), 0);
    }
    let e = streamed(&put(dir.path(), "c.ply.gz", &packed(&good[..end - 3])), &LoadOptions::default(), &store, 2 << 20);
    assert!(e.err().unwrap().to_string().contains("c.ply.gz: face "));
}
