//! Layered depth images in a pass: which are warped, with what, and in how many phases.
//!
//! A pass with layered draws has one *splat* a pixel, 8 bytes: whose it is (the image's number in the pass, then the sample's in the
//! image) below how near it is (the complement of the depth's bits, which orders positive floats), both greater for what wins. So
//! one atomic maximum of 64 bits a covered pixel decides among all samples of all images, in any order of execution:
//! the nearest wins, of equal depths the image drawn first, of one image the last sample. Where a device lacks 64-bit
//! atomics, a first phase finds the nearest depths of all images and a second whose they are; both leave the same bytes.
//!
//! The order of work in a surface pass: splats are cleared to 0; each of [`Atomics::dispatches`], the next only when the one before is
//! done; then, in the render pass behind the batches, the resolve shader's triangle once a draw, in order.
//!
//! O(samples * splat area) in compute, O(pixels * images) to resolve. An invocation throws one sample, which keeps neighbours equally
//! busy whatever their pixels hold; three samples of a pixel in one invocation were no faster on lavapipe.

use farfield_core::layered::Warp;
use farfield_core::{Camera, Fault};
use glam::{DVec3, Vec3};

use crate::Shader;
use crate::layout::{UNIFORM_ALIGN, WarpUniform};
use crate::residency::LayeredSlot;

/// How many layered depth images a pass draws: an image's number takes 8 bits of a splat, and 0 means none.
pub const MAX_IMAGES: usize = 255;

/// How many samples an image has at most: a sample's number takes 24 bits of a splat.
pub const MAX_SAMPLES: usize = 1 << 24;

/// The most pixels of an image across or down.
pub const MAX_IMAGE_PX: u32 = 1 << 16;

/// Bytes of a pixel's splat.
pub const SPLAT_BYTES: u64 = 8;

/// Invocations of a workgroup, as the shader says.
const WORKGROUP: u32 = 64;

/// The most workgroups in one direction; every device takes as many.
const MAX_WORKGROUPS: u32 = 65_535;

/// A layered depth image in a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayeredDraw {
    /// The page of samples.
    pub page: u32,
    /// Where its [`WarpUniform`] for the first phase starts in the frame's uniforms, bytes; that for the second follows after
    /// [`UNIFORM_ALIGN`]. To resolve, either serves.
    pub uniform_offset: u32,
    /// Workgroups to dispatch, across and down.
    pub workgroups: [u32; 2],
}

/// By which atomics samples compete for a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Atomics {
    /// One of 64 bits.
    Whole,
    /// Two of 32 bits.
    Halves,
}

impl Atomics {
    /// What a device lacks that has no whole ones, in words.
    pub const LACKING: &str = "no 64-bit atomics: layered depth images are warped twice, by 32-bit ones";

    /// The warp's shader.
    pub fn shader(self) -> Shader {
        match self {
            Self::Whole => Shader::Warp,
            Self::Halves => Shader::WarpHalves,
        }
    }

    /// How many times each image is warped.
    pub fn phases(self) -> u32 {
        match self {
            Self::Whole => 1,
            Self::Halves => 2,
        }
    }

    /// A pass's dispatches in order, each with the offset of its uniform.
    pub fn dispatches(self, draws: &[LayeredDraw]) -> impl Iterator<Item = (&LayeredDraw, u32)> {
        let offset = |d: &LayeredDraw, phase| d.uniform_offset + phase * UNIFORM_ALIGN as u32;
        (0..self.phases()).flat_map(move |phase| draws.iter().map(move |d| (d, offset(d, phase))))
    }
}

/// Workgroups for so many samples, across and down.
pub(crate) fn workgroups(samples: u32) -> [u32; 2] {
    let all = samples.div_ceil(WORKGROUP);
    let down = all.div_ceil(MAX_WORKGROUPS).max(1);
    [all.div_ceil(down), down]
}

/// The uniform of an image's first phase; `number` counts the images of the pass from 0.
///
/// # Errors
/// [`Fault::Refused`] where the pass has more than [`MAX_IMAGES`].
pub(crate) fn uniform(slot: &LayeredSlot, origin: DVec3, to: &Camera, number: usize) -> Result<WarpUniform, Fault> {
    let Some(ordinal) = MAX_IMAGES.checked_sub(number).filter(|&o| o > 0) else {
        let cause = format!("a surface pass with more than {MAX_IMAGES} layered depth images");
        return Err(Fault::Refused(cause));
    };
    let warp = Warp::new(&slot.camera, origin, to);
    let vector = |v: Vec3| [v.x, v.y, v.z, 0.0];
    let [w, h] = to.size.map(|s| s as f32);
    Ok(WarpUniform {
        offset: vector(warp.offset),
        corner: vector(warp.corner),
        step_x: vector(warp.step_x),
        step_y: vector(warp.step_y),
        right: vector(to.right),
        up: vector(to.up),
        forward: vector(to.forward),
        picture: [to.left, to.top, w / (to.right_tan - to.left), h / (to.top - to.bottom)],
        size: to.size,
        near: to.near,
        smoothed: u32::from(slot.smooth),
        first: slot.span.first,
        samples: slot.samples,
        objects: slot.span.first + slot.samples,
        ordinal: ordinal as u32,
        phase: 0,
        unused: [0; 3],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::layered::{GRAZING, MAX_SPLAT_PX};

    #[test]
    fn the_shader_holds_the_numbers_of_the_vocabulary() {
        for shader in [Shader::Warp, Shader::WarpHalves] {
            for line in [
                format!("const GRAZING: f32 = {GRAZING:?};"),
                format!("const MAX_SPLAT_PX: f32 = {MAX_SPLAT_PX:?};"),
                format!("@workgroup_size({WORKGROUP})"),
                format!("* {WORKGROUP}u + local"),
            ] {
                assert!(shader.wgsl().contains(&line), "{line}");
            }
        }
    }

    #[test]
    fn workgroups_reach_every_sample_within_the_limits_of_any_device() {
        for samples in [1, 63, 64, 65, 4_194_240, 4_194_241, 10_000_019, MAX_SAMPLES as u32] {
            let [x, y] = workgroups(samples);
            let threads = u64::from(x) * u64::from(y) * u64::from(WORKGROUP);
            assert!(threads >= u64::from(samples) && threads < u64::from(samples) + 64 * u64::from(y + 1), "{samples}");
            assert!(x <= MAX_WORKGROUPS && y <= MAX_WORKGROUPS, "{samples}");
        }
    }

    #[test]
    fn all_images_pass_through_one_phase_before_the_next() {
        let draw = |i: u32| LayeredDraw { page: i, uniform_offset: 1000 * i, workgroups: [1, 1] };
        let draws = [draw(0), draw(1)];
        let of = |a: Atomics| a.dispatches(&draws).map(|(d, at)| (d.page, at)).collect::<Vec<_>>();
        assert_eq!(of(Atomics::Whole), [(0, 0), (1, 1000)]);
        assert_eq!(of(Atomics::Halves), [(0, 0), (1, 1000), (0, 256), (1, 1256)]);
    }
}
