//! glTF buffers and accessors: every offset, stride and count is held against the bytes that are there before any is read.
//! Buffers are in memory, or in files of which a window of items is read at a time.
//!
//! Follows glTF 2.0 sections 3.6 (buffers, accessors, sparse accessors) and 3.6.2.2 (integers, normalised or not: so
//! KHR_mesh_quantization needs nothing more). O(n).

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::BTreeSet;
use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};

use base64::Engine;
use gltf::json::accessor::{ComponentType, IndexComponentType};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Root, buffer};

use super::{LoadError, bytes, mtl};
use crate::chunks::ReadAt;

/// The bytes of a buffer.
pub(super) enum Buffer<'a> {
    /// In memory.
    Held(Cow<'a, [u8]>),
    /// `len` bytes of a file, from `start` on.
    Kept { file: File, start: u64, len: u64 },
}

impl Buffer<'_> {
    fn len(&self) -> u64 {
        match self {
            Self::Held(data) => data.len() as u64,
            Self::Kept { len, .. } => *len,
        }
    }

    /// Bytes that are there.
    fn bytes(&self, range: Range<u64>) -> std::io::Result<Cow<'_, [u8]>> {
        match self {
            Self::Held(data) => Ok(data[range.start as usize..range.end as usize].into()),
            Self::Kept { file, start, .. } => {
                let mut out = vec![0; (range.end - range.start) as usize];
                file.read_at(&mut out, start + range.start)?;
                Ok(out.into())
            }
        }
    }
}

/// The document with its buffers.
pub(super) struct Document<'a> {
    pub(super) path: &'a Path,
    pub(super) root: &'a Root,
    buffers: Vec<Buffer<'a>>,
    /// Items that may still be read: accessors are shared, so that a small file could ask for the same bytes for ever.
    left: Cell<u64>,
}

/// How often, on average, each byte may be read as an item.
const MAX_READS: u64 = 1024;

impl<'a> Document<'a> {
    /// Opens every buffer: the GLB's own, data URIs and files beside the document; these stay files where `keep` says so.
    pub(super) fn new(
        path: &'a Path,
        root: &'a Root,
        mut bin: Option<Buffer<'a>>,
        keep: bool,
        beside: &mut BTreeSet<PathBuf>,
    ) -> Result<Self, LoadError> {
        let mut buffers = vec![];
        for (i, b) in root.buffers.iter().enumerate() {
            let bad = |cause: String| LoadError::data(path, format!("buffer {i}"), cause);
            let data = match &b.uri {
                Some(uri) => {
                    let file = uri_file(path, uri);
                    beside.extend(file.clone());
                    match file.filter(|_| keep).map(|f| kept(&f)).transpose()?.flatten() {
                        Some(kept) => kept,
                        None => Buffer::Held(uri_bytes(path, uri).map_err(bad)?.into()),
                    }
                }
                None => match bin.take_if(|_| i == 0) {
                    Some(bin) => bin,
                    None => return Err(bad("has neither a uri nor a binary chunk".into())),
                },
            };
            if data.len() < b.byte_length.0 {
                return Err(bad(format!("has {} bytes, {} were announced", data.len(), b.byte_length.0)));
            }
            buffers.push(data);
        }
        let left = Cell::new(0);
        let doc = Self { path, root, buffers, left };
        doc.left.set(MAX_READS * doc.held().max(1 << 16));
        Ok(doc)
    }

