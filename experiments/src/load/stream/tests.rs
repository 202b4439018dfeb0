//! Scenes on disk are those in memory, bit for bit.

use std::sync::atomic::AtomicBool;

use farfield_core::mesh::ChunkMesh;
use farfield_core::scene::Scene;
use glam::Vec3;
use rand::SeedableRng;

use super::*;
use crate::load;

static NEVER: AtomicBool = AtomicBool::new(false);

fn store(folder: &Path) -> Store {
    Store::open(folder, Box::new(|m| panic!("{m}"))).unwrap()
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
