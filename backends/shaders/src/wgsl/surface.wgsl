// What the surface shaders share: a pass's camera, the draw records, the vertex's place, the planes that they fill.

struct View {
    // From positions relative to the eye to clip space; w is linear depth.
    projection: mat4x4<f32>,
    // Screen of farfield-core: from positions relative to the eye to columns times depth, rows times depth, depth; in w pixels a
    // unit tangent across and down, and the near distance.
    across: vec4<f32>,
    down: vec4<f32>,
    ahead: vec4<f32>,
    // Width and height, pixels.
    size: vec2<f32>,
    unused: vec2<f32>,
}

struct Record {
    // Rows of the affine map from stored positions to positions relative to the eye.
    to_eye_x: vec4<f32>,
    to_eye_y: vec4<f32>,
    to_eye_z: vec4<f32>,
    // Rows of the map from stored normals to the local frame.
    normal_x: vec4<f32>,
    normal_y: vec4<f32>,
    normal_z: vec4<f32>,
    // Linear.
    base_color: vec4<f32>,
    // Object number + 1.
    object: u32,
    // 1: the normal is turned to the eye.
    two_sided: u32,
    // The first of the part's projectors.
    first_projector: u32,
    // Of points.
    radius: f32,
}

struct Planes {
    @location(0) albedo: vec4<f32>,
    @location(1) normal: u32,
    @location(2) depth: f32,
    @location(3) object: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> records: array<Record>;

// A vertex in its place.
struct Placed {
    // Relative to the eye.
    seen: vec3<f32>,
    clip: vec4<f32>,
    // Object number + 1, and whether the surface has two sides.
    tags: vec2<u32>,
}

// What every vertex stage begins with, from a stored position.
fn placed(record: u32, position: vec3<f32>) -> Placed {
    let p = vec4<f32>(position, 1.0);
    let seen =
        vec3<f32>(dot(records[record].to_eye_x, p), dot(records[record].to_eye_y, p), dot(records[record].to_eye_z, p));
    let clip = view.projection * vec4<f32>(seen, 1.0);
    return Placed(seen, clip, vec2<u32>(records[record].object, records[record].two_sided));
}

fn local_normal(record: u32, normal: vec3<f32>) -> vec3<f32> {
    let n = vec3<f32>(
        dot(records[record].normal_x.xyz, normal),
        dot(records[record].normal_y.xyz, normal),
        dot(records[record].normal_z.xyz, normal),
    );
    return normalize(n);
}

// `seen` is the surface point relative to the eye: a two-sided surface's normal is turned against it.
fn planes(albedo: vec3<f32>, normal: vec3<f32>, seen: vec3<f32>, depth: f32, tags: vec2<u32>) -> Planes {
    let turned = select(normal, -normal, tags.y == 1u && dot(normal, seen) > 0.0);
    return Planes(vec4<f32>(albedo, 1.0), octahedral(turned), depth, tags.x);
}
