// What covers a pixel, by one 64-bit atomic: the greatest of (nearness, whose) stays.

@group(0) @binding(2) var<storage, read_write> splats: array<atomic<u64>>;

fn keep(pixel: u32, nearness: u32, whose: u32) {
    atomicMax(&splats[pixel], (u64(nearness) << 32u) | u64(whose));
}

