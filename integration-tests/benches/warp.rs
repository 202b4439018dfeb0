//! What warping layered depth images costs, against what its memory traffic alone would: `cargo bench -p farfield-integration-tests
//! --bench warp [-- RUNS]`.
//!
//! Three samples a pixel, at 512 x 384 and 1024 x 768, seen by a picture of the same size from a little beside and ahead; a frame is one
//! surface pass of one image. For each backend, with 64-bit atomics and without, the least and the median of the frame's wall time, less the
//! least of the same pass without draws (targets cleared, nothing else), and its ratio to the floor of the same run.
//!
//! The floor is a kernel that does nothing but move the bytes: it reads the 16 bytes of every sample and writes 8, another reads those
//! of each pixel and writes 8. Run on the adapter that the wgpu backend takes, through wgpu.

use std::time::Instant;

use farfield_core::backend::{Backend, BlockData};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef, TargetId};
use farfield_core::layered::{LayeredPart, normal_bytes};
use farfield_core::payload::{Part, Payload};
use farfield_core::scene::SceneBuilder;
use farfield_core::{Aabb, Camera};
use farfield_vulkan::VulkanBackend;
use farfield_wgpu::WgpuBackend;
use glam::{DVec3, Vec3};

/// Samples of each pixel.
const LAYERS: u32 = 3;

fn camera(size: [u32; 2]) -> Camera {
    Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, size, 0.1)
}

/// Three wavy sheets, one behind the other.
fn image(size: [u32; 2]) -> LayeredPart {
    let n = size[0] * size[1] * LAYERS;
    let inverse_depth = [1.0 / 4.0, 1.0 / 40.0];
    let of = |s: u32| {
        let (pixel, layer) = (s / LAYERS, s % LAYERS);
        let [x, y] = [pixel % size[0], pixel / size[0]].map(|v| v as f32 * 40.0 / size[0] as f32);
        (x, y, 5.0 + 9.0 * layer as f32 + 0.5 * (x + layer as f32).sin() * y.cos())
    };
    let normal = |s| {
        let (x, y, _) = of(s);
        normal_bytes(Vec3::new(0.3 * x.cos(), 0.3 * y.sin(), 1.0).normalize())
    };
    LayeredPart {
        camera: camera(size),
        inverse_depth,
        counts: vec![LAYERS as u8; (size[0] * size[1]) as usize],
        depth: (0..n).map(|s| LayeredPart::quantise(of(s).2, inverse_depth)).collect(),
        albedo: (0..n).map(|s| [s as u8, (s >> 8) as u8, 128]).collect(),
        normal: (0..n).map(normal).collect(),
        object: vec![0; n as usize],
        objects: vec![1],
        smooth: false,
    }
}

/// The least and the median.
fn of(mut ms: Vec<f64>) -> (f64, f64) {
    ms.sort_by(f64::total_cmp);
    (ms[0], ms[ms.len() / 2])
}

const FLOOR: &str = "
@group(0) @binding(0) var<storage, read> samples: array<vec4<u32>>;
@group(0) @binding(1) var<storage, read_write> entries: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> pixels: array<vec2<u32>>;

@compute @workgroup_size(64)
fn spread(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * 64u + id.x;
    if i < arrayLength(&samples) {
        entries[i] = samples[i].xy ^ samples[i].zw;
    }
}

@compute @workgroup_size(64)
fn gather(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&pixels) {
        pixels[id.x] = max(max(entries[3u * id.x], entries[3u * id.x + 1u]), entries[3u * id.x + 2u]);
    }
}
";

