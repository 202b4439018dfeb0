// Plain payload meshes: albedo and normal a vertex.

struct Varyings {
    @builtin(position) position: vec4<f32>,
    @location(0) color: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) seen: vec3<f32>,
    @location(3) depth: f32,
    @location(4) @interpolate(flat) tags: vec2<u32>,
}

@vertex
fn vertex(
    @builtin(instance_index) record: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: u32,
    @location(2) color: vec4<f32>,
) -> Varyings {
    let at = placed(record, position);
    return Varyings(
        at.clip,
        linear_of_srgb(color.rgb),
        from_octahedral(normal),
        at.seen,
        at.clip.w,
        at.tags,
    );
}

@fragment
fn fragment(in: Varyings) -> Planes {
    return planes(in.color, in.normal, in.seen, in.depth, in.tags);
}
