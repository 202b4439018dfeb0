//! Damage is named, the limit holds, files are whole or not there.

use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use farfield_core::Fault;
use farfield_core::id::{MaterialId, MeshChunkId, MeshId};
use farfield_core::mesh::{ChunkMesh, TriangleMesh};
use farfield_core::scene::{Geometry, Material, Texture, cut};
use glam::Vec3;

use super::*;
use crate::store::Store;

/// A wavy sheet in chunks of at most 14 triangles, every second one with texture coordinates or colours.
fn chunks() -> farfield_core::scene::CutMesh {
    let n = 6_u32;
    let positions = (0..=n).flat_map(|z| (0..=n).map(move |x| Vec3::new(x as f32, (x * z % 5) as f32, z as f32)));
    let indices: Vec<u32> = (0..n * n)
        .flat_map(|i| {
            let a = i % n + i / n * (n + 1);
            [a, a + n + 1, a + 1, a + 1, a + n + 1, a + n + 2]
        })
        .collect();
    let sections = vec![(0..indices.len() as u32, MaterialId(0))];
    let mesh = TriangleMesh { positions: positions.collect(), indices, sections, ..Default::default() };
    let mut out = cut(mesh, 14);
    for (i, c) in out.chunks.iter_mut().enumerate() {
        if i % 2 == 0 {
            c.uvs = c.positions.iter().map(|p| p.truncate() * 0.1).collect();
        }
        if i % 3 == 0 {
            c.colors = c.positions.iter().map(|p| [p.x as u8, 7, 9, 255]).collect();
        }
    }
    out
}

fn id(chunk: usize) -> MeshChunkId {
    MeshChunkId { mesh: MeshId(0), chunk: chunk as u32 }
}

/// A file of two meshes (the same) and a texture; returns the chunks of one.
fn write(home: &Path, aside: &Path) -> Vec<ChunkMesh> {
    let mut w = Writer::new(aside).unwrap();
    for name in ["sheet", "again"] {
        let made = chunks();
        made.chunks.iter().for_each(|c| w.chunk(c).unwrap());
        w.mesh(name, made.infos, made.vertex_ids);
    }
    w.texture(&Texture { name: "t".into(), size: [2, 1], rgba: vec![[1, 2, 3, 4], [5, 6, 7, 8]] }).unwrap();
    w.kept().materials.push(Material::default());
    w.finish(home).unwrap();
    chunks().chunks
}

#[test]
fn what_is_written_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let home = dir.path().join("deep/scene.chunks");
    let all = write(&home, dir.path());
    assert!(all.len() > 5);
    let file = ChunkFile::open(&home, 1 << 20).unwrap();
    for (i, c) in all.iter().enumerate() {
        let mut calls = 0;
        file.with(id(i), &mut |got| {
            calls += 1;
            assert_eq!(got, c);
        })
        .unwrap();
        assert_eq!(calls, 1);
    }
    assert_eq!(file.textures().unwrap()[0].rgba, [[1, 2, 3, 4], [5, 6, 7, 8]]);
    assert_eq!(file.kept().meshes[0].digest, file.kept().meshes[1].digest);
    let none = file.with(id(all.len()), &mut |_| panic!("there is none")).unwrap_err();
    assert!(none.to_string().contains("there is no such chunk"));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "nothing is left aside");
    drop(Writer::new(dir.path()).unwrap());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "an unfinished file goes");
}

#[test]
fn every_flipped_byte_and_every_truncation_is_named_and_nothing_wrong_is_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let home = dir.path().join("scene.chunks");
    let all = write(&home, dir.path());
    let good = std::fs::read(&home).unwrap();
    let mut in_chunks = 0;
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 0x20;
        std::fs::write(&home, &bad).unwrap();
        let file = match ChunkFile::open(&home, 1 << 20) {
            Ok(file) => file,
            Err(e) => {
                assert!(e.to_string().contains("scene.chunks: "), "byte {at}: {e}");
                continue;
            }
        };
        let mut found = usize::from(file.textures().is_err());
        for mesh in 0..2 {
            for (i, c) in all.iter().enumerate() {
                let id = MeshChunkId { mesh: MeshId(mesh), chunk: i as u32 };
                let read = file.with(id, &mut |got| assert_eq!(got, c, "byte {at}"));
                if let Err(e) = read {
                    let name = ["sheet", "again"][mesh as usize];
                    let place = format!("scene.chunks: chunk {i} of mesh \"{name}\": the checksum of its ");
                    assert!(matches!(e, Fault::Data { .. }) && e.to_string().contains(&place), "byte {at}: {e}");
                    found += 1;
                    in_chunks += 1;
                }
            }
        }
        assert_eq!(found, 1, "byte {at}");
    }
    assert!(in_chunks > good.len() / 2);
    for len in (0..good.len()).step_by(7) {
        std::fs::write(&home, &good[..len]).unwrap();
        let e = ChunkFile::open(&home, 1 << 20).err().expect("is refused").to_string();
        assert!(e.contains("truncated") || e.contains("header cannot be read"), "{len}: {e}");
    }
}

