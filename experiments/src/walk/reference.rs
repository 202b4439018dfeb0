//! The reference's pictures, kept in a temporary folder between walks: the lit picture, and which object each pixel shows at which
//! depth.

use std::fs;
use std::io;

use farfield_core::image::{Picture, SurfaceImage};

use crate::measure::Rendered;

/// Pictures by frame.
pub struct References {
    folder: tempfile::TempDir,
    size: [u32; 2],
}

impl References {
    /// None yet, for frames of this size.
    ///
    /// # Errors
    /// What making the folder gives.
    pub fn new(size: [u32; 2]) -> io::Result<Self> {
        Ok(Self { folder: tempfile::Builder::new().prefix("farfield-").tempdir()?, size })
    }

    fn file(&self, frame: usize) -> std::path::PathBuf {
        self.folder.path().join(format!("{frame}.zst"))
    }

    /// Keeps a frame.
    ///
    /// # Errors
    /// What writing gives.
    pub fn keep(&self, frame: usize, r: &Rendered) -> io::Result<()> {
        let mut raw: Vec<u8> = bytemuck::cast_slice(&r.picture.rgba).to_vec();
        raw.extend_from_slice(bytemuck::cast_slice(&r.surface.object));
        raw.extend_from_slice(bytemuck::cast_slice(&r.surface.depth));
        fs::write(self.file(frame), zstd::bulk::compress(&raw, 1)?)
    }

    /// A kept frame: its picture, and of its surface the objects and depths.
    ///
    /// # Errors
    /// What reading gives.
    pub fn get(&self, frame: usize) -> io::Result<Rendered> {
        let pixels = self.size[0] as usize * self.size[1] as usize;
        let raw = zstd::bulk::decompress(&fs::read(self.file(frame))?, pixels * 12)?;
        if raw.len() != pixels * 12 {
            return Err(io::Error::new(io::ErrorKind::InvalidData, format!("frame {frame} has {} bytes", raw.len())));
        }
        let plane = |k: usize| raw[k * pixels * 4..(k + 1) * pixels * 4].as_chunks::<4>().0.iter();
        let object = plane(1).map(|b| u32::from_ne_bytes(*b)).collect();
        let depth = plane(2).map(|b| f32::from_ne_bytes(*b)).collect();
        let rgba = plane(0).copied().collect();
        Ok(Rendered {
            picture: Picture { size: self.size, rgba },
            surface: SurfaceImage { size: self.size, object, depth, ..Default::default() },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kept_frame_comes_back_as_it_was() {
        let kept = References::new([3, 2]).unwrap();
        let surface = SurfaceImage {
            size: [3, 2],
            object: vec![0, 1, 2, 70_000, 0, 5],
            depth: vec![f32::INFINITY, 1.5, 2.25, 1e9, f32::INFINITY, 0.1],
            ..SurfaceImage::default()
        };
        let picture = Picture { size: [3, 2], rgba: (0..6).map(|i| [i, 2 * i, 3 * i, 255]).collect() };
        let frame = Rendered { picture, surface };
        kept.keep(4, &frame).unwrap();
        assert_eq!(kept.get(4).unwrap(), frame);
        assert!(kept.get(5).is_err());
    }
}
