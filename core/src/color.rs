//! sRGB and linear light.

/// The linear value (0..=1) of an sRGB-encoded one (0..=1). IEC 61966-2-1.
pub fn linear_of_srgb(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB encoding (0..=1) of a linear value; values out of range are clamped.
pub fn srgb_of_linear(v: f32) -> f32 {
    let v = v.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// An encoded byte as linear light.
pub fn linear_of_byte(b: u8) -> f32 {
    linear_of_srgb(f32::from(b) / 255.0)
}

/// Linear light as an encoded byte, rounded to nearest.
pub fn byte_of_linear(v: f32) -> u8 {
    (srgb_of_linear(v) * 255.0 + 0.5) as u8
}

/// Luminance of display-space colour, 0..=255: Y = 0.299 R + 0.587 G + 0.114 B (textured LOD meshes, 2003, section 4.2).
pub fn luma(c: [u8; 4]) -> f32 {
    0.299 * f32::from(c[0]) + 0.587 * f32::from(c[1]) + 0.114 * f32::from(c[2])
}
