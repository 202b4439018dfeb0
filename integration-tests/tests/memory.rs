//! `budget.memory_bytes`: whatever the far field, the scheduler and the limit, no more is held than the limit; the less may be held, the
//! larger the error, which is counted; blocks that cannot be read are told, tried again and given up, and nothing wrong is drawn.
//!
//! What is held is counted twice: by the walk itself, and by a backend of the tests that knows nothing of the walk's account: it adds up what
//! every block takes on the device and the capacities of every array that it is handed.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use farfield_core::Fault;
use farfield_core::backend::{Backend, BlockData, Counted, DeviceInfo};
use farfield_core::draw::DrawList;
use farfield_core::extent::{Extent, Takes};
use farfield_core::id::{Block, TargetId};
use farfield_core::image::{Picture, SurfaceImage};
use farfield_core::payload::{MeshPart, Part, Payload};
use farfield_experiments::build::capture;
use farfield_experiments::config::{BackendName, BudgetSettings};
use farfield_experiments::measure::{self, Metrics, Rendered};
use farfield_experiments::progress::Progress;
use farfield_experiments::results::MemoryUse;
use farfield_experiments::store::Store;
use farfield_experiments::walk::{Device, OnDemand, Opened, TRIES, Tour, Walked, Walker, device};
use farfield_integration_tests::lab::Lab;
use farfield_integration_tests::stones;

/// Every kind of block: original chunks in memory and from a file, meshes, projected meshes with atlases, layered images, depth meshes.
const PIPELINES: [(&str, &str, &str); 6] = [
    ("geometry from a file", "{ type = \"single-cell\" }", "{ type = \"geometry\" }"),
    (
        "nodes",
        "{ type = \"single-cell\" }",
        "{ type = \"point-polygon-hlod\", node_triangles = 500, resolution = 64, max_px = 1.0 }",
    ),
    (
        "clusters",
        "{ type = \"single-cell\" }",
        "{ type = \"cluster-lod\", cluster_triangles = 32, group_clusters = 8, max_px = 1.0 }",
    ),
    ("textured", "{ type = \"hex-cells\", edge = 3.0 }", "{ type = \"textured-lod-mesh\", edge_px = 1.0 }"),
    ("layered", "{ type = \"hex-cells\", edge = 3.0 }", "{ type = \"layered-depth-image\" }"),
    ("depth meshes", "{ type = \"hex-cells\", edge = 6.0 }", "{ type = \"textured-depth-mesh\", face_px = 256 }"),
];
const SCHEDULERS: [&str; 3] = ["load-on-entry", "movement-priority", "near-to-far-lru"];
/// Frames at every place, so that what is asked for can come.
const STAY: usize = 4;

fn lab(which: usize, scheduler: &str, folder: &Path) -> Lab {
    let (_, partition, far_field) = PIPELINES[which];
    let pipelines = format!(
        "[measure]\nrepeats = 1\nwarm_up = 0\n[[pipeline]]\nname = \"tested\"\nbackend = \"cpu\"\npartition = {partition}\n\
         far_field = {far_field}\nscheduler = {{ type = \"{scheduler}\" }}\n\
         [[pipeline]]\nname = \"all geometry\"\nbackend = \"cpu\"\nfar_field = {{ type = \"geometry\", frustum_culling = false }}\n"
    );
    let from_file = if which == 0 { "out_of_core = true\n        " } else { "" };
    let text = stones::experiment([96, 72], &pipelines).replace("[view]", &format!("{from_file}[view]"));
    Lab::new(&text, folder).unwrap()
}

/// What the tests' backend saw.
#[derive(Default)]
struct Seen {
    /// What every block on the device takes.
    blocks: BTreeMap<Block, u64>,
    /// The most of all that together with the block being handed over.
    peak_bytes: u64,
    /// Payloads as they were baked, to compare with.
    sound: BTreeMap<Block, Payload>,
    /// Original chunks are read from a file.
    from_file: bool,
    uploads: u64,
    renders: usize,
    /// Done at the start of a frame's rendering.
    at_render: Option<Box<dyn FnMut(usize)>>,
}

/// Counts, compares, and leaves the work to another.
struct Recounting {
    inner: Box<dyn Backend>,
    seen: Rc<RefCell<Seen>>,
}

