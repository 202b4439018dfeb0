use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use farfield_core::context::{Context, Serial, remembered};
use farfield_core::id::LocalPayload;
use farfield_core::payload::{AtlasPart, MeshPart, Part, Payload};
use farfield_core::strategy::Sink;
use glam::{DVec3, Vec3};

use super::*;
use crate::build::NoCapture;
use crate::progress::Bar;

fn store(dir: &Path) -> (Store, Arc<Mutex<Vec<String>>>) {
    let said = Arc::new(Mutex::new(vec![]));
    let to = said.clone();
    (Store::open(dir, Arc::new(move |m| to.lock().unwrap().push(m))).unwrap(), said)
}

fn payload() -> Payload {
    let mesh = MeshPart {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        normals: vec![Vec3::Z; 3],
        albedo: vec![[1, 2, 3, 255]; 3],
        indices: vec![0, 1, 2],
        two_sided: true,
    };
    let atlas = AtlasPart { size: [2, 1], layers: 1, albedo: vec![[9; 4]; 2], normal: vec![[128; 4]; 2] };
    let bounds = farfield_core::Aabb::of([Vec3::ZERO, Vec3::ONE]);
    Payload { origin: DVec3::splat(1e7 + 0.125), bounds, parts: vec![Part::Mesh(mesh), Part::Atlas(atlas)] }
}

#[test]
fn what_is_put_comes_back_in_another_process_life() {
    let dir = tempfile::tempdir().unwrap();
    let name = key("test", &[b"a"]);
    assert_eq!(store(dir.path()).0.get(&name), None);
    let bytes: Vec<u8> = (0..100_000u32).map(|i| (i.wrapping_mul(i) >> 7) as u8).collect();
    store(dir.path()).0.put(&name, &bytes).unwrap();
    assert_eq!(store(dir.path()).0.get(&name), Some(bytes));
}

#[test]
fn every_damaged_byte_is_found_and_the_block_can_be_built_again() {
    let dir = tempfile::tempdir().unwrap();
    let (s, said) = store(dir.path());
    let name = key("test", &[b"a"]);
    s.put(&name, b"some bytes that matter").unwrap();
    let file = s.file(&name);
    let good = fs::read(&file).unwrap();
    for i in 0..good.len() {
        let mut bad = good.clone();
        bad[i] ^= 0x10;
        fs::write(&file, &bad).unwrap();
        assert_eq!(s.get(&name), None, "byte {i}");
        s.put(&name, b"some bytes that matter").unwrap();
    }
    fs::write(&file, &good[..good.len() - 1]).unwrap();
    assert_eq!(s.check(&name), None);
    assert_eq!(said.lock().unwrap().len(), good.len() + 1);
    assert!(said.lock().unwrap()[0].contains("is damaged"));
    s.put(&name, b"some bytes that matter").unwrap();
    assert_eq!(fs::read(&file).unwrap(), good);
}

#[test]
fn what_a_killed_process_left_aside_goes() {
    let dir = tempfile::tempdir().unwrap();
    drop(store(dir.path()));
    // No process has a number this high.
    let left = dir.path().join("aside").join("4194999-3");
    fs::write(&left, b"half").unwrap();
    let (s, _) = store(dir.path());
    assert!(!left.exists());
    // What this process writes stays when it opens the store once more.
    let own = s.aside().join(format!("{}-3", std::process::id()));
    fs::write(&own, b"half").unwrap();
    drop(store(dir.path()));
    assert!(own.exists());
}

#[test]
fn keys_do_not_run_into_each_other() {
    assert_ne!(key("k", &[b"ab", b"c"]), key("k", &[b"a", b"bc"]));
    assert_ne!(key("k", &[b"a"]), key("l", &[b"a"]));
    assert_ne!(key("k", &[]), key("k", &[b""]));
}

#[test]
fn a_bake_is_recorded_whatever_the_order_of_its_claims() {
    use farfield_core::claim::{Claim, Quantity};
    let claim = |i: u32| Claim { quantity: Quantity::HoleWidthPx, payload: Some(LocalPayload(i)), max: 2.0 };
    let bar = Bar::default();
    let made = |order: &[u32]| {
        let dir = tempfile::tempdir().unwrap();
        let (s, _) = store(dir.path());
        let r = Recorder::new(&s, key("asset", &[]), &bar);
        for &i in order {
            r.put(LocalPayload(i), &payload()).unwrap();
            r.claim(claim(i));
        }
        assert!(r.put(LocalPayload(order[0]), &payload()).is_err());
        let m = r.finish(vec![7]).unwrap();
        let back = unpack(&s.get(&m.payloads[&LocalPayload(1)].key).unwrap()).unwrap();
        assert_eq!(back, payload());
        assert_eq!(decode::<Manifest>(&s.get(&key("asset", &[])).unwrap()).unwrap(), m);
        m
    };
    assert_eq!(made(&[0, 1, 2]), made(&[2, 0, 1]));
}

/// A bake in two pieces that is interrupted in the second: what it remembered is taken only while its payloads are whole.
#[test]
fn an_interrupted_bake_goes_on_from_what_is_whole() {
    let dir = tempfile::tempdir().unwrap();
    let (s, said) = store(dir.path());
    let (asset, bar) = (key("asset", &[]), Bar::default());
    // Which pieces are made, and the manifest; the piece `stop` is never made.
    let bake = |stop: u32| {
        let memo = StoreMemo::of(&s, &asset);
        let cx = Context { capture: &NoCapture, run: &Serial, memo: &memo, cancel: &AtomicBool::new(false) };
        let (sink, mut made) = (Recorder::new(&s, asset, &bar), vec![]);
        for i in 0..2 {
            let id = LocalPayload(i);
            let mut make = || {
                if i == stop {
                    return Err(Fault::Cancelled);
                }
                made.push(i);
                sink.put(id, &payload()).map(|()| 10 + i)
            };
            match remembered(&[i as u8], &|_: &u32| vec![id], &mut make, &sink, &cx) {
                Ok(found) => assert_eq!(found, 10 + i),
                Err(f) => {
                    assert!(matches!(f, Fault::Cancelled));
                    return (made, None);
                }
            }
        }
        let manifest = sink.finish(vec![]).unwrap();
        memo.clear();
        (made, Some(manifest))
    };
    let unfinished = dir.path().join("unfinished");
    assert_eq!(bake(1), (vec![0], None));
    assert!(fs::read_dir(&unfinished).unwrap().next().is_some());
    assert_eq!(bake(1), (vec![], None));
    // Its payload is damaged, then gone.
    let block = s.file(&key("payload", &[&asset, &0u32.to_le_bytes()]));
    fs::write(&block, b"nothing").unwrap();
    assert_eq!(bake(1), (vec![0], None));
    fs::remove_file(&block).unwrap();
    assert_eq!(bake(1), (vec![0], None));
    let (made, manifest) = bake(2);
    assert_eq!(made, [1]);
    // Nothing is left of the memory; a bake from the start leaves the same.
    assert!(fs::read_dir(&unfinished).unwrap().next().is_none());
    assert_eq!(bake(2), (vec![0, 1], manifest));
    assert_eq!(said.lock().unwrap().len(), 1, "the damaged block alone");
}
