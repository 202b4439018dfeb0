// What the shaders of layered depth images share: one image's numbers in one pass, its samples, its objects.

struct Warp {
    // The image's eye relative to the viewer's.
    offset: vec4<f32>,
    // From the image's eye to the centre of its first pixel, one unit ahead, and from a pixel's ray to its neighbours'.
    corner: vec4<f32>,
    step_x: vec4<f32>,
    step_y: vec4<f32>,
    // The viewer.
    right: vec4<f32>,
    up: vec4<f32>,
    forward: vec4<f32>,
    // Tangents at the left and the top, pixels a unit tangent across and down.
    picture: vec4<f32>,
    // Width and height, pixels.
    size: vec2<u32>,
    near: f32,
    // 1: drawn smoothed.
    smoothed: u32,
    // The page's element at which the samples start, how many there are, the element at which the objects start.
    first: u32,
    samples: u32,
    objects: u32,
    // The image's number in the pass: 255 for the first one, 254 for the next.
    ordinal: u32,
    // With 32-bit atomics: 0 finds the nearest depths, 1 whose they are.
    phase: u32,
    unused_x: u32,
    unused_y: u32,
    unused_z: u32,
}

@group(0) @binding(0) var<uniform> warp: Warp;
// Samples: bits of depth; x, y of the pixel, 16 bits each; octahedral bytes of the normal and the number of the object, 16 bits;
// sRGB bytes. Then objects, four an element.
@group(0) @binding(1) var<storage, read> page: array<vec4<u32>>;

// The octahedral pair of bytes in the low half of `bits` as 16-bit fractions, rounded: v 32767 / 127 = 258 v + v / 127.
fn layered_normal(bits: u32) -> vec3<f32> {
    let q = max(vec2<i32>(i32(bits << 24u) >> 24u, i32(bits << 16u) >> 24u), vec2<i32>(-127));
    let wide = q * 258 + q / 64;
    return from_octahedral((u32(wide.x) & 0xffffu) | (u32(wide.y) << 16u));
}