    /// The bytes of all buffers.
    pub(super) fn held(&self) -> u64 {
        self.buffers.iter().map(Buffer::len).sum()
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, id: Index<buffer::View>) -> Result<Cow<'_, [u8]>, LoadError> {
        let (buffer, range) = self.place(id)?;
        self.bytes(buffer, range)
    }

    fn bytes(&self, buffer: usize, range: Range<u64>) -> Result<Cow<'_, [u8]>, LoadError> {
        let failed = |cause| LoadError::Read { file: self.path.to_owned(), cause };
        self.buffers[buffer].bytes(range).map_err(failed)
    }

    /// Which bytes of which buffer a view is: they are there.
    fn place(&self, id: Index<buffer::View>) -> Result<(usize, Range<u64>), LoadError> {
        let v = &self.root.buffer_views[id.value()];
        let len = self.buffers[v.buffer.value()].len();
        let start = v.byte_offset.unwrap_or_default().0;
        let end = start.checked_add(v.byte_length.0).filter(|&end| end <= len);
        end.map(|end| (v.buffer.value(), start..end)).ok_or_else(|| {
            let cause = format!("{} bytes at {start} of a buffer of {len}", v.byte_length.0);
            LoadError::data(self.path, format!("bufferView {}", id.value()), cause)
        })
    }

    /// Those in `window` of `count` items of `size` bytes each, `stride` apart, from byte `offset` of a view.
    fn items(
        &self,
        id: Index<buffer::View>,
        offset: u64,
        size: usize,
        count: u64,
        window: Range<u64>,
    ) -> Result<Items<'_>, LoadError> {
        let (buffer, view) = self.place(id)?;
        let len = view.end - view.start;
        let stride = self.root.buffer_views[id.value()].byte_stride.map_or(size, |s| s.0);
        // The last item needs `size` bytes only.
        let end = count.saturating_sub(1).checked_mul(stride as u64).and_then(|n| n.checked_add(size as u64));
        let end = end.and_then(|n| n.checked_add(offset));
        if stride < size || count > 0 && end.is_none_or(|n| n > len) {
            let cause = format!(
                "{count} items of {size} bytes, {stride} apart, from byte {offset} on do not fit in {len} bytes"
            );
            return Err(LoadError::data(self.path, format!("bufferView {}", id.value()), cause));
        }
        let (window, stride) = (window.start..window.end.min(count), stride as u64);
        let count = window.end.saturating_sub(window.start);
        if count == 0 {
            return Ok(Items { data: Cow::Borrowed(&[]), size, stride: stride as usize, count: 0 });
        }
        let first = view.start + offset + window.start * stride;
        let data = self.bytes(buffer, first..first + (count - 1) * stride + size as u64)?;
        Ok(Items { data, size, stride: stride as usize, count: count as usize })
    }

    /// Whether an accessor's items are there.
    pub(super) fn fits(&self, id: Index<Accessor>) -> Result<(), LoadError> {
        self.raw(id, 0..0).map(drop)
    }

    /// How many items an accessor has.
    pub(super) fn count(&self, id: Index<Accessor>) -> u64 {
        self.root.accessors[id.value()].count.0
    }

    /// An accessor as numbers, `N` an item; fewer components than `N` leave the rest at `fill`.
    pub(super) fn numbers<const N: usize>(&self, id: Index<Accessor>, fill: f32) -> Result<Vec<[f32; N]>, LoadError> {
        self.some_numbers(id, fill, 0..self.count(id))
    }

    /// Those of its items that are in `window`.
    pub(super) fn some_numbers<const N: usize>(
        &self,
        id: Index<Accessor>,
        fill: f32,
        window: Range<u64>,
    ) -> Result<Vec<[f32; N]>, LoadError> {
        let raw = self.raw(id, window)?;
        let normalized = self.root.accessors[id.value()].normalized;
        Ok(raw
            .values
            .chunks_exact(raw.components)
            .map(|c| {
                let mut out = [fill; N];
                out.iter_mut()
                    .zip(c)
                    .for_each(|(o, &v)| *o = if normalized { raw.kind.normalized(v) } else { v as f32 });
                out
            })
            .collect())
    }

    /// An accessor as indices.
    pub(super) fn indices(&self, id: Index<Accessor>) -> Result<Vec<u32>, LoadError> {
        self.some_indices(id, 0..self.count(id))
    }

    /// Those of its items that are in `window`.
    pub(super) fn some_indices(&self, id: Index<Accessor>, window: Range<u64>) -> Result<Vec<u32>, LoadError> {
        let raw = self.raw(id, window)?;
        if !matches!(raw.kind.0, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) || raw.components != 1 {
            let cause = "indices are not unsigned scalars";
            return Err(LoadError::data(self.path, format!("accessor {}", id.value()), cause));
        }
        // Exact: 64-bit floats hold every 32-bit integer.
        Ok(raw.values.into_iter().map(|v| v as u32).collect())
    }

    fn raw(&self, id: Index<Accessor>, window: Range<u64>) -> Result<Raw, LoadError> {
        let a = &self.root.accessors[id.value()];
        let bad = |cause: &str| LoadError::data(self.path, format!("accessor {}", id.value()), cause);
        let (Checked::Valid(kind), Checked::Valid(shape)) = (a.component_type, a.type_) else {
            return Err(bad("has no valid type"));
        };
        let (kind, components) = (Kind(kind.0), shape.multiplicity());
        let size = kind.0.size() * components;
        let mut values = match a.buffer_view {
            Some(view) => {
                let offset = a.byte_offset.unwrap_or_default().0;
                let items = self.items(view, offset, size, a.count.0, window.clone())?;
                let left = self.left.get().checked_sub(items.count as u64);
                self.left.set(left.ok_or_else(|| bad("is read when every byte has been read 1,024 times over"))?);
                kind.read(&items)
            }
            None => {
                // Zeros, which no bytes back: as many as the sparse part could sensibly fill.
                let Some(sparse) = &a.sparse else { return Err(bad("has no bufferView")) };
                if a.count.0 < sparse.count.0 || a.count.0 > self.held().max(1 << 16) {
                    return Err(bad("claims more items than the file has bytes"));
                }
                vec![0.0; (window.end - window.start) as usize * components]
            }
        };
        if let Some(s) = &a.sparse {
            let Checked::Valid(IndexComponentType(index)) = s.indices.component_type else {
                return Err(bad("its sparse indices have no valid type"));
            };
            let (n, i, v) = (s.count.0, &s.indices, &s.values);
            let at = Kind(index).read(&self.items(i.buffer_view, i.byte_offset.0, index.size(), n, 0..n)?);
            let new = kind.read(&self.items(v.buffer_view, v.byte_offset.0, size, n, 0..n)?);
            for (i, new) in at.into_iter().zip(new.chunks_exact(components)) {
                let i = i as u64;
                if i >= a.count.0 {
                    return Err(bad("its sparse indices leave it"));
                }
                if window.contains(&i) {
                    let first = (i - window.start) as usize * components;
                    values[first..first + components].copy_from_slice(new);
                }
            }
        }
        Ok(Raw { values, components, kind })
    }
}