fn capacity<T>(v: &Vec<T>) -> u64 {
    (v.capacity() * size_of::<T>()) as u64
}

fn recounted(data: &BlockData<'_>) -> u64 {
    let mesh =
        |m: &MeshPart| capacity(&m.positions) + capacity(&m.normals) + capacity(&m.albedo) + capacity(&m.indices);
    match data {
        BlockData::Chunk(c) => {
            capacity(&c.positions)
                + capacity(&c.normals)
                + capacity(&c.uvs)
                + capacity(&c.colors)
                + capacity(&c.vertex_ids)
                + capacity(&c.indices)
        }
        BlockData::Payload(p) => {
            let part = |part: &Part| match part {
                Part::Mesh(m) => mesh(m),
                Part::Projected(p) => mesh(&p.mesh) + capacity(&p.views) + capacity(&p.projectors),
                Part::Atlas(a) => capacity(&a.albedo) + capacity(&a.normal),
                Part::Layered(l) => {
                    capacity(&l.counts)
                        + capacity(&l.depth)
                        + capacity(&l.albedo)
                        + capacity(&l.normal)
                        + capacity(&l.object)
                        + capacity(&l.objects)
                }
                Part::Points(p) => capacity(&p.positions) + capacity(&p.normals) + capacity(&p.albedo),
                Part::Lines(l) => {
                    capacity(&l.positions) + capacity(&l.normals) + capacity(&l.albedo) + capacity(&l.indices)
                }
            };
            capacity(&p.parts) + p.parts.iter().map(part).sum::<u64>()
        }
    }
}

impl Backend for Recounting {
    fn info(&self) -> &DeviceInfo {
        self.inner.info()
    }
    fn upload(&mut self, block: Block, data: &BlockData<'_>) -> Result<u64, Fault> {
        let bytes = self.inner.upload(block, data)?;
        let mut seen = self.seen.borrow_mut();
        if let (Some(sound), BlockData::Payload(p)) = (seen.sound.get(&block), data) {
            assert!(sound == *p, "{block:?} is not what was baked");
        }
        let (host, extent) = (
            recounted(data),
            match data {
                BlockData::Payload(p) => Extent::of_payload(p),
                BlockData::Chunk(c) => Extent {
                    chunk_vertices: c.positions.len() as u64,
                    triangles: c.indices.len() as u64 / 3,
                    parts: 1,
                    ..Extent::default()
                },
            },
        );
        // What lies in memory anyway is not held for the walk's sake.
        let read = matches!(data, BlockData::Payload(_)) || seen.from_file;
        assert!(
            !read || host <= extent.host_bytes(),
            "{block:?}: {host} bytes, said to be {} at most",
            extent.host_bytes()
        );
        let takes = self.inner.takes(&extent);
        assert!(bytes <= takes.resident_bytes, "{block:?}: {bytes} bytes on the device, {takes:?}");
        seen.uploads += 1;
        seen.blocks.insert(block, bytes);
        let on_its_way = if read { host } else { 0 };
        seen.peak_bytes = seen.peak_bytes.max(seen.blocks.values().sum::<u64>() + on_its_way);
        Ok(bytes)
    }
    fn takes(&self, extent: &Extent) -> Takes {
        self.inner.takes(extent)
    }
    fn release(&mut self, block: Block) {
        self.seen.borrow_mut().blocks.remove(&block);
        self.inner.release(block);
    }
    fn render(&mut self, list: &DrawList) -> Result<Counted, Fault> {
        let (mut hook, frame) = {
            let mut seen = self.seen.borrow_mut();
            seen.renders += 1;
            (seen.at_render.take(), seen.renders - 1)
        };
        if let Some(hook) = &mut hook {
            hook(frame);
        }
        self.seen.borrow_mut().at_render = hook;
        self.inner.render(list)
    }
    fn read_surface(&mut self, target: TargetId) -> Result<SurfaceImage, Fault> {
        self.inner.read_surface(target)
    }
    fn read_picture(&mut self, target: TargetId) -> Result<Picture, Fault> {
        self.inner.read_picture(target)
    }
}

/// A walk and what it left.
struct Left {
    frames: Vec<Walked>,
    /// Of the last frame at every place.
    pictures: Vec<Rendered>,
    memory: MemoryUse,
    seen: Rc<RefCell<Seen>>,
}

