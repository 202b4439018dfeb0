// Chunks of original geometry: albedo = base colour x texture x vertex colour, linear light.

@group(1) @binding(0) var material_texture: texture_2d<f32>;
@group(1) @binding(1) var repeat_linear: sampler;

struct Varyings {
    @builtin(position) position: vec4<f32>,
    @location(0) color: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) seen: vec3<f32>,
    @location(3) uv: vec2<f32>,
    @location(4) depth: f32,
    @location(5) @interpolate(flat) tags: vec2<u32>,
}

@vertex
fn vertex(
    @builtin(instance_index) record: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: u32,
    @location(2) uv: vec2<f32>,
    @location(3) color: vec4<f32>,
) -> Varyings {
    let at = placed(record, position);
    return Varyings(
        at.clip,
        records[record].base_color.rgb * linear_of_srgb(color.rgb),
        local_normal(record, from_octahedral(normal)),
        at.seen,
        uv,
        at.clip.w,
        at.tags,
    );
}

@fragment
fn fragment(in: Varyings) -> Planes {
    let texel = textureSampleLevel(material_texture, repeat_linear, in.uv, 0.0);
    return planes(in.color * texel.rgb, in.normal, in.seen, in.depth, in.tags);
}
