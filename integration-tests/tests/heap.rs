//! What blocks are said to take before they are read, beside what the heap really gives: while they are read, held, and uploaded by
//! the cpu backend. An allocator that counts stands under this program.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use farfield_core::backend::BlockData;
use farfield_core::id::Block;
use farfield_core::mesh::{ChunkMesh, MeshChunk};
use farfield_core::{Aabb, extent::Extent};
use farfield_experiments::config::BackendName;
use farfield_experiments::walk::{cost, device};
use farfield_integration_tests::lab::Lab;
use farfield_integration_tests::stones;

struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

fn grown(bytes: usize) {
    let now = NOW.fetch_add(bytes, Ordering::SeqCst) + bytes;
    MOST.fetch_max(now, Ordering::SeqCst);
}

// SAFETY: every call is handed to the system's allocator as it came; counting touches atomics only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::SeqCst);
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(at, layout) }
    }
    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both may be there for a moment.
        grown(size);
        NOW.fetch_sub(layout.size(), Ordering::SeqCst);
        // SAFETY: as the caller promises.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static HEAP: Counting = Counting;

/// The most that `work` has on the heap above what there was, what it leaves there, and its result.
fn measured<R>(work: impl FnOnce() -> R) -> (u64, i64, R) {
    let before = NOW.load(Ordering::SeqCst);
    MOST.store(before, Ordering::SeqCst);
    let out = work();
    let (most, after) = (MOST.load(Ordering::SeqCst), NOW.load(Ordering::SeqCst));
    ((most - before) as u64, after as i64 - before as i64, out)
}

/// Bookkeeping and file handles, per block: paths, map nodes, errors not told.
const SLACK: u64 = 8 << 10;

const FAR: [(&str, &str); 5] = [
    (
        "{ type = \"single-cell\" }",
        "{ type = \"point-polygon-hlod\", node_triangles = 500, resolution = 64, max_px = 1.0 }",
    ),
    ("{ type = \"single-cell\" }", "{ type = \"cluster-lod\", cluster_triangles = 32, group_clusters = 8 }"),
    ("{ type = \"hex-cells\", edge = 3.0 }", "{ type = \"textured-lod-mesh\", edge_px = 1.0 }"),
    ("{ type = \"hex-cells\", edge = 3.0 }", "{ type = \"layered-depth-image\" }"),
    ("{ type = \"hex-cells\", edge = 6.0 }", "{ type = \"textured-depth-mesh\", face_px = 256 }"),
];

#[test]
fn no_block_takes_more_heap_than_is_kept_free_for_it() {
    let folder = stones::folder();
    for (partition, far_field) in FAR {
        let pipeline = format!(
            "[[pipeline]]\nname = \"tested\"\nbackend = \"cpu\"\npartition = {partition}\nfar_field = {far_field}\n"
        );
        let lab = Lab::new(&stones::experiment([96, 72], &pipeline), folder.path()).unwrap();
        let opened = lab.opened(0).unwrap();
        let scene = &lab.prepared.scene;
        let mut backend = device::open(BackendName::Cpu, scene).unwrap();
        let cells: Vec<_> = opened.built.cells.keys().copied().collect();
        let blocks: std::collections::BTreeSet<Block> = cells.iter().flat_map(|&c| opened.payloads(c)).collect();
        let mut shares = [0f64; 4];
        for b in blocks {
            let c = cost(&opened, scene, &*backend, b).unwrap();
            let (reading, held, payload) = measured(|| opened.fetch(b).unwrap());
            let (uploading, kept, told) = measured(|| backend.upload(b, &BlockData::Payload(&payload)).unwrap());
            let pairs = [
                (reading, c.read_bytes),
                (held as u64, c.host_bytes),
                (uploading, c.resident_bytes + c.passing_bytes),
                (kept as u64, c.resident_bytes),
            ];
            for (i, (found, said)) in pairs.into_iter().enumerate() {
                shares[i] = shares[i].max(found as f64 / said as f64);
                assert!(found <= said + SLACK, "{far_field}, {b:?}, {i}: {found} bytes, {said} were said: {c:?}");
            }
            assert!((kept as u64).abs_diff(told) <= SLACK, "{b:?}: {kept} bytes stay, {told} are told");
        }
        println!("{far_field}: largest shares of what was said, reading, held, uploading, kept: {shares:.2?}");
    }
    // Building a hierarchy over many triangles, in a heap and as a soup.
    for n in [300u32, 5_000, 60_000] {
        let at = |i: u32, k: u32| ((i.wrapping_mul(2_654_435_761 + k) >> 8) % 10_007) as f32;
        let positions: Vec<_> = (0..3 * n).map(|i| glam::Vec3::new(at(i, 0), at(i, 77), at(i / 3, 9_999))).collect();
        let chunk = ChunkMesh {
            normals: vec![glam::Vec3::Y; positions.len()],
            vertex_ids: vec![0; positions.len()],
            indices: (0..3 * n).collect(),
            positions,
            ..ChunkMesh::default()
        };
        let info = MeshChunk {
            triangles: n,
            vertices: 3 * n,
            bounds: Aabb::EMPTY,
            material: farfield_core::id::MaterialId(0),
        };
        let lab = Lab::new(
            &stones::experiment(
                [96, 72],
                "[[pipeline]]\nname = \"a\"\nbackend = \"cpu\"\nfar_field = { type = \"geometry\" }\n",
            ),
            folder.path(),
        );
        let lab = lab.unwrap();
        let mut backend = device::open(BackendName::Cpu, &lab.prepared.scene).unwrap();
        let takes = backend.takes(&Extent::of_chunk(&info));
        let block = Block::Chunk(lab.prepared.scene.mesh_chunk_ids().next().unwrap());
        let (uploading, kept, _) = measured(|| backend.upload(block, &BlockData::Chunk(&chunk)).unwrap());
        let per = |bytes: u64| bytes as f64 / f64::from(n);
        println!(
            "{n} triangles: {:.0} bytes each while uploaded, {:.0} kept; {takes:?}",
            per(uploading),
            per(kept as u64)
        );
        assert!(uploading <= takes.resident_bytes + takes.passing_bytes + SLACK, "{n}: {uploading}, {takes:?}");
        assert!(kept as u64 <= takes.resident_bytes + SLACK, "{n}: {kept}, {takes:?}");
    }
}
