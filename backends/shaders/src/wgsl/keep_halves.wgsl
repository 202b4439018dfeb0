// What covers a pixel, by 32-bit atomics, for devices without 64-bit ones: all images' nearness first, then whose it is, of equal
// ones the greatest. Low half first, as the 64-bit numbers lie.

@group(0) @binding(2) var<storage, read_write> splats: array<atomic<u32>>;

fn keep(pixel: u32, nearness: u32, whose: u32) {
    if warp.phase == 0u {
        atomicMax(&splats[2u * pixel + 1u], nearness);
    } else if atomicLoad(&splats[2u * pixel + 1u]) == nearness {
        atomicMax(&splats[2u * pixel], whose);
    }
}

