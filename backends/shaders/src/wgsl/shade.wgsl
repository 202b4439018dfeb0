// The shading pass, the same for every pipeline: colour = albedo x (ambient + sum of light x max(0, n . to_light)), linear
// light. The picture's format stores what is written, so that sRGB is encoded here and the background keeps its exact bytes.

struct Light {
    // xyz: unit vector to the light (w = 0) or its place relative to the eye (w = 1).
    place: vec4<f32>,
    // Linear.
    color: vec4<f32>,
}

struct Shade {
    right: vec4<f32>,
    up: vec4<f32>,
    forward: vec4<f32>,
    // Left, right, bottom, top.
    tangents: vec4<f32>,
    ambient: vec4<f32>,
    // Encoded, 0..1.
    sky: vec4<f32>,
    ground: vec4<f32>,
    // Width and height, pixels.
    size: vec2<f32>,
    light_count: u32,
    unused: u32,
    lights: array<Light, 8>,
}

@group(0) @binding(0) var<uniform> shade: Shade;
@group(1) @binding(0) var albedo_plane: texture_2d<f32>;
@group(1) @binding(1) var normal_plane: texture_2d<u32>;
@group(1) @binding(2) var depth_plane: texture_2d<f32>;
@group(1) @binding(3) var object_plane: texture_2d<u32>;

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(at.xy);
    // The ray through the pixel's centre, its component along forward 1 (Camera::ray of farfield-core).
    let tx = shade.tangents.x + at.x / shade.size.x * (shade.tangents.y - shade.tangents.x);
    let ty = shade.tangents.w - at.y / shade.size.y * (shade.tangents.w - shade.tangents.z);
    let ray = shade.forward.xyz + shade.right.xyz * tx + shade.up.xyz * ty;
    if textureLoad(object_plane, pixel, 0).x == 0u {
        return select(shade.ground, shade.sky, ray.y >= 0.0);
    }
    let albedo = textureLoad(albedo_plane, pixel, 0).rgb;
    let normal = from_octahedral(textureLoad(normal_plane, pixel, 0).x);
    let surface = ray * textureLoad(depth_plane, pixel, 0).x;
    var light = shade.ambient.rgb;
    for (var i = 0u; i < shade.light_count; i++) {
        let place = shade.lights[i].place;
        let to_light = select(place.xyz, normalize(place.xyz - surface), place.w == 1.0);
        light += shade.lights[i].color.rgb * max(dot(normal, to_light), 0.0);
    }
    return vec4<f32>(srgb_of_linear(albedo * light), 1.0);
}
