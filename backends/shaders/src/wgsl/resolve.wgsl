// Layered depth images composed over what was drawn: the pixels that the warp gave to one image, with its depth.
// Smoothed images average over a pixel and those of its eight neighbours that the same image won (LayeredPart::smooth of
// farfield-core).

// (whose, nearness) of each pixel; 0 where nothing is.
@group(0) @binding(2) var<storage, read> splats: array<vec2<u32>>;

struct Covered {
    @location(0) albedo: vec4<f32>,
    @location(1) normal: u32,
    @location(2) depth: f32,
    @location(3) object: u32,
    @builtin(frag_depth) reversed: f32,
}

struct Look {
    albedo: vec3<f32>,
    normal: vec3<f32>,
}

fn look(sample: vec4<u32>) -> Look {
    return Look(linear_of_srgb(unpack4x8unorm(sample.w).rgb), layered_normal(sample.z));
}

fn sample_of(whose: u32) -> vec4<u32> {
    return page[warp.first + (whose & 0xffffffu)];
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> Covered {
    let pixel = vec2<u32>(at.xy);
    let winner = splats[pixel.y * warp.size.x + pixel.x];
    if winner.x >> 24u != warp.ordinal {
        discard;
    }
    let sample = sample_of(winner.x);
    var seen = look(sample);
    if warp.smoothed == 1u {
        var sum = Look(vec3<f32>(0.0), vec3<f32>(0.0));
        var weight = 0.0;
        for (var y = max(pixel.y, 1u) - 1u; y < min(pixel.y + 2u, warp.size.y); y++) {
            for (var x = max(pixel.x, 1u) - 1u; x < min(pixel.x + 2u, warp.size.x); x++) {
                let whose = splats[y * warp.size.x + x].x;
                if whose >> 24u == warp.ordinal {
                    // 4 in the middle, 2 beside, 1 in the corners.
                    let k = select(1.0, 2.0, x == pixel.x) * select(1.0, 2.0, y == pixel.y);
                    let other = look(sample_of(whose));
                    sum = Look(sum.albedo + other.albedo * k, sum.normal + other.normal * k);
                    weight += k;
                }
            }
        }
        seen = Look(sum.albedo / weight, direction(sum.normal));
    }
    let depth = bitcast<f32>(~winner.y);
    let object = sample.z >> 16u;
    return Covered(
        vec4<f32>(seen.albedo, 1.0),
        octahedral(seen.normal),
        depth,
        page[warp.objects + object / 4u][object % 4u],
        warp.near / depth,
    );
}
