// Points: quads whose edges lie between pixels, so that what they cover is decided here (Screen::splat of farfield-core) and not by
// the rasteriser.

@group(1) @binding(0) var<storage, read> points: array<Vertex>;

struct Varyings {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) color: vec3<f32>,
    @location(1) @interpolate(flat) depth: f32,
    // Octahedral normal, object number + 1.
    @location(2) @interpolate(flat) tags: vec2<u32>,
}

@vertex
fn vertex(@builtin(instance_index) record: u32, @builtin(vertex_index) index: u32) -> Varyings {
    let point = points[index / 4u];
    let seen = seen_of(record, point);
    let p = on_screen(seen);
    let depth = p.z;
    let near = view.ahead.w;
    let normal = from_octahedral(point.normal);
    let two_sided = records[record].two_sided == 1u;
    let faces = inner(normal, seen) < 0.0;
    let turned = two_sided && dot(normal, seen) > 0.0;
    let centre = p.xy / depth;
    let half = max(vec2<f32>(view.across.w, view.down.w) * records[record].radius / depth, vec2<f32>(0.5));
    let low = clamp(ceil(centre - half - 0.5), vec2<f32>(0.0), view.size);
    let high = clamp(ceil(centre + half - 0.5), vec2<f32>(0.0), view.size);
    let drawn = (faces || two_sided) && depth >= near && finite(centre) && finite(half) && all(low < high);
    let corner = vec2<bool>((index & 1u) == 1u, (index & 2u) == 2u);
    return Varyings(
        select(NOWHERE, clip_of(select(low, high, corner), near / depth), drawn),
        linear_of_srgb(unpack4x8unorm(point.color).rgb),
        depth,
        vec2<u32>(octahedral(select(normal, -normal, turned)), records[record].object),
    );
}

@fragment
fn fragment(in: Varyings) -> Planes {
    return Planes(vec4<f32>(in.color, 1.0), in.tags.x, in.depth, in.tags.y);
}