impl Left {
    fn missing(&self) -> u64 {
        self.frames.iter().map(|f| u64::from(f.missing)).sum()
    }

    /// Pooled over all places, dB.
    fn psnr_db(&self, reference: &[Rendered]) -> f64 {
        let metrics = Metrics { ssim: false, flip: false };
        let each = reference.iter().zip(&self.pictures).map(|(r, c)| measure::frame(r, c, metrics).luminance);
        each.reduce(|a, b| a.joined(b)).unwrap().psnr_db()
    }
}

/// Walks the path, [`STAY`] frames at every place; `before` is called before every frame.
fn walk(lab: &Lab, pipeline: usize, limit: Option<u64>, seen: Seen, before: &mut dyn FnMut(usize)) -> Left {
    let (e, p) = (&lab.experiment, &lab.prepared);
    let cameras: Vec<_> = p.cameras.iter().flat_map(|c| [*c; STAY]).collect();
    let tour = Tour {
        scene: &p.scene,
        views: &p.views,
        lit: &|_| p.lit(0),
        cameras: &cameras,
        frames_per_s: e.view.frames_per_s,
        measure: &e.measure,
    };
    let from_file = p.scene.mesh_chunk_ids().any(|c| p.scene.geometry.read_bytes(c) > 0);
    let seen = Rc::new(RefCell::new(Seen { from_file, ..seen }));
    let inner = device::open(BackendName::Cpu, &p.scene).unwrap();
    let mut device = Device::new(Box::new(Recounting { inner, seen: seen.clone() }));
    let budget = BudgetSettings { memory_bytes: limit, ..Default::default() };
    let mut walker = Walker::new(&tour, lab.opened(pipeline).unwrap(), None, &mut device, &budget);
    let (mut frames, mut pictures) = (vec![], vec![]);
    for (i, camera) in cameras.iter().enumerate() {
        before(i);
        let walked = walker.step(camera).unwrap_or_else(|f| panic!("frame {i}: {f}"));
        let on_device: u64 = seen.borrow().blocks.values().sum();
        assert_eq!(walked.resident_bytes, on_device, "frame {i}: the walk's account is not the device's");
        frames.push(walked);
        if (i + 1) % STAY == 0 {
            pictures.push(walker.read().unwrap());
        }
    }
    let memory = walker.memory();
    Left { frames, pictures, memory, seen }
}

fn plain(lab: &Lab, pipeline: usize, limit: Option<u64>) -> Left {
    walk(lab, pipeline, limit, Seen::default(), &mut |_| ())
}

#[track_caller]
fn within(left: &Left, limit: u64, what: &str) {
    let (peak, recounted) = (left.memory.peak_bytes, left.seen.borrow().peak_bytes);
    assert!(peak <= limit, "{what}: {peak} bytes under a limit of {limit}");
    assert!(recounted <= peak, "{what}: {recounted} bytes counted anew, {peak} by the walk");
}

