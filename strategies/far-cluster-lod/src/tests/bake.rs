//! What the bake writes: monotone, the same bytes in any order of jobs; what it refuses and leaves out.

use std::sync::atomic::Ordering;

use farfield_core::context::Memo;

use super::*;

#[test]
fn errors_and_boxes_grow_upwards_and_boxes_hold_their_triangles() {
    let b = baked(&fine(), one(hills(72)), &Serial);
    let object = &b.index.objects[0];
    let mut compared = 0;
    for group in &object.groups {
        for part in &group.parts {
            let slack = 1e-5;
            assert!(part.bounds.min.cmpge(group.bounds.min - slack).all());
            assert!(part.bounds.max.cmple(group.bounds.max + slack).all());
            if let Some(h) = part.replaced_by {
                let above = &object.groups[h as usize];
                assert!(above.error >= group.error && above.bounds.union(group.bounds) == above.bounds);
                compared += 1;
            }
        }
    }
    assert!(compared > 50, "{compared}");
    assert!(object.groups[0].error < object.groups.last().unwrap().error);
    let payloads: u64 = b.payloads.values().map(Payload::triangles).sum();
    let parts: u64 = object.groups.iter().flat_map(|g| &g.parts).map(|p| u64::from(p.triangles)).sum();
    assert_eq!(payloads, parts);
    let original = b.scene.triangles();
    assert!(payloads > original / 2 && payloads < original * 3 / 2, "{payloads} stored of {original}");
}

#[test]
fn an_index_whose_errors_fall_or_that_is_damaged_is_refused() {
    let b = baked(&fine(), one(hills(48)), &Serial);
    let decode = |change: &dyn Fn(&mut ObjectGroups)| {
        let mut index = b.index.clone();
        change(&mut index.objects[0]);
        Index::decode("asset 3", &index.encode().unwrap()).map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(decode(&|_| ()), Ok(()));
    let last = b.index.objects[0].groups.len() - 1;
    let lower = decode(&|o| o.groups[last].error = 0.0).unwrap_err();
    assert!(lower.contains("asset 3") && lower.contains("off by less than one below"), "{lower}");
    assert!(decode(&|o| o.groups[last].bounds = Aabb::EMPTY).unwrap_err().contains("off by less"));
    assert!(decode(&|o| o.groups[0].error = f32::NAN).unwrap_err().contains("without error"));
    assert!(decode(&|o| o.groups.swap(0, last)).is_err());
    assert!(decode(&|o| o.chunks[0] = Some(9999)).unwrap_err().contains("not there"));
    assert!(Index::decode("asset 3", &b.bytes[..b.bytes.len() - 1]).is_err());
    assert!(Index::decode("asset 3", &[b.bytes.as_slice(), &[0]].concat()).is_err());
    let own = ClusterLod::default();
    assert!(own.open(Some((AssetId(0), &b.bytes)), (AssetId(1), &[1])).is_err());
    assert!(own.open(None, (AssetId(1), &[])).is_err());
}

#[test]
fn the_same_input_gives_the_same_bytes_in_any_order_of_jobs() {
    let scene = || {
        let far = DAffine3::from_translation(DVec3::new(4.0, 0.0, 0.0));
        let mirrored = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        placed(vec![hills(40), faceted(hills(24))], &[(0, far), (1, mirrored), (0, DAffine3::IDENTITY)])
    };
    let (a, b) = (baked(&fine(), scene(), &Serial), baked(&fine(), scene(), &Shuffled));
    assert_eq!(a.index.objects.len(), 3);
    assert_eq!(a.bytes, b.bytes);
    assert_eq!(a.payloads, b.payloads);
}

#[test]
fn payloads_take_the_bytes_that_the_index_says_and_name_looks_of_the_original() {
    let b = baked(&fine(), one(hills(48)), &Serial);
    let object = &b.index.objects[0];
    let source = gather(&b.scene, (0..b.scene.chunks.len() as u32).map(ChunkId), DVec3::ZERO).unwrap();
    let looks: std::collections::BTreeSet<[u8; 4]> = source.wedges.iter().map(|w| w.albedo).collect();
    for group in &object.groups {
        let payload = &b.payloads[&LocalPayload(group.payload)];
        let mut bytes = 0;
        assert_eq!(payload.parts.len(), group.parts.len());
        for part in &payload.parts {
            let Part::Mesh(m) = part else { panic!("no mesh") };
            bytes += 12 * (m.positions.len() + m.normals.len()) + 4 * (m.albedo.len() + m.indices.len());
            assert!(m.albedo.iter().all(|a| looks.contains(a)));
        }
        assert_eq!(group.bytes, bytes as u64);
    }
}

#[test]
fn what_wears_a_texture_keeps_its_original_longer() {
    let wall = |material: u32| {
        let (n, mut m) = (64, TriangleMesh::default());
        for (x, y) in (0..=n).flat_map(|y| (0..=n).map(move |x| (x, y))) {
            let uv = Vec2::new(x as f32, y as f32) / n as f32;
            m.positions.push(Vec3::new(uv.x, uv.y, 0.0));
            m.uvs.push(uv);
        }
        for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
            let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(u, v)| x + u + (y + v) * (n + 1));
            m.indices.extend([a, b, c, a, c, d]);
        }
        m.sections = vec![(0..m.indices.len() as u32, MaterialId(material))];
        placed(vec![m], &[(0, DAffine3::IDENTITY)])
    };
    let least = |own: &ClusterLod, material: u32| {
        let b = baked(own, wall(material), &Serial);
        b.index.objects[0].groups.iter().map(|g| g.error).fold(f32::INFINITY, f32::min)
    };
    let (kept, gone) = (ClusterLod::default(), ClusterLod { keep_textures: false, ..ClusterLod::default() });
    assert!(least(&kept, 0) < 1e-5 && least(&gone, 2) < 1e-5, "a flat wall is off by nothing");
    // Edges of the wall are 1/64 long, those of half as many triangles longer.
    let textured = least(&kept, 2);
    assert!(textured > 1.0 / 64.0 && textured < 3.0 / 64.0, "{textured}");
    let left_out = |own: &ClusterLod| own.needs(&wall(2), None).unwrap().left_out;
    assert!(left_out(&kept)[0].reason.contains("kept until") && left_out(&gone)[0].reason.contains("lets them go"));
}