/// Milliseconds of the floor's two kernels, each run; `None` without an adapter.
fn floor(size: [u32; 2], runs: usize) -> Option<Vec<f64>> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = wgpu::InstanceFlags::empty();
    let named = farfield_wgpu::available().ok()?;
    let adapters = pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(wgpu::Backends::VULKAN));
    let adapter = adapters.into_iter().find(|a| named.starts_with(&a.get_info().name))?;
    let required_limits = adapter.limits();
    let about = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&about)).ok()?;
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    let samples = pixels * u64::from(LAYERS);
    let buffer = |bytes| {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size: bytes, usage, mapped_at_creation: false })
    };
    let buffers = [buffer(16 * samples), buffer(8 * samples), buffer(8 * pixels)];
    queue.write_buffer(&buffers[0], 0, &vec![0x5a; 16 * samples as usize]);
    let source = wgpu::ShaderSource::Wgsl(FLOOR.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    let entry = |binding| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: binding == 0 },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let entries = [0, 1, 2].map(entry);
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries });
    let bound =
        [0, 1, 2].map(|i: usize| wgpu::BindGroupEntry { binding: i as u32, resource: buffers[i].as_entire_binding() });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &bound });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let pipelines = ["spread", "gather"].map(|name| {
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: Some(&layout),
            module: &module,
            entry_point: Some(name),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    });
    let mut all = vec![];
    // The first run, which makes the pages of the buffers, is not counted.
    for _ in 0..=runs {
        let start = Instant::now();
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut cp = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        cp.set_bind_group(0, &group, &[]);
        for (pipeline, threads) in pipelines.iter().zip([samples, pixels]) {
            let groups = threads.div_ceil(64) as u32;
            let down = groups.div_ceil(65_535);
            cp.set_pipeline(pipeline);
            cp.dispatch_workgroups(groups.div_ceil(down), down, 1);
        }
        drop(cp);
        queue.submit([encoder.finish()]);
        device.poll(wgpu::PollType::wait_indefinitely()).ok()?;
        all.push(start.elapsed().as_secs_f64() * 1e3);
    }
    Some(all.split_off(1))
}

fn main() {
    let runs = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(15);
    let scene = SceneBuilder::default().build().expect("an empty scene");
    for size in [[512, 384], [1024, 768]] {
        let Some(floor) = floor(size, runs).map(of) else {
            println!("SKIPPED: no Vulkan driver");
            return;
        };
        let part = image(size);
        println!("{} x {}, {} samples", size[0], size[1], part.samples());
        println!("  floor: least {:.1} ms, median {:.1} ms", floor.0, floor.1);
        let payload = Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![Part::Layered(part)] };
        let id = PayloadRef { asset: AssetId(0), id: LocalPayload(0) };
        let viewer = Camera { eye: DVec3::new(0.3, 0.1, -0.2), ..camera(size) };
        let list = |draws| DrawList {
            passes: vec![Pass { kind: PassKind::Surface, camera: viewer, writes: TargetId(0), draws }],
        };
        let draw = Draw { what: DrawWhat::Payload { id, part: 0, object: 0 }, bounds: Aabb::EMPTY, error_px: 0.0 };
        let (empty, full) = (list(vec![]), list(vec![draw]));
        for atomics_64 in [false, true] {
            let of_wgpu = farfield_wgpu::Without { atomics_64, ..Default::default() };
            let of_vulkan = farfield_vulkan::Without { atomics_64, ..Default::default() };
            let wgpu = farfield_wgpu::Options { without: of_wgpu, ..Default::default() };
            let vulkan = farfield_vulkan::Options { without: of_vulkan, ..Default::default() };
            let backends: [Box<dyn Backend>; 2] = [
                Box::new(WgpuBackend::new(&scene, &wgpu).expect("a device")),
                Box::new(VulkanBackend::new(&scene, vulkan).expect("a device")),
            ];
            for mut backend in backends {
                backend.upload(Block::Payload(id), &BlockData::Payload(&payload)).expect("the image is uploaded");
                let mut frames = |list: &DrawList| {
                    backend.render(list).expect("a frame");
                    of((0..runs).map(|_| backend.render(list).expect("a frame").wall_ms).collect())
                };
                let (cleared, drawn) = (frames(&empty), frames(&full));
                println!(
                    "  {}, {}: least {:.1} ms, median {:.1} ms, of which {:.1} ms clear the targets; {:.1} times the floor",
                    backend.info().backend,
                    if atomics_64 { "two phases of 32 bits" } else { "64-bit atomics" },
                    drawn.0,
                    drawn.1,
                    cleared.0,
                    (drawn.0 - cleared.0) / floor.0
                );
            }
        }
    }
}
