// Payload meshes textured by projection: of a triangle's set of projectors the two whose directions from the surface point
// come nearest to the eye's, blended (ProjectedPart::blend of farfield-core; view-dependent texture mapping, Debevec et al.
// 1998). An empty set leaves the vertices' attributes.

struct Projector {
    // From positions relative to the payload's origin to (u w, v w, depth, w), u and v in texels.
    matrix: mat4x4<f32>,
    // Relative to the payload's origin.
    eye: vec3<f32>,
    // Which of the bound atlases, and its layer.
    slot: u32,
    // The least and the greatest texel coordinates that are looked up: the rectangle less half a texel.
    low: vec2<f32>,
    high: vec2<f32>,
    layer: u32,
    unused_x: u32,
    unused_y: u32,
    unused_z: u32,
}

@group(1) @binding(0) var<storage, read> projectors: array<Projector>;
@group(1) @binding(1) var clamp_linear: sampler;
@group(1) @binding(2) var albedo_0: texture_2d_array<f32>;
@group(1) @binding(3) var normal_0: texture_2d_array<f32>;
@group(1) @binding(4) var albedo_1: texture_2d_array<f32>;
@group(1) @binding(5) var normal_1: texture_2d_array<f32>;
@group(1) @binding(6) var albedo_2: texture_2d_array<f32>;
@group(1) @binding(7) var normal_2: texture_2d_array<f32>;
@group(1) @binding(8) var albedo_3: texture_2d_array<f32>;
@group(1) @binding(9) var normal_3: texture_2d_array<f32>;

struct Varyings {
    @builtin(position) position: vec4<f32>,
    @location(0) color: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) seen: vec3<f32>,
    @location(3) stored: vec3<f32>,
    @location(4) depth: f32,
    @location(5) @interpolate(flat) tags: vec2<u32>,
    // The set of projectors, the index of the first one.
    @location(6) @interpolate(flat) views: vec2<u32>,
}

struct Texel {
    albedo: vec3<f32>,
    normal: vec3<f32>,
}

@vertex
fn vertex(
    @builtin(instance_index) record: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: u32,
    @location(2) color: vec4<f32>,
    @location(3) views: u32,
) -> Varyings {
    let at = placed(record, position);
    return Varyings(
        at.clip,
        linear_of_srgb(color.rgb),
        from_octahedral(normal),
        at.seen,
        position,
        at.clip.w,
        at.tags,
        vec2<u32>(views, records[record].first_projector),
    );
}

fn look_up(index: u32, point: vec3<f32>) -> Texel {
    let q = projectors[index].matrix * vec4<f32>(point, 1.0);
    let at = clamp(q.xy / q.w, projectors[index].low, projectors[index].high);
    let layer = projectors[index].layer;
    var albedo: vec4<f32>;
    var normal: vec4<f32>;
    switch projectors[index].slot {
        case 1u: {
            let uv = at / vec2<f32>(textureDimensions(albedo_1));
            albedo = textureSampleLevel(albedo_1, clamp_linear, uv, layer, 0.0);
            normal = textureSampleLevel(normal_1, clamp_linear, uv, layer, 0.0);
        }
        case 2u: {
            let uv = at / vec2<f32>(textureDimensions(albedo_2));
            albedo = textureSampleLevel(albedo_2, clamp_linear, uv, layer, 0.0);
            normal = textureSampleLevel(normal_2, clamp_linear, uv, layer, 0.0);
        }
        case 3u: {
            let uv = at / vec2<f32>(textureDimensions(albedo_3));
            albedo = textureSampleLevel(albedo_3, clamp_linear, uv, layer, 0.0);
            normal = textureSampleLevel(normal_3, clamp_linear, uv, layer, 0.0);
        }
        default: {
            let uv = at / vec2<f32>(textureDimensions(albedo_0));
            albedo = textureSampleLevel(albedo_0, clamp_linear, uv, layer, 0.0);
            normal = textureSampleLevel(normal_0, clamp_linear, uv, layer, 0.0);
        }
    }
    return Texel(albedo.rgb, normal.xyz * 2.0 - 1.0);
}

@fragment
fn fragment(in: Varyings) -> Planes {
    if in.views.x == 0u {
        return planes(in.color, in.normal, in.seen, in.depth, in.tags);
    }
    // a = 1 - cos of the angle at the surface point between the eye and a projector; a is at most 2.
    let to_eye = direction(-in.seen);
    var best = 9.0;
    var second = 9.0;
    var best_index = 0u;
    var second_index = 0u;
    for (var left = in.views.x; left != 0u; left &= left - 1u) {
        let index = in.views.y + firstTrailingBit(left);
        let a = 1.0 - dot(to_eye, direction(projectors[index].eye - in.stored));
        if a < best {
            second = best;
            second_index = best_index;
            best = a;
            best_index = index;
        } else if a < second {
            second = a;
            second_index = index;
        }
    }
    let first = look_up(best_index, in.stored);
    if second == 9.0 {
        return planes(first.albedo, first.normal, in.seen, in.depth, in.tags);
    }
    let other = look_up(second_index, in.stored);
    let weight = (second + 1e-9) / (best + second + 2e-9);
    return planes(
        mix(other.albedo, first.albedo, weight),
        mix(other.normal, first.normal, weight),
        in.seen,
        in.depth,
        in.tags,
    );
}