/// Limits of all sizes for a pipeline and a scheduler.
fn sweep(which: usize, scheduler: &str) {
    let folder = stones::folder();
    let lab = lab(which, scheduler, folder.path());
    let name = format!("{}, {scheduler}", PIPELINES[which].0);
    let reference = plain(&lab, 1, None).pictures;
    let free = plain(&lab, 0, None);
    let (all, smallest, largest) =
        (free.memory.peak_bytes, free.memory.smallest_block_bytes, free.memory.largest_block_bytes);
    assert_eq!((free.missing(), free.memory.blocks_too_large), (0, 0), "{name}");
    let best_db = free.psnr_db(&reference);
    println!("{name}: {all} bytes without a limit, blocks of {smallest} to {largest}, {best_db:.2} dB");
    let mut found = vec![];
    let mut limits = vec![2 * all + 2 * largest, all, all / 2, all / 4, largest, smallest, smallest - 1, 1];
    limits.sort_unstable();
    limits.dedup();
    for limit in limits.into_iter().rev() {
        let left = plain(&lab, 0, Some(limit));
        within(&left, limit, &name);
        let (db, missing) = (left.psnr_db(&reference), left.missing());
        let uploads = left.seen.borrow().uploads;
        println!("  {limit}: peak {}, {missing} missing, {uploads} uploads, {db:.2} dB", left.memory.peak_bytes);
        assert_eq!(left.memory.failed_reads, 0, "{name}");
        let told = left.memory.troubles.iter().any(|t| t.contains("never fit [budget] memory_bytes"));
        assert_eq!(told, left.memory.blocks_too_large > 0, "{name}: {:?}", left.memory.troubles);
        if limit < smallest {
            assert_eq!((uploads, left.memory.peak_bytes), (0, 0), "{name}: what does not fit is not tried");
            assert!(missing > 0 && told, "{name}");
        }
        // An eye that stands still ends with what it had a frame before: nothing goes to and fro.
        let busy = left.frames.chunks(STAY).filter(|s| s[STAY - 1].uploaded_bytes > 0).count();
        assert!(busy <= 2 || limit >= all / 4, "{name}, {limit}: still loading at {busy} places");
        found.push((limit, db, missing));
    }
    // The first frame is drawn whole, and with room for all of it the last one at each place too.
    assert!(found[0].1 >= best_db - 0.01, "{name}: {:.2} dB with room for all", found[0].1);
    let error = |db: f64| 10f64.powf(-db / 10.0);
    for pair in found.windows(2) {
        assert!(error(pair[1].1) >= 0.8 * error(pair[0].1), "{name}: less memory, less error: {pair:?}");
    }
    let last = found.last().unwrap();
    assert!(last.1 < best_db - 3.0 && last.2 > found[0].2, "{name}: the error does not rise: {found:?}");
    let one = plain(&lab, 0, Some(largest));
    assert!(one.frames.iter().any(|f| f.resident_bytes > 0), "{name}: nothing comes where the largest block fits");
}

macro_rules! sweeps {
    ($($name:ident: $which:expr;)*) => {$(
        #[test]
        fn $name() {
            SCHEDULERS.iter().for_each(|s| sweep($which, s));
        }
    )*};
}
sweeps! {
    the_limit_holds_for_geometry_from_a_file: 0;
    the_limit_holds_for_nodes: 1;
    the_limit_holds_for_clusters: 2;
    the_limit_holds_for_textured_meshes: 3;
    the_limit_holds_for_layered_images: 4;
    the_limit_holds_for_depth_meshes: 5;
}

/// The files of the payloads of a pipeline, by block, and the payloads.
fn payloads(lab: &Lab) -> (BTreeMap<Block, PathBuf>, BTreeMap<Block, Payload>) {
    let opened = lab.opened(0).unwrap();
    let blocks: std::collections::BTreeSet<Block> =
        opened.built.cells.keys().flat_map(|&c| opened.payloads(c)).collect();
    let file = |b: Block| file_of(lab, &opened, b);
    let sound = blocks.iter().map(|&b| (b, opened.fetch(b).unwrap())).collect();
    (blocks.into_iter().map(|b| (b, file(b))).collect(), sound)
}

fn file_of(lab: &Lab, opened: &Opened<'_>, block: Block) -> PathBuf {
    let name: String = opened.stored(block).unwrap().key.iter().map(|b| format!("{b:02x}")).collect();
    lab.store().join("blocks").join(&name[..2]).join(&name[2..])
}

fn damage(file: &Path, how: usize) {
    let mut bytes = std::fs::read(file).unwrap();
    match how {
        0 => bytes.truncate(bytes.len() / 2),
        1 => {
            let middle = bytes.len() / 2;
            bytes[middle] ^= 4;
        }
        2 => return std::fs::remove_file(file).unwrap(),
        // Nothing that could be read.
        _ => {
            std::fs::remove_file(file).unwrap();
            return std::fs::create_dir(file).unwrap();
        }
    }
    std::fs::write(file, bytes).unwrap();
}

fn restore(file: &Path, bytes: &[u8]) {
    if file.is_dir() {
        std::fs::remove_dir(file).unwrap();
    }
    std::fs::write(file, bytes).unwrap();
}

