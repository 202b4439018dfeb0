// Lines, one pixel wide: quads a little wider than a pixel, of whose pixels each decides by itself whether the line goes through it
// (Screen::line and Line::pixels of farfield-core).

struct Line {
    a: Vertex,
    b: Vertex,
}

@group(1) @binding(0) var<storage, read> lines: array<Line>;

// How far beside the picture lines are cut off, pixels.
const BESIDE_PX: f32 = 2.0;

// How much wider than a pixel a quad is on either side, pixels: more than any rasteriser's corners are rounded by.
const WIDER_PX: f32 = 0.125;

struct Varyings {
    @builtin(position) position: vec4<f32>,
    // The ends, pixels.
    @location(0) @interpolate(flat) ends: vec4<f32>,
    // 1 / depth at the ends; where they lie along the line.
    @location(1) @interpolate(flat) values: vec4<f32>,
    @location(2) @interpolate(flat) color_a: vec3<f32>,
    @location(3) @interpolate(flat) color_b: vec3<f32>,
    // Octahedral normals; object number + 1.
    @location(4) @interpolate(flat) tags: vec3<u32>,
}

struct Deep {
    @location(0) albedo: vec4<f32>,
    @location(1) normal: u32,
    @location(2) depth: f32,
    @location(3) object: u32,
    @builtin(frag_depth) reversed: f32,
}

// The part of a line within the near distance and the picture's edges, as the range of the parameter along it; x > y where there is
// none. Liang and Barsky (1984).
fn cut(range: vec2<f32>, d: f32, e: f32) -> vec2<f32> {
    if d < 0.0 && e < 0.0 {
        return vec2<f32>(2.0, -1.0);
    } else if d < 0.0 {
        return vec2<f32>(max(range.x, d / (d - e)), range.y);
    } else if e < 0.0 {
        return vec2<f32>(range.x, min(range.y, d / (d - e)));
    }
    return range;
}

@vertex
fn vertex(@builtin(instance_index) record: u32, @builtin(vertex_index) index: u32) -> Varyings {
    let line = lines[index / 4u];
    let a = on_screen(seen_of(record, line.a));
    let b = on_screen(seen_of(record, line.b));
    let near = view.ahead.w;
    let far = view.size + BESIDE_PX;
    var range = vec2<f32>(0.0, 1.0);
    range = cut(range, a.z - near, b.z - near);
    range = cut(range, a.x + BESIDE_PX * a.z, b.x + BESIDE_PX * b.z);
    range = cut(range, far.x * a.z - a.x, far.x * b.z - b.x);
    range = cut(range, a.y + BESIDE_PX * a.z, b.y + BESIDE_PX * b.z);
    range = cut(range, far.y * a.z - a.y, far.y * b.z - b.y);
    let first = a + (b - a) * range.x;
    let last = select(a + (b - a) * range.y, b, range.y == 1.0);
    let inverse = vec2<f32>(1.0 / max(first.z, near), 1.0 / max(last.z, near));
    let head = first.xy * inverse.x;
    let tail = last.xy * inverse.y;
    let beside = vec2<f32>(2.0 * BESIDE_PX);
    let kept = all(head >= -beside) && all(head <= view.size + beside) && all(tail >= -beside) && all(tail <= view.size + beside);

    // The longer axis first.
    let steep = abs(tail.y - head.y) > abs(tail.x - head.x);
    let start = select(head, head.yx, steep);
    let run = select(tail - head, (tail - head).yx, steep);
    let slope = select(run.y / run.x, 0.0, run.x == 0.0);
    let low = floor(min(start.x, start.x + run.x));
    let high = floor(max(start.x, start.x + run.x)) + 1.0;
    let along = select(low, high, (index & 1u) == 1u);
    let side = select(-0.5 - WIDER_PX, 0.5 + WIDER_PX, (index & 2u) == 2u);
    let corner = vec2<f32>(along, start.y + slope * (along - start.x) + side);
    let px = select(corner, corner.yx, steep);
    // Any depth that is not clipped: each pixel writes its own.
    return Varyings(
        select(NOWHERE, clip_of(px, 0.5), range.x <= range.y && kept),
        vec4<f32>(head, tail),
        vec4<f32>(inverse, range),
        linear_of_srgb(unpack4x8unorm(line.a.color).rgb),
        linear_of_srgb(unpack4x8unorm(line.b.color).rgb),
        vec3<u32>(line.a.normal, line.b.normal, records[record].object),
    );
}

@fragment
fn fragment(in: Varyings) -> Deep {
    let head = in.ends.xy;
    let tail = in.ends.zw;
    let steep = abs(tail.y - head.y) > abs(tail.x - head.x);
    let start = select(head, head.yx, steep);
    let run = select(tail - head, (tail - head).yx, steep);
    let at = floor(select(in.position.xy, in.position.yx, steep));
    let place = select((at.x + 0.5 - start.x) / run.x, 0.0, run.x == 0.0);
    if floor(start.y + run.y * place) != at.y {
        discard;
    }
    let t = clamp(place, 0.0, 1.0);
    let first = in.values.x * (1.0 - t);
    let last = in.values.y * t;
    let sum = first + last;
    let depth = 1.0 / sum;
    let weight = (in.values.z * first + in.values.w * last) / sum;
    let normal = from_octahedral(in.tags.x) * (1.0 - weight) + from_octahedral(in.tags.y) * weight;
    let color = in.color_a * (1.0 - weight) + in.color_b * weight;
    return Deep(vec4<f32>(color, 1.0), octahedral(normal), depth, in.tags.z, view.ahead.w / depth);
}
