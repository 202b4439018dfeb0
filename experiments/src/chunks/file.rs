//! A chunk file, read on demand.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use farfield_core::Fault;
use farfield_core::id::MeshChunkId;
use farfield_core::mesh::ChunkMesh;
use farfield_core::scene::{Geometry, Texture};

use super::cache::{Cache, CacheError};
use super::format::{self, Block, HEADER, Kept};

/// Bytes at a place, without a cursor: many threads read at once.
pub trait ReadAt: Send + Sync {
    /// Fills `buffer` from `offset` on.
    ///
    /// # Errors
    /// What reading gives; the end of the file before the buffer is full is an error.
    fn read_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()>;
}

impl ReadAt for File {
    #[cfg(unix)]
    fn read_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(self, buffer, offset)
    }

    #[cfg(windows)]
    fn read_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        let mut done = 0;
        while done < buffer.len() {
            match std::os::windows::fs::FileExt::seek_read(self, &mut buffer[done..], offset + done as u64)? {
                0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                n => done += n,
            }
        }
        Ok(())
    }
}

/// The way to the triangles of a chunk file.
pub struct ChunkFile {
    path: PathBuf,
    source: Box<dyn ReadAt>,
    kept: Kept,
    /// The number of each mesh's first chunk.
    starts: Vec<u32>,
    cache: Cache<ChunkMesh>,
}

impl ChunkFile {
    /// Opens a file; of its chunks at most `memory_bytes` are held and on the way at once.
    ///
    /// # Errors
    /// [`Fault::Data`] with the file and what is wrong with its header or index.
    pub fn open(path: &Path, memory_bytes: u64) -> Result<Self, Fault> {
        let bad = |cause: String| Fault::Data { place: path.display().to_string(), cause };
        let file = File::open(path).map_err(|e| bad(e.to_string()))?;
        let bytes = file.metadata().map_err(|e| bad(e.to_string()))?.len();
        Self::over(path, Box::new(file), bytes, memory_bytes)
    }

    /// The same over any source of `bytes` bytes.
    ///
    /// # Errors
    /// As [`ChunkFile::open`].
    pub fn over(path: &Path, source: Box<dyn ReadAt>, bytes: u64, memory_bytes: u64) -> Result<Self, Fault> {
        let bad = |cause: String| Fault::Data { place: path.display().to_string(), cause };
        let mut header = [0; HEADER];
        source.read_at(&mut header, 0).map_err(|e| bad(format!("its header cannot be read: {e}")))?;
        let (at, len, checksum) = format::index_place(&header).map_err(|c| bad(c.into()))?;
        if at.checked_add(len) != Some(bytes) {
            return Err(bad(format!("it has {bytes} bytes; its header says {at} and {len}: it is truncated")));
        }
        let mut index = vec![0; len as usize];
        source.read_at(&mut index, at).map_err(|e| bad(format!("its index cannot be read: {e}")))?;
        if *blake3::hash(&index).as_bytes() != checksum {
            return Err(bad("the checksum of its index fails".into()));
        }
        let kept: Kept = postcard::from_bytes(&index).map_err(|e| bad(format!("its index: {e}")))?;
        let mut starts = vec![0];
        for (m, blocks) in kept.meshes.iter().zip(&kept.blocks) {
            if m.chunks.len() != blocks.len() {
                return Err(bad(format!("mesh \"{}\" has {} chunks, {} blocks", m.name, m.chunks.len(), blocks.len())));
            }
            starts.push(starts[starts.len() - 1] + blocks.len() as u32);
        }
        Ok(Self { path: path.to_owned(), source, kept, starts, cache: Cache::new(memory_bytes) })
    }

    /// Its index.
    pub fn kept(&self) -> &Kept {
        &self.kept
    }

    /// The most bytes of chunks that were held and on the way at once.
    pub fn peak_bytes(&self) -> u64 {
        self.cache.peak_bytes()
    }

    /// Its textures.
    ///
    /// # Errors
    /// [`Fault::Data`] with the file, the texture and the cause.
    pub fn textures(&self) -> Result<Vec<Texture>, Fault> {
        let read = |(name, size, block): &(String, [u32; 2], Block)| {
            let bytes = self.read(block, || format!("texture \"{name}\""))?;
            Ok(Texture { name: name.clone(), size: *size, rgba: bytemuck::pod_collect_to_vec(&bytes) })
        };
        self.kept.textures.iter().map(read).collect()
    }

    /// A block's bytes, checked. What fails is read once more: discs and networks have moments of weakness.
    fn read(&self, block: &Block, what: impl Fn() -> String) -> Result<Vec<u8>, Fault> {
        let once = || -> Result<Vec<u8>, String> {
            let mut bytes = vec![0; block.bytes as usize];
            let place = || format!("{} bytes at {}", block.bytes, block.offset);
            self.source.read_at(&mut bytes, block.offset).map_err(|e| format!("{} cannot be read: {e}", place()))?;
            match *blake3::hash(&bytes).as_bytes() == block.checksum {
                true => Ok(bytes),
                false => Err(format!("the checksum of its {} fails", place())),
            }
        };
        once().or_else(|_| once()).map_err(|cause| Fault::Data {
            place: format!("{}: {}", self.path.display(), what()),
            cause: format!("{cause} (read twice); delete the file to have it made anew"),
        })
    }
}

impl Geometry for ChunkFile {
    fn with(&self, id: MeshChunkId, f: &mut dyn FnMut(&ChunkMesh)) -> Result<(), Fault> {
        let mesh = self.kept.meshes.get(id.mesh.index());
        let found = mesh.and_then(|m| Some((m, m.chunks.get(id.chunk as usize)?)));
        let Some((mesh, info)) = found else {
            return Err(Fault::Data { place: format!("{id:?}"), cause: "there is no such chunk".into() });
        };
        let block = &self.kept.blocks[id.mesh.index()][id.chunk as usize];
        let what = || format!("chunk {} of mesh \"{}\"", id.chunk, mesh.name);
        let load = || {
            let bytes = self.read(block, what)?;
            format::decode(&bytes, info, block).ok_or_else(|| Fault::Data {
                place: format!("{}: {}", self.path.display(), what()),
                cause: "its block is not of the size that the index says".into(),
            })
        };
        let number = self.starts[id.mesh.index()] + id.chunk;
        let chunk = self.cache.get(number, format::held_bytes(info, block), block.bytes, load);
        let chunk = chunk.map_err(|e| match e {
            CacheError::Load(fault) => fault,
            e => Fault::Data {
                place: format!("{}: {}", self.path.display(), what()),
                cause: format!("{e}: [scene] memory_bytes is too small"),
            },
        })?;
        f(&chunk);
        Ok(())
    }

    fn read_bytes(&self, id: MeshChunkId) -> u64 {
        let info = self.kept.meshes.get(id.mesh.index()).and_then(|m| m.chunks.get(id.chunk as usize));
        let block = self.kept.blocks.get(id.mesh.index()).and_then(|b| b.get(id.chunk as usize));
        info.zip(block).map_or(0, |(info, block)| format::held_bytes(info, block) + block.bytes)
    }

    fn let_go(&self) {
        self.cache.let_go();
    }
}