/// Blocks that are damaged in the middle of a walk, in four ways at once.
fn damaged(which: usize, scheduler: &str, limited: bool) {
    let folder = stones::folder();
    let lab = lab(which, scheduler, folder.path());
    let name = format!("{}, {scheduler}", PIPELINES[which].0);
    let (files, sound) = payloads(&lab);
    let whole: BTreeMap<&PathBuf, Vec<u8>> = files.values().map(|f| (f, std::fs::read(f).unwrap())).collect();
    let good = plain(&lab, 0, None);
    let limit = limited.then_some(2 * good.memory.peak_bytes + 2 * good.memory.largest_block_bytes);
    let with = || Seen { sound: sound.clone(), ..Seen::default() };
    // Every third block, from the second place on.
    let bad: Vec<&PathBuf> = files.values().skip(1).step_by(3).collect();
    let left = walk(&lab, 0, limit, with(), &mut |frame| {
        if frame == STAY {
            bad.iter().enumerate().for_each(|(i, f)| damage(f, i % 4));
        }
    });
    let m = &left.memory;
    println!("{name}: {} of {} damaged, {} reads failed, {:?}", bad.len(), files.len(), m.failed_reads, m.troubles);
    assert!(m.blocks_given_up > 0 && m.failed_reads == m.blocks_given_up * u64::from(TRIES), "{name}: {m:?}");
    assert_eq!(left.frames.iter().map(|f| f.failed_reads).sum::<u64>(), m.failed_reads, "{name}");
    for line in m.troubles.iter().filter(|t| t.contains("given up")) {
        assert!(
            line.starts_with("payload ") && bad.iter().any(|f| line.contains(f.to_str().unwrap())),
            "{name}: {line}"
        );
    }
    assert_eq!(m.troubles.iter().filter(|t| t.contains("given up")).count() as u64, m.blocks_given_up, "{name}");
    if let Some(limit) = limit {
        within(&left, limit, &name);
    }
    assert!(left.missing() + u64::from(left.psnr_db(&good.pictures) < 99.0) > 0, "{name}: no block was of use");

    // Whole again in time, all comes.
    whole.iter().for_each(|(f, bytes)| restore(f, bytes));
    let left = walk(&lab, 0, limit, with(), &mut |frame| {
        match frame {
            0 => bad.iter().enumerate().for_each(|(i, f)| damage(f, i % 4)),
            1 => whole.iter().for_each(|(f, bytes)| restore(f, bytes)),
            _ => {}
        };
    });
    assert!(left.memory.failed_reads > 0 && left.memory.blocks_given_up == 0, "{name}: {:?}", left.memory);
    let same = left.pictures.last().unwrap().picture == good.pictures.last().unwrap().picture;
    assert!(same, "{name}: the last picture lacks something");

    // The next build makes anew what is damaged.
    bad.iter().enumerate().filter(|(i, _)| i % 4 < 3).for_each(|(i, f)| damage(f, i % 4));
    lab.opened(0).unwrap();
    for f in &bad {
        assert!(std::fs::read(f).unwrap() == whole[*f], "{name}: {} is not made anew", f.display());
    }
}

#[test]
fn damaged_nodes_are_told_and_coarser_ones_stand_in() {
    damaged(1, "movement-priority", true);
}

#[test]
fn damaged_clusters_are_told_and_coarser_ones_stand_in() {
    damaged(2, "load-on-entry", true);
}

#[test]
fn damaged_textured_meshes_are_told_and_missing() {
    damaged(3, "near-to-far-lru", true);
    damaged(3, "load-on-entry", false);
}

#[test]
fn damaged_layered_images_are_told_and_missing() {
    damaged(4, "movement-priority", true);
}

#[test]
fn no_frame_waits_for_the_disk() {
    let folder = stones::folder();
    let lab = lab(3, "load-on-entry", folder.path());
    let (files, _) = payloads(&lab);
    let all = plain(&lab, 0, None).memory;
    let limit = 2 * all.peak_bytes + 2 * all.largest_block_bytes;
    let files: Vec<PathBuf> = files.into_values().collect();
    // When the first frame at the second place is being rendered, all files go. What it asks for is read after that, so that it fails.
    let gone = move |frame: usize| {
        if frame == STAY {
            files.iter().for_each(|f| std::fs::remove_file(f).unwrap());
        }
    };
    let seen = Seen { at_render: Some(Box::new(gone)), ..Seen::default() };
    let left = walk(&lab, 0, Some(limit), seen, &mut |_| ());
    assert!(left.frames[..STAY].iter().all(|f| f.failed_reads == 0));
    assert!(left.frames[STAY].failed_reads > 0, "it was read before it was drawn");
    within(&left, limit, "no disk");
}

