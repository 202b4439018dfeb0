// What points and lines share, whose vertices are pulled out of a page, four an element: a page's vertices, the corners of a quad, and
// what farfield-core's covered.rs computes with, in its order.

struct Vertex {
    x: f32,
    y: f32,
    z: f32,
    // Octahedral, local frame.
    normal: u32,
    // sRGB bytes.
    color: u32,
}

// Outside of what is ever seen: a quad with all its corners here is not drawn.
const NOWHERE: vec4<f32> = vec4<f32>(0.0, 0.0, 2.0, 1.0);

// A sum in the order in which farfield-core adds; `dot` promises none.
fn inner(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// Columns and rows times depth, and depth.
fn on_screen(seen: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(inner(seen, view.across.xyz), inner(seen, view.down.xyz), inner(seen, view.ahead.xyz));
}

fn seen_of(record: u32, v: Vertex) -> vec3<f32> {
    return placed(record, vec3<f32>(v.x, v.y, v.z)).seen;
}

// From pixels to clip space, w = 1.
fn clip_of(px: vec2<f32>, reversed: f32) -> vec4<f32> {
    return vec4<f32>(2.0 * px.x / view.size.x - 1.0, 1.0 - 2.0 * px.y / view.size.y, reversed, 1.0);
}

fn finite(v: vec2<f32>) -> bool {
    return all(abs(v) <= vec2<f32>(3.4e38));
}
