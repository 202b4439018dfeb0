//! The reference's pictures, kept in a temporary folder between walks: the lit picture and which pixels show an object.

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
        fs::write(self.file(frame), zstd::bulk::compress(&raw, 1)?)
    }

    /// A kept frame: its picture, and of its surface the objects.
    ///
    /// # Errors
    /// What reading gives.
    pub fn get(&self, frame: usize) -> io::Result<Rendered> {
        let pixels = self.size[0] as usize * self.size[1] as usize;
        let raw = zstd::bulk::decompress(&fs::read(self.file(frame))?, pixels * 8)?;
        let (rgba, object) = raw.split_at(pixels * 4);
        let object = object.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let rgba = rgba.chunks_exact(4).map(|b| [b[0], b[1], b[2], b[3]]).collect();
        Ok(Rendered {
            picture: Picture { size: self.size, rgba },
            surface: SurfaceImage { size: self.size, object, ..Default::default() },
        })
    }
}