/// Triangles of edges 0.3 on a lattice, none with a neighbour.
fn soup(n: u32) -> TriangleMesh {
    let mut m = TriangleMesh::default();
    for i in 0..n {
        let at = Vec3::new((i % 17) as f32, (i / 17 % 17) as f32, (i / 289) as f32);
        m.positions.extend([at, at + 0.3 * Vec3::X, at + 0.3 * Vec3::Y]);
    }
    m.indices = (0..3 * n).collect();
    m.sections = vec![(0..3 * n, MaterialId(0))];
    m
}

#[test]
fn unconnected_triangles_thin_out_and_are_off_by_about_their_size() {
    let b = baked(&fine(), placed(vec![soup(900)], &[(0, DAffine3::IDENTITY)]), &Serial);
    let groups = &b.index.objects[0].groups;
    assert!(groups.len() > 3);
    // A triangle's corners are 0.1 to 0.23 from its middle, its height over the long edge is 0.21.
    assert!(groups.iter().all(|g| g.error > 0.1 && g.error < 0.3), "{groups:?}");
}

#[test]
fn objects_without_area_or_with_too_few_triangles_stay_as_they_are() {
    let mut point = hills(12);
    point.positions.iter_mut().for_each(|p| *p = Vec3::X);
    let at = [0, 1].map(|m| (m, DAffine3::from_translation(DVec3::splat(m as f64))));
    let scene = placed(vec![point, soup(1)], &at);
    let triangles = scene.triangles();
    let b = baked(&fine(), scene, &Serial);
    assert!(b.index.objects.is_empty() && b.payloads.is_empty());
    let (draws, achieved) = draw(&fine(), &b, &|_| 1e9, &|_| true);
    let [Draw { what: DrawWhat::Chunks(set), .. }] = draws.as_slice() else { panic!("{draws:?}") };
    assert_eq!((achieved.missing, b.scene.triangles_of(set)), (0, triangles));
    let empty = baked(&fine(), SceneBuilder::default().build().unwrap(), &Serial);
    assert!(draw(&fine(), &empty, &|_| 1.0, &|_| true).0.is_empty());
}

