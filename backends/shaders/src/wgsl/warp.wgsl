// Throws samples into the viewer's picture, one an invocation: Warp::splat and Splat::pixels of farfield-core, the same numbers in
// the same order.

const GRAZING: f32 = 0.2;
const MAX_SPLAT_PX: f32 = 8.0;

// A sum in the order in which farfield-core adds; `dot` promises none.
fn inner(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

@compute @workgroup_size(64)
fn compute(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = (group.y * groups.x + group.x) * 64u + local;
    if index >= warp.samples {
        return;
    }
    let sample = page[warp.first + index];
    let z = bitcast<f32>(sample.x);
    let ray = warp.corner.xyz + warp.step_x.xyz * f32(sample.y & 0xffffu) + warp.step_y.xyz * f32(sample.y >> 16u);
    let p = warp.offset.xyz + ray * z;
    let depth = inner(p, warp.forward.xyz);
    if !(depth > warp.near) {
        return;
    }
    let n = layered_normal(sample.z);
    let tangent = vec2<f32>(inner(p, warp.right.xyz), inner(p, warp.up.xyz)) / depth;
    let least = GRAZING * sqrt(inner(ray, ray));
    var facing = inner(n, ray);
    if abs(facing) < least {
        facing = select(-least, least, facing > 0.0);
    }
    let reach = half_edges(warp.step_x.xyz, ray, n, facing, z, tangent, depth)
        + half_edges(warp.step_y.xyz, ray, n, facing, z, tangent, depth);
    let half = clamp(0.5 * reach, vec2<f32>(0.5), vec2<f32>(0.5 * MAX_SPLAT_PX));
    let centre = vec2<f32>(tangent.x - warp.picture.x, warp.picture.y - tangent.y) * warp.picture.zw;

    // Nearer depths have greater numbers; of one depth the image drawn first has, and of one image the last sample.
    let nearness = ~bitcast<u32>(depth);
    let whose = (warp.ordinal << 24u) | index;
    let low = edge(centre - half - 0.5);
    let high = edge(centre + half - 0.5);
    for (var y = low.y; y < high.y; y++) {
        for (var x = low.x; x < high.x; x++) {
            keep(y * warp.size.x + x, nearness, whose);
        }
    }
}

// How far the image of the element's edge along `step` reaches, pixels.
fn half_edges(
    step: vec3<f32>,
    ray: vec3<f32>,
    n: vec3<f32>,
    facing: f32,
    z: f32,
    tangent: vec2<f32>,
    depth: f32,
) -> vec2<f32> {
    let d = (step - ray * (inner(n, step) / facing)) * z;
    let ahead = inner(d, warp.forward.xyz);
    let across = vec2<f32>(inner(d, warp.right.xyz), inner(d, warp.up.xyz));
    return abs((across - tangent * ahead) / depth * warp.picture.zw);
}

// The first pixel whose centre does not lie before, within the picture.
fn edge(at: vec2<f32>) -> vec2<u32> {
    return min(vec2<u32>(clamp(ceil(at), vec2<f32>(0.0), vec2<f32>(warp.size))), warp.size);
}
