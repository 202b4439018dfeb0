//! wgpu and Vulkan side by side on one device and one scene, held against each other plane by plane; and the frames that they
//! draw: everything, or some draws, then light.

use farfield_core::backend::{Backend, BlockData, Counted, upload_scene};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind, Shading};
use farfield_core::id::{Block, PayloadRef, TargetId};
use farfield_core::image::{Picture, SurfaceImage};
use farfield_core::payload::Payload;
use farfield_core::scene::{Light, LightKind, Scene};
use farfield_core::{Aabb, Camera};
use farfield_vulkan::VulkanBackend;
use farfield_wgpu::WgpuBackend;
use glam::Vec3;

/// The largest share of pixels that may differ on a driver other than lavapipe: silhouettes of small pictures.
pub const MAX_SHARE: f64 = 0.02;

/// Both backends on one scene, with all its chunks uploaded.
pub struct Pair {
    /// One.
    pub wgpu: WgpuBackend,
    /// The other.
    pub vulkan: VulkanBackend,
    /// On lavapipe nothing may differ.
    exact: bool,
}

/// Both backends, or a skip that says why.
///
/// # Panics
/// When a device is expected and missing, or the two take different sizes of blocks.
pub fn pair(test: &str, scene: &Scene) -> Option<Pair> {
    pair_of(test, scene, false)
}

/// The same, with `halves` as if the device had no 64-bit atomics.
///
/// # Panics
/// As [`pair`].
pub fn pair_of(test: &str, scene: &Scene, halves: bool) -> Option<Pair> {
    let skip = |why: String| {
        assert!(std::env::var_os("FARFIELD_EXPECT_DEVICE").is_none_or(|v| v != "1"), "{test}: {why}");
        eprintln!("SKIPPED: {test}: {why}");
    };
    let without = farfield_vulkan::Without { atomics_64: halves, ..Default::default() };
    let options = farfield_vulkan::Options { without, ..Default::default() };
    let vulkan = VulkanBackend::new(scene, options).map_err(|e| skip(e.to_string())).ok()?;
    let device = vulkan.info().device.clone();
    // wgpu is to take the very device that Vulkan took; its own name is the part before the driver's.
    let adapter = device.split(',').next().map(str::to_owned);
    let without = farfield_wgpu::Without { atomics_64: halves, ..Default::default() };
    let options = farfield_wgpu::Options { adapter, without, ..Default::default() };
    let wgpu = WgpuBackend::new(scene, &options).map_err(|e| skip(e.to_string())).ok()?;
    let mut pair = Pair { wgpu, vulkan, exact: device.contains("llvmpipe") };
    let bytes = upload_scene(&mut pair.wgpu, scene).unwrap();
    assert_eq!(upload_scene(&mut pair.vulkan, scene).unwrap(), bytes);
    Some(pair)
}

impl Pair {
    /// Uploads a payload to both.
    ///
    /// # Panics
    /// When either refuses it, or it takes another size.
    pub fn upload(&mut self, id: PayloadRef, payload: &Payload) {
        let data = BlockData::Payload(payload);
        let bytes = self.wgpu.upload(Block::Payload(id), &data).unwrap();
        assert_eq!(self.vulkan.upload(Block::Payload(id), &data).unwrap(), bytes);
    }

    /// Renders on both and compares counts, the surface of target 0 and the picture of target 1; returns what was seen.
    ///
    /// # Panics
    /// When they differ.
    #[track_caller]
    pub fn check(&mut self, what: &str, list: &DrawList) -> (SurfaceImage, Picture) {
        let (a, b) = (self.wgpu.render(list).unwrap(), self.vulkan.render(list).unwrap());
        let counts =
            |c: &Counted| (c.near_triangles, c.far_triangles, c.samples, c.points, c.lines, c.clipped_primitives);
        assert_eq!(counts(&a), counts(&b), "{what}");
        let surface = self.vulkan.read_surface(TargetId(0)).unwrap();
        let other = self.wgpu.read_surface(TargetId(0)).unwrap();
        self.same_surface(what, &other, &surface);
        let picture = self.vulkan.read_picture(TargetId(1)).unwrap();
        let other = self.wgpu.read_picture(TargetId(1)).unwrap();
        assert_eq!(other.size, picture.size, "{what}");
        self.same(what, "picture", &other.rgba, &picture.rgba, picture.size);
        (surface, picture)
    }

    /// Compares every plane of two surfaces.
    ///
    /// # Panics
    /// When they differ.
    #[track_caller]
    pub fn same_surface(&self, what: &str, a: &SurfaceImage, b: &SurfaceImage) {
        assert_eq!(a.size, b.size, "{what}");
        self.same(what, "albedo", &a.albedo, &b.albedo, b.size);
        self.same(what, "normal", &a.normal, &b.normal, b.size);
        let bits = |i: &SurfaceImage| i.depth.iter().map(|d| d.to_bits()).collect::<Vec<_>>();
        self.same(what, "depth", &bits(a), &bits(b), b.size);
        self.same(what, "object", &a.object, &b.object, b.size);
    }

    #[track_caller]
    fn same<T: PartialEq + std::fmt::Debug>(&self, what: &str, plane: &str, a: &[T], b: &[T], size: [u32; 2]) {
        assert_eq!(a.len(), b.len(), "{what}, {plane}");
        let differ: Vec<usize> = (0..a.len()).filter(|&i| a[i] != b[i]).collect();
        let allowed = if self.exact { 0.0 } else { MAX_SHARE * a.len() as f64 };
        if !differ.is_empty() {
            eprintln!("{what}, {plane}: {} of {} pixels differ", differ.len(), a.len());
        }
        assert!(
            differ.len() as f64 <= allowed,
            "{what}, {plane}: {} pixels of {size:?} differ, first at {}: {:?} {:?}",
            differ.len(),
            differ[0],
            a[differ[0]],
            b[differ[0]]
        );
    }
}

/// A sun and a lamp.
pub fn shading(scene: &Scene) -> Shading {
    let light = |kind, color| Light { kind, color, moves: false };
    let sun = LightKind::Directional { to_light: Vec3::new(0.4, 0.8, 0.3).normalize(), angle_rad: 0.0 };
    let lamp = LightKind::Point { position: scene.bounds.centre() + Vec3::Y * 2.0, radius: 0.0 };
    Shading {
        ambient: Vec3::splat(0.15),
        lights: vec![light(sun, Vec3::new(0.9, 0.8, 0.7)), light(lamp, Vec3::new(0.1, 0.2, 0.5))],
        sky: [93, 141, 219],
        ground: [71, 63, 52],
    }
}

/// A frame: what is seen into target 0, light into target 1.
pub fn list(scene: &Scene, camera: Camera, draws: Vec<Draw>) -> DrawList {
    let shade = PassKind::Shade { surface: TargetId(0), shading: shading(scene) };
    DrawList {
        passes: vec![
            Pass { kind: PassKind::Surface, camera, writes: TargetId(0), draws },
            Pass { kind: shade, camera, writes: TargetId(1), draws: vec![] },
        ],
    }
}

/// A draw without bounds.
pub fn draw(what: DrawWhat) -> Draw {
    Draw { what, bounds: Aabb::EMPTY, error_px: 0.0 }
}

/// A frame of all geometry.
pub fn everything(scene: &Scene, camera: Camera) -> DrawList {
    list(scene, camera, vec![draw(DrawWhat::Chunks(scene.all_chunks()))])
}

/// Pixels that show an object.
pub fn hits(image: &SurfaceImage) -> usize {
    image.object.iter().filter(|&&o| o != 0).count()
}
