//! Textures: decoded once each, to sRGB bytes, through `image` (png, jpeg, tga, bmp).

use std::collections::{BTreeSet, HashMap};
use std::io::Cursor;
use std::path::{Path, PathBuf};

use farfield_core::id::TextureId;
use farfield_core::scene::Texture;

use super::{bytes, mtl};

/// The largest picture taken, texels a side: above any GPU's limit, and 1 GiB of memory.
const MAX_SIDE_PX: u32 = 16_384;

/// The textures of one scene, each file once.
#[derive(Default)]
pub(super) struct Textures {
    list: Vec<Texture>,
    known: HashMap<PathBuf, Result<TextureId, String>>,
    /// Files beside the model that were read or looked for, material libraries and buffers too.
    pub(super) beside: BTreeSet<PathBuf>,
}

impl Textures {
    /// The texture `name` in `folder`, or why there is none.
    pub(super) fn file(&mut self, folder: &Path, name: &str) -> Result<TextureId, String> {
        if name.is_empty() {
            return Err("a texture without a name".into());
        }
        let path = mtl::resolve(folder, name);
        if let Some(known) = self.known.get(&path) {
            return known.clone();
        }
        self.beside.insert(path.clone());
        let made = bytes::read(&path)
            .map_err(|e| format!("texture {e}"))
            .and_then(|data| self.picture(name, Some(&path), &data));
        self.known.insert(path, made.clone());
        made
    }

    /// The picture `data` inside a file, called by its place there.
    pub(super) fn memory(&mut self, place: &str, data: &[u8]) -> Result<TextureId, String> {
        let key = PathBuf::from(place);
        if let Some(known) = self.known.get(&key) {
            return known.clone();
        }
        let made = self.picture(place, None, data);
        self.known.insert(key, made.clone());
        made
    }

    /// The texture in `data`; its kind is told by its bytes, or else by the path's extension (TGA has no magic number).
    fn picture(&mut self, name: &str, path: Option<&Path>, data: &[u8]) -> Result<TextureId, String> {
        let bad = |e: &dyn std::fmt::Display| format!("texture {name} cannot be decoded: {e}");
        let mut reader = image::ImageReader::new(Cursor::new(data)).with_guessed_format().map_err(|e| bad(&e))?;
        if reader.format().is_none() {
            let format = path.and_then(|p| image::ImageFormat::from_path(p).ok());
            reader.set_format(format.ok_or_else(|| bad(&"neither png, jpeg, tga nor bmp"))?);
        }
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(MAX_SIDE_PX);
        limits.max_image_height = Some(MAX_SIDE_PX);
        limits.max_alloc = Some(4 * u64::from(MAX_SIDE_PX).pow(2));
        reader.limits(limits);
        let picture = reader.decode().map_err(|e| bad(&e))?.into_rgba8();
        if picture.width() == 0 || picture.height() == 0 {
            return Err(bad(&"it has no texels"));
        }
        self.list.push(Texture {
            name: name.to_owned(),
            size: [picture.width(), picture.height()],
            rgba: picture.pixels().map(|p| p.0).collect(),
        });
        Ok(TextureId(self.list.len() as u32 - 1))
    }

    /// All of them, by id.
    pub(super) fn finish(self) -> Vec<Texture> {
        self.list
    }
}
