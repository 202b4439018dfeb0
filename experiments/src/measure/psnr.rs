//! Peak signal-to-noise ratio on luminance: PSNR = 10 log10(255^2 / mean squared error), decibels.

use farfield_core::color::luma;

/// A sum of squared luminance errors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SquaredError {
    /// The sum, squared grey levels.
    pub sum: f64,
    /// Pixels summed.
    pub pixels: u64,
}

impl SquaredError {
    /// Adds one pixel.
    pub fn add(&mut self, a: [u8; 4], b: [u8; 4]) {
        let d = f64::from(luma(a)) - f64::from(luma(b));
        self.sum += d * d;
        self.pixels += 1;
    }

    /// Both together.
    pub fn joined(self, other: Self) -> Self {
        Self { sum: self.sum + other.sum, pixels: self.pixels + other.pixels }
    }

    /// Decibels, at most [`cap_db`]; 0 pixels count as one that is equal.
    pub fn psnr_db(self) -> f64 {
        let pixels = self.pixels.max(1) as f64;
        (10.0 * (255.0 * 255.0 * pixels / self.sum).log10()).min(cap_db(self.pixels))
    }
}

/// The PSNR of one pixel in `pixels` that is off by one grey level: what equal frames count as.
pub fn cap_db(pixels: u64) -> f64 {
    10.0 * (255.0 * 255.0 * pixels.max(1) as f64).log10()
}