/// Items of one size at equal distances, all inside `data`.
struct Items<'a> {
    data: Cow<'a, [u8]>,
    size: usize,
    stride: usize,
    count: usize,
}

/// An accessor's components in a row.
struct Raw {
    values: Vec<f64>,
    components: usize,
    kind: Kind,
}

#[derive(Clone, Copy)]
struct Kind(ComponentType);

impl Kind {
    fn read(self, items: &Items<'_>) -> Vec<f64> {
        let step = self.0.size();
        let mut out = Vec::with_capacity(items.count * (items.size / step));
        for i in 0..items.count {
            let item = &items.data[i * items.stride..i * items.stride + items.size];
            out.extend(item.chunks_exact(step).map(|b| match self.0 {
                ComponentType::I8 => f64::from(b[0] as i8),
                ComponentType::U8 => f64::from(b[0]),
                ComponentType::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
                ComponentType::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
                ComponentType::U32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
                ComponentType::F32 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            }));
        }
        out
    }

    /// glTF 2.0, section 3.11: signed integers c / (2^(b-1) - 1) but not below -1, unsigned ones c / (2^b - 1).
    fn normalized(self, v: f64) -> f32 {
        let v = match self.0 {
            ComponentType::I8 => (v / 127.0).max(-1.0),
            ComponentType::U8 => v / 255.0,
            ComponentType::I16 => (v / 32767.0).max(-1.0),
            ComponentType::U16 => v / 65535.0,
            ComponentType::U32 | ComponentType::F32 => v,
        };
        v as f32
    }
}

/// The file behind a URI, where it is one.
fn uri_file(path: &Path, uri: &str) -> Option<PathBuf> {
    let file = !uri.starts_with("data:") && !uri.contains("://");
    file.then(|| mtl::resolve(path.parent().unwrap_or(Path::new("")), &unescaped(uri)))
}

/// A file as a buffer; `None` where it has to be unpacked, or is none.
fn kept(path: &Path) -> Result<Option<Buffer<'static>>, LoadError> {
    let failed = |cause| LoadError::Read { file: path.to_owned(), cause };
    // Opening a pipe waits for its writer.
    let Some(meta) = std::fs::metadata(path).ok().filter(|m| m.is_file()) else { return Ok(None) };
    let file = File::open(path).map_err(failed)?;
    let mut magic = [0; 2];
    let plain = meta.len() > 2 && file.read_at(&mut magic, 0).is_ok() && magic != [0x1f, 0x8b];
    Ok(plain.then(|| Buffer::Kept { file, start: 0, len: meta.len() }))
}

/// The bytes behind a URI: `data:...;base64,...`, or a file beside the document.
pub(super) fn uri_bytes(path: &Path, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let (head, body) = rest.split_once(',').ok_or("its data URI has no comma")?;
        if !head.ends_with(";base64") {
            return Err("its data URI is not base64".into());
        }
        let engine = base64::engine::GeneralPurpose::new(
            &base64::alphabet::STANDARD,
            base64::engine::GeneralPurposeConfig::new()
                .with_decode_padding_mode(base64::engine::DecodePaddingMode::Indifferent),
        );
        return engine.decode(body.trim()).map_err(|e| format!("its data URI: {e}"));
    }
    if uri.contains("://") {
        return Err(format!("\"{}\" is on the network; only files are read", bytes::excerpt(uri, 80)));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    bytes::read(&mtl::resolve(folder, &unescaped(uri))).map_err(|e| e.to_string())
}

/// RFC 3986, section 2.1: %XX is a byte.
pub(super) fn unescaped(uri: &str) -> String {
    let mut out = vec![];
    let mut rest = uri.as_bytes();
    while let Some((&b, after)) = rest.split_first() {
        let hex = (b == b'%').then(|| after.get(..2).and_then(|h| std::str::from_utf8(h).ok())).flatten();
        match hex.and_then(|h| u8::from_str_radix(h, 16).ok()) {
            Some(v) => {
                out.push(v);
                rest = &after[2..];
            }
            None => {
                out.push(b);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}
