// What all shaders share: directions, octahedral normals and sRGB. The same arithmetic as farfield-core's image.rs and color.rs.

fn sign_not_zero(v: vec2<f32>) -> vec2<f32> {
    return select(vec2<f32>(-1.0), vec2<f32>(1.0), v >= vec2<f32>(0.0));
}

// The unit vector; 0 where there is none.
fn direction(v: vec3<f32>) -> vec3<f32> {
    let reciprocal = 1.0 / length(v);
    return select(vec3<f32>(0.0), v * reciprocal, reciprocal > 0.0 && reciprocal < 3.0e38);
}

// Two 16-bit signed fractions, x in the low half; up where the vector has no direction.
fn octahedral(n: vec3<f32>) -> u32 {
    let s = abs(n.x) + abs(n.y) + abs(n.z);
    if !(s > 0.0 && s < 3.0e38) {
        return 0x7fff0000u;
    }
    var p = n.xy / s;
    if n.z < 0.0 {
        p = (vec2<f32>(1.0) - abs(p.yx)) * sign_not_zero(p);
    }
    let q = vec2<i32>(floor(clamp(p, vec2<f32>(-1.0), vec2<f32>(1.0)) * 32767.0 + 0.5));
    return (u32(q.x) & 0xffffu) | ((u32(q.y) & 0xffffu) << 16u);
}

fn from_octahedral(p: u32) -> vec3<f32> {
    let q = vec2<i32>(i32(p << 16u) >> 16u, i32(p) >> 16u);
    let f = max(vec2<f32>(q) / 32767.0, vec2<f32>(-1.0));
    let z = 1.0 - abs(f.x) - abs(f.y);
    let t = max(-z, 0.0);
    return normalize(vec3<f32>(f - sign_not_zero(f) * t, z));
}

// IEC 61966-2-1.
fn linear_of_srgb(v: vec3<f32>) -> vec3<f32> {
    let high = pow((v + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, v / 12.92, v <= vec3<f32>(0.04045));
}

fn srgb_of_linear(c: vec3<f32>) -> vec3<f32> {
    let v = clamp(c, vec3<f32>(0.0), vec3<f32>(1.0));
    let high = 1.055 * pow(v, vec3<f32>(1.0 / 2.4)) - 0.055;
    return select(high, v * 12.92, v <= vec3<f32>(0.0031308));
}
