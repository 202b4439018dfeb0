//! Writing a chunk file, chunk after chunk. It is written aside, synced and renamed: it appears whole or not at all, and what a
//! killed process left is cleared when the store is opened.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use farfield_core::mesh::ChunkMesh;
use farfield_core::scene::{ChunkDigest, MeshInfo, Texture};
use tempfile::NamedTempFile;

use super::format::{self, Block, HEADER, Kept};

/// A file that is being written.
pub struct Writer {
    file: BufWriter<NamedTempFile>,
    at: u64,
    kept: Kept,
    /// The blocks of the mesh that is being written.
    blocks: Vec<Block>,
    digest: ChunkDigest,
}

impl Writer {
    /// Begins a file in the folder where unfinished files are.
    ///
    /// # Errors
    /// What making the file gives.
    pub fn new(aside: &Path) -> io::Result<Self> {
        let mut file = tempfile::Builder::new();
        // As any other file: the user's mask decides who may read it.
        #[cfg(unix)]
        file.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = file.prefix(&format!("{}-", std::process::id())).tempfile_in(aside)?;
        let mut file = BufWriter::with_capacity(1 << 20, file);
        file.write_all(&[0; HEADER])?;
        let digest = ChunkDigest::default();
        Ok(Self { file, at: HEADER as u64, kept: Kept::default(), blocks: vec![], digest })
    }

    fn block(&mut self, bytes: &[u8], uvs: bool, colors: bool) -> io::Result<Block> {
        let checksum = *blake3::hash(bytes).as_bytes();
        let block = Block { offset: self.at, bytes: bytes.len() as u64, checksum, uvs, colors };
        self.file.write_all(bytes)?;
        self.at += block.bytes;
        Ok(block)
    }

    /// Adds the next chunk of the mesh.
    ///
    /// # Errors
    /// What writing gives.
    pub fn chunk(&mut self, c: &ChunkMesh) -> io::Result<()> {
        self.digest.add(c);
        let block = self.block(&format::encode(c), !c.uvs.is_empty(), !c.colors.is_empty())?;
        self.blocks.push(block);
        Ok(())
    }

    /// Ends the mesh: `infos` describe the chunks that were added since the last one. Returns its number.
    ///
    /// # Panics
    /// Where chunks and descriptions are not equally many.
    pub fn mesh(&mut self, name: &str, infos: Vec<farfield_core::mesh::MeshChunk>, vertex_ids: u32) -> u32 {
        assert_eq!(infos.len(), self.blocks.len(), "a description a chunk");
        let digest = std::mem::take(&mut self.digest).finish();
        self.kept.meshes.push(MeshInfo::new(name, infos, vertex_ids, digest));
        self.kept.blocks.push(std::mem::take(&mut self.blocks));
        self.kept.meshes.len() as u32 - 1
    }

    /// Adds a texture.
    ///
    /// # Errors
    /// What writing gives.
    pub fn texture(&mut self, t: &Texture) -> io::Result<()> {
        let block = self.block(bytemuck::cast_slice(&t.rgba), false, false)?;
        self.kept.textures.push((t.name.clone(), t.size, block));
        Ok(())
    }

    /// Everything that is not a block, to be filled in.
    pub fn kept(&mut self) -> &mut Kept {
        &mut self.kept
    }

    /// Ends the file and puts it where it belongs.
    ///
    /// # Errors
    /// What writing gives; there is no file then.
    pub fn finish(mut self, home: &Path) -> io::Result<()> {
        let index = postcard::to_allocvec(&self.kept).map_err(io::Error::other)?;
        self.file.write_all(&index)?;
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(&format::header(self.at, &index))?;
        let file = self.file.into_inner().map_err(|e| e.into_error())?;
        file.as_file().sync_all()?;
        let folder = home.parent().unwrap_or(Path::new(""));
        std::fs::create_dir_all(folder)?;
        file.persist(home).map_err(|e| e.error)?;
        File::open(folder)?.sync_all()
    }
}