#[test]
fn settings_that_make_no_sense_are_refused() {
    let scene = one(hills(8));
    let refused = |own: ClusterLod| own.needs(&scene, None).unwrap_err().to_string();
    let d = ClusterLod::default;
    assert!(refused(ClusterLod { max_px: f32::NAN, ..d() }).contains("max_px"));
    assert!(refused(ClusterLod { cluster_triangles: 30, ..d() }).contains("multiple of 4"));
    assert!(refused(ClusterLod { cluster_triangles: 512, ..d() }).contains("256"));
    assert!(refused(ClusterLod { group_clusters: 1, ..d() }).contains("group_clusters"));
    assert!(refused(ClusterLod { least_triangles: 0, ..d() }).contains("least_triangles"));
    assert!(refused(ClusterLod { normal_weight: -1.0, ..d() }).contains("normal_weight"));
    assert!(refused(ClusterLod { albedo_weight: f32::INFINITY, ..d() }).contains("albedo_weight"));
    let small = ClusterLod { least_triangles: 200, ..d() }.needs(&scene, None).unwrap();
    assert!(small.left_out[0].reason.contains("1 of 1 objects"), "{small:?}");
}

/// Remembers and keeps over several bakes; stops when it is asked to remember a second object.
#[derive(Default)]
struct Interrupted {
    memory: Mutex<BTreeMap<Vec<u8>, Vec<u8>>>,
    stored: Mutex<BTreeMap<LocalPayload, Payload>>,
    put: Mutex<usize>,
    stop: AtomicBool,
}

impl Memo for Interrupted {
    fn get(&self, key: &[u8]) -> Option<Vec<u8>> {
        self.stop.store(!self.memory.lock().unwrap().is_empty(), Ordering::Relaxed);
        self.memory.lock().unwrap().get(key).cloned()
    }
    fn put(&self, key: &[u8], bytes: &[u8]) {
        assert!(self.memory.lock().unwrap().insert(key.to_vec(), bytes.to_vec()).is_none());
    }
}

impl Sink for Interrupted {
    fn put(&self, id: LocalPayload, payload: &Payload) -> Result<(), Fault> {
        *self.put.lock().unwrap() += 1;
        self.stored.lock().unwrap().insert(id, payload.clone());
        Ok(())
    }
    fn kept(&self, ids: &[LocalPayload]) -> Result<bool, Fault> {
        Ok(ids.iter().all(|i| self.stored.lock().unwrap().contains_key(i)))
    }
    fn claim(&self, _: Claim) {}
    fn left_out(&self, _: LeftOut) {}
}

#[test]
fn an_interrupted_bake_keeps_the_large_objects_that_are_done() {
    let n = 160;
    assert!(u64::from(2 * n * (2 * n - 2)) > LARGE_TRIANGLES);
    let away = DAffine3::from_translation(DVec3::new(4.0, 0.0, 0.0));
    let whole = baked(&ClusterLod::default(), placed(vec![hills(n)], &[(0, away), (0, DAffine3::IDENTITY)]), &Serial);
    let held = Interrupted::default();
    let bake = |cancel: &AtomicBool| {
        *held.put.lock().unwrap() = 0;
        let cx = Context { capture: &Blind, run: &Serial, memo: &held, cancel };
        ClusterLod::default().bake_scene(&SceneJob { scene: &whole.scene, views: &VIEWS }, &held, &cx)
    };
    assert!(matches!(bake(&held.stop), Err(Fault::Cancelled)));
    let first = whole.index.objects[0].groups.len();
    assert!(first > 20 && *held.put.lock().unwrap() == first);
    assert_eq!(bake(&AtomicBool::new(false)).unwrap(), whole.bytes);
    assert_eq!(*held.put.lock().unwrap(), whole.payloads.len() - first, "the second object alone");
    assert_eq!(*held.stored.lock().unwrap(), whole.payloads);
}