#[test]
fn a_damaged_file_of_chunks_is_told_and_the_walk_goes_on() {
    let folder = stones::folder();
    let lab = lab(0, "movement-priority", folder.path());
    let limit = 64 << 20;
    let file = walkdir(lab.store()).into_iter().find(|f| std::fs::read(f).unwrap().starts_with(b"FFCHNK")).unwrap();
    let mut bytes = std::fs::read(&file).unwrap();
    // The first block follows the header.
    bytes[200] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    let left = plain(&lab, 0, Some(limit));
    within(&left, limit, "chunks");
    let m = &left.memory;
    assert!(m.blocks_given_up == 1 && m.failed_reads == u64::from(TRIES), "{m:?}");
    assert!(
        m.troubles.iter().any(|t| t.starts_with("chunk 0 of mesh 0") && t.contains(file.to_str().unwrap())),
        "{m:?}"
    );
    assert!(left.missing() > 0);
}

#[test]
fn a_cell_that_was_built_on_demand_is_built_again_when_its_payloads_are_damaged() {
    let folder = stones::folder();
    let pipeline = "[measure]\nrepeats = 1\nwarm_up = 0\n[[pipeline]]\nname = \"tested\"\nbackend = \"cpu\"\n\
                    build = \"on-demand\"\npartition = { type = \"hex-cells\", edge = 3.0 }\n\
                    far_field = { type = \"textured-lod-mesh\", edge_px = 1.0 }\n[[pipeline]]\nname = \"all geometry\"\nbackend = \"cpu\"\n\
                    far_field = { type = \"geometry\" }\n[reference]\npipeline = \"all geometry\"\n";
    let lab = Lab::new(&stones::experiment([96, 72], pipeline), folder.path()).unwrap();
    let (e, p) = (&lab.experiment, &lab.prepared);
    let store = Store::open(lab.store(), Arc::new(|_| ())).unwrap();
    let (capture, progress, never) =
        (capture(BackendName::Cpu, &p.scene).unwrap(), Progress::new(true), AtomicBool::new(false));
    let site = p.site(&store, &*capture, &never, &progress);
    // The eye stands still.
    let cameras = vec![p.cameras[0]; 8];
    let tour = Tour {
        scene: &p.scene,
        views: &p.views,
        lit: &|_| p.lit(0),
        cameras: &cameras,
        frames_per_s: e.view.frames_per_s,
        measure: &e.measure,
    };
    let mut device = Device::new(device::open(BackendName::Cpu, &p.scene).unwrap());
    // The files of the cell's payloads, the last frame and picture, and what was told.
    let mut walked = |before: &mut dyn FnMut(usize)| {
        let on_demand = OnDemand::new(&site, f64::INFINITY);
        let budget = BudgetSettings { memory_bytes: Some(64 << 20), ..Default::default() };
        let mut walker = Walker::new(&tour, lab.opened(0).unwrap(), Some(on_demand), &mut device, &budget);
        let mut last = None;
        for (i, camera) in cameras.iter().enumerate() {
            before(i);
            last = Some(walker.step(camera).unwrap_or_else(|f| panic!("frame {i}: {f}")));
        }
        let picture = walker.read().unwrap().picture;
        let opened = &walker.opened;
        let blocks: Vec<Block> = opened.built.cells.keys().flat_map(|&c| opened.payloads(c)).collect();
        let files: Vec<PathBuf> = blocks.iter().map(|&b| file_of(&lab, opened, b)).collect();
        (files, last.unwrap(), picture, walker.memory())
    };
    let (files, good, picture, memory) = walked(&mut |_| ());
    assert!(files.len() > 3 && (good.missing, memory.failed_reads) == (0, 0), "{memory:?}");
    let (_, last, again, memory) = walked(&mut |frame| {
        if frame == 1 {
            files.iter().enumerate().for_each(|(i, f)| damage(f, i % 3));
        }
    });
    assert!(memory.failed_reads >= u64::from(TRIES) && memory.blocks_given_up == 0, "{memory:?}");
    assert!(last.missing == 0 && again == picture, "{memory:?}");
}

fn walkdir(root: &Path) -> Vec<PathBuf> {
    let (mut out, mut folders) = (vec![], vec![root.to_owned()]);
    while let Some(f) = folders.pop() {
        for e in std::fs::read_dir(f).unwrap() {
            let path = e.unwrap().path();
            if path.is_dir() { folders.push(path) } else { out.push(path) }
        }
    }
    out
}