/// A source whose reads of blocks fail when the countdown is at work.
struct Weak {
    data: Vec<u8>,
    fails: Arc<AtomicUsize>,
    reads: Arc<AtomicUsize>,
}

impl ReadAt for Weak {
    fn read_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        self.reads.fetch_add(1, Ordering::Relaxed);
        if self.fails.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1)).is_ok() {
            return Err(io::Error::other("the disk sulks"));
        }
        buffer.copy_from_slice(&self.data[offset as usize..][..buffer.len()]);
        Ok(())
    }
}

#[test]
fn a_failing_read_is_tried_once_more_and_then_reported() {
    let dir = tempfile::tempdir().unwrap();
    let home = dir.path().join("scene.chunks");
    let all = write(&home, dir.path());
    let data = std::fs::read(&home).unwrap();
    let (fails, reads) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
    let bytes = data.len() as u64;
    let weak = Weak { data, fails: fails.clone(), reads: reads.clone() };
    let file = ChunkFile::over(&home, Box::new(weak), bytes, 1 << 20).unwrap();
    let before = reads.load(Ordering::Relaxed);
    fails.store(1, Ordering::Relaxed);
    file.with(id(0), &mut |c| assert_eq!(c, &all[0])).unwrap();
    assert_eq!(reads.load(Ordering::Relaxed) - before, 2);
    fails.store(2, Ordering::Relaxed);
    let e = file.with(id(1), &mut |_| panic!("it cannot be read")).unwrap_err().to_string();
    assert!(e.contains("chunk 1 of mesh \"sheet\"") && e.contains("the disk sulks") && e.contains("read twice"), "{e}");
    // What failed is not remembered, and what was read is.
    file.with(id(1), &mut |c| assert_eq!(c, &all[1])).unwrap();
    file.with(id(0), &mut |c| assert_eq!(c, &all[0])).unwrap();
    assert_eq!(reads.load(Ordering::Relaxed) - before, 5);
}

#[test]
fn a_block_larger_than_the_limit_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let home = dir.path().join("scene.chunks");
    write(&home, dir.path());
    let file = ChunkFile::open(&home, 1000).unwrap();
    let e = file.with(id(0), &mut |_| panic!("it does not fit")).unwrap_err().to_string();
    assert!(e.contains("chunk 0 of mesh \"sheet\"") && e.contains("the limit is 1000"), "{e}");
    assert!(e.contains("[scene] memory_bytes is too small"), "{e}");
    assert_eq!(file.peak_bytes(), 0);
}

/// Something that counts the bytes of all that is alive.
struct Counted<'a>(u64, &'a AtomicU64);

impl<'a> Counted<'a> {
    fn new(bytes: u64, alive: &'a AtomicU64) -> Self {
        alive.fetch_add(bytes, Ordering::SeqCst);
        Self(bytes, alive)
    }
}

impl Drop for Counted<'_> {
    fn drop(&mut self) {
        self.1.fetch_sub(self.0, Ordering::SeqCst);
    }
}

#[test]
fn many_threads_never_hold_more_than_the_limit() {
    let alive = AtomicU64::new(0);
    let (most, loads) = (AtomicU64::new(0), AtomicUsize::new(0));
    let limit = 1000;
    let cache = Cache::<Counted<'_>>::new(limit);
    std::thread::scope(|s| {
        for t in 0..8_u32 {
            let (cache, alive, most, loads) = (&cache, &alive, &most, &loads);
            s.spawn(move || {
                for i in 0..400_u32 {
                    let key = (t * 7919 + i * i * 31) % 40;
                    let (held, extra) = (50 + u64::from(key) * 7, u64::from(key) * 3);
                    let load = || -> Result<Counted<'_>, ()> {
                        loads.fetch_add(1, Ordering::Relaxed);
                        // What is read lives beside what it becomes.
                        let _raw = Counted::new(extra, alive);
                        let value = Counted::new(held, alive);
                        most.fetch_max(alive.load(Ordering::SeqCst), Ordering::SeqCst);
                        std::thread::yield_now();
                        if i % 17 == 0 { Err(()) } else { Ok(value) }
                    };
                    match cache.get(key, held, extra, load) {
                        Ok(pin) => assert_eq!(pin.0, held),
                        Err(e) => assert_eq!(e, CacheError::Load(())),
                    }
                }
            });
        }
    });
    let (most, loads) = (most.load(Ordering::SeqCst), loads.load(Ordering::SeqCst));
    assert!(most <= cache.peak_bytes() && cache.peak_bytes() <= limit, "{most} of {limit} bytes");
    assert!(most > limit / 2 && loads < 8 * 400, "the cache is used: {most} bytes, {loads} loads");
}

#[test]
fn the_least_recently_used_goes_first_and_who_holds_does_not_wait() {
    let cache = Cache::new(100);
    let loads = AtomicUsize::new(0);
    let get = |key: u32, bytes: u64| {
        cache.get(key, bytes, 0, || {
            loads.fetch_add(1, Ordering::Relaxed);
            Ok::<u32, ()>(key)
        })
    };
    for key in [1, 2, 3, 1, 4, 1, 3] {
        // 40 bytes each: two fit.
        assert_eq!(*get(key, 40).unwrap(), key);
    }
    // 1, 2, 3 (drops 1), 1 (drops 2), 4 (drops 3), 1 is there, 3 (drops 4).
    assert_eq!(loads.load(Ordering::Relaxed), 6);
    let held = get(1, 40).unwrap();
    assert_eq!(get(7, 70).err(), Some(CacheError::Nested { bytes: 70, limit_bytes: 100 }));
    assert_eq!(get(8, 101).err(), Some(CacheError::TooLarge { bytes: 101, limit_bytes: 100 }));
    assert_eq!(*get(9, 60).unwrap(), 9, "what fits beside it is had");
    // Another thread waits until there is room.
    std::thread::scope(|s| {
        let other = s.spawn(|| get(7, 70).map(|p| *p).unwrap());
        std::thread::sleep(std::time::Duration::from_millis(20));
        assert!(!other.is_finished());
        drop(held);
        assert_eq!(other.join().unwrap(), 7);
    });
}

#[test]
fn what_does_not_come_gives_its_room_back_and_what_cannot_fit_drops_nothing() {
    let cache: Cache<u32> = Cache::new(100);
    let get = |key, bytes, value: u32| cache.get::<()>(key, bytes, 0, || Ok(value));
    let panics = || cache.get::<()>(1, 80, 10, || panic!("on purpose")).map(drop);
    assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(panics)).is_err());
    assert_eq!(cache.get(1, 80, 10, || Err("no disk")).map(drop).unwrap_err(), CacheError::Load("no disk"));
    assert_eq!(*get(1, 60, 5).unwrap(), 5);
    let used = get(1, 60, 6).unwrap();
    assert_eq!((*used, *get(2, 30, 7).unwrap()), (5, 7));
    assert_eq!(get(3, 50, 8).map(drop), Err(CacheError::Nested { bytes: 50, limit_bytes: 100 }));
    assert_eq!(*get(2, 30, 9).unwrap(), 7, "it was let go for what did not fit");
}

#[test]
fn contents_are_known_by_their_file_until_it_changes() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(&dir.path().join("store"), Arc::new(|m| panic!("{m}"))).unwrap();
    let file = dir.path().join("a");
    std::fs::write(&file, b"one").unwrap();
    let is = |bytes: &[u8]| {
        assert_eq!(identity::digest(&store, &file, &|| Ok(())).unwrap(), *blake3::hash(bytes).as_bytes())
    };
    let stop = || Err(std::io::ErrorKind::Interrupted.into());
    let stopped = identity::digest(&store, &file, &stop).unwrap_err();
    assert_eq!(stopped.kind(), std::io::ErrorKind::Interrupted);
    is(b"one");
    // As fast as can be, and of the same length.
    std::fs::write(&file, b"two").unwrap();
    is(b"two");
    let blocks = || std::fs::read_dir(dir.path().join("store/blocks")).unwrap().count();
    assert_eq!(blocks(), 0, "what has just changed is not remembered");
    std::thread::sleep(std::time::Duration::from_millis(2100));
    is(b"two");
    assert_eq!(blocks(), 1);
    is(b"two");
    std::fs::write(&file, b"six").unwrap();
    is(b"six");
}
