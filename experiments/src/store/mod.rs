//! The content-addressed store: what was built, by a hash of all that it was built from.
//!
//! A block's file name is its key. It appears whole or not at all (written aside, synced, renamed), carries a checksum, and is
//! never changed, so that builds can be killed and resumed, and several processes may share a store. A block whose checksum
//! fails is reported, removed and built again. Layout: `blocks/ab/cdef...`, `aside/` for what is being written, and `unfinished/` for what a bake
//! that is not yet whole remembers.

mod keys;
mod manifest;
mod memo;
mod meshes;

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use farfield_core::Fault;
pub use keys::{Key, key};
pub use manifest::{Manifest, Recorder, Stored, decode, encode};
pub use memo::StoreMemo;
pub use meshes::{pack, unpack};

/// Begins every block.
const MAGIC: &[u8; 4] = b"FFB1";
/// Magic, length before compression, checksum of the length and of what follows.
const HEADER: usize = 4 + 8 + 32;
/// zstd's own default: the store is written once and read a few times.
const COMPRESSION: i32 = 3;
/// Numbers of files written aside by this process, whichever store they are of.
static SERIAL: AtomicU64 = AtomicU64::new(0);
/// Where this process has cleared what an earlier one of the same number left aside.
static CLEARED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// A folder of blocks.
pub struct Store {
    root: PathBuf,
    /// Told of damaged blocks.
    report: Arc<dyn Fn(String) + Send + Sync>,
}

impl Store {
    /// Opens or makes a store, and clears what killed processes left aside.
    ///
    /// # Errors
    /// What making the folders gives.
    pub fn open(root: &Path, report: Arc<dyn Fn(String) + Send + Sync>) -> io::Result<Self> {
        fs::create_dir_all(root.join("blocks"))?;
        let aside = root.join("aside");
        fs::create_dir_all(&aside)?;
        // Opened once more, what has this process's number is being written.
        let first = CLEARED.lock().unwrap_or_else(PoisonError::into_inner).insert(fs::canonicalize(&aside)?);
        let alive = |pid: u32| match pid == std::process::id() {
            true => !first,
            // Its writer may be another process that is alive.
            false => Path::new("/proc").join(pid.to_string()).exists(),
        };
        for file in fs::read_dir(&aside)? {
            let file = file?.path();
            let owner = file.file_name().and_then(|n| n.to_str()?.split('-').next()?.parse::<u32>().ok());
            if !owner.is_some_and(alive) {
                _ = fs::remove_file(file);
            }
        }
        Ok(Self { root: root.to_owned(), report })
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where unfinished files are; they begin with the number of the process.
    pub(crate) fn aside(&self) -> PathBuf {
        self.root.join("aside")
    }

    fn file(&self, key: &Key) -> PathBuf {
        let name = hex(key);
        self.root.join("blocks").join(&name[..2]).join(&name[2..])
    }

    /// A block's bytes; `None` where it is absent or was damaged.
    pub fn get(&self, key: &Key) -> Option<Vec<u8>> {
        self.get_with_size(key).map(|b| b.0)
    }

    /// A block's bytes, and the size of its file.
    fn get_with_size(&self, key: &Key) -> Option<(Vec<u8>, u64)> {
        let bytes = self.whole(key)?;
        let raw = u64::from_le_bytes(bytes[4..12].try_into().ok()?);
        match zstd::bulk::decompress(&bytes[HEADER..], usize::try_from(raw).ok()?) {
            Ok(raw) => Some((raw, bytes.len() as u64)),
            Err(e) => self.damaged(key, &e.to_string()),
        }
    }

    /// A block that was stored with these sizes (file, before compression): for run time, where nothing is built and nothing removed.
    /// Takes no more memory than the two together, whatever the file holds.
    ///
    /// # Errors
    /// The file and what is wrong with it: absent, unreadable, of another size, a checksum that fails.
    pub fn read(&self, key: &Key, file_bytes: u64, raw_bytes: u64) -> Result<Vec<u8>, Fault> {
        let path = self.file(key);
        let bad = |cause: String| Fault::Data { place: path.display().to_string(), cause };
        let mut file = File::open(&path).map_err(|e| bad(format!("it cannot be opened: {e}")))?;
        let found = file.metadata().map_err(|e| bad(format!("it cannot be read: {e}")))?.len();
        if found != file_bytes || file_bytes < HEADER as u64 {
            return Err(bad(format!("it has {found} bytes; {file_bytes} were stored")));
        }
        let mut bytes = vec![0; file_bytes as usize];
        file.read_exact(&mut bytes).map_err(|e| bad(format!("its {file_bytes} bytes cannot be read: {e}")))?;
        if &bytes[..4] != MAGIC || checksum(&bytes[4..12], &bytes[HEADER..]) != bytes[12..HEADER] {
            return Err(bad("its checksum fails".into()));
        }
        if bytes[4..12] != raw_bytes.to_le_bytes() {
            return Err(bad(format!("it does not hold the {raw_bytes} bytes that were stored")));
        }
        zstd::bulk::decompress(&bytes[HEADER..], raw_bytes as usize).map_err(|e| bad(e.to_string()))
    }

    /// The size of a block's file where it is there and its checksum holds.
    pub fn check(&self, key: &Key) -> Option<u64> {
        self.whole(key).map(|b| b.len() as u64)
    }

    /// A block's file, checked.
    fn whole(&self, key: &Key) -> Option<Vec<u8>> {
        let bytes = match fs::read(self.file(key)) {
            Ok(b) => b,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return None,
            Err(e) => return self.damaged(key, &e.to_string()),
        };
        if bytes.len() < HEADER || &bytes[..4] != MAGIC {
            return self.damaged(key, "it has no header");
        }
        if checksum(&bytes[4..12], &bytes[HEADER..]) != bytes[12..HEADER] {
            return self.damaged(key, "its checksum fails");
        }
        Some(bytes)
    }

    fn damaged<T>(&self, key: &Key, why: &str) -> Option<T> {
        let file = self.file(key);
        (self.report)(format!("stored block {} is damaged ({why}); it is built again", file.display()));
        _ = fs::remove_file(file);
        None
    }

    /// Stores a block, unless it is there, and returns its file's size.
    ///
    /// # Errors
    /// What writing gives; the block is then not there.
    pub fn put(&self, key: &Key, raw: &[u8]) -> io::Result<u64> {
        if let Some(bytes) = self.check(key) {
            return Ok(bytes);
        }
        let packed = zstd::bulk::compress(raw, COMPRESSION)?;
        let number = SERIAL.fetch_add(1, Ordering::Relaxed);
        let aside = self.root.join("aside").join(format!("{}-{number}", std::process::id()));
        let mut file = File::create(&aside)?;
        let length = (raw.len() as u64).to_le_bytes();
        file.write_all(MAGIC)?;
        file.write_all(&length)?;
        file.write_all(&checksum(&length, &packed))?;
        file.write_all(&packed)?;
        file.sync_all()?;
        let home = self.file(key);
        let folder = home.parent().unwrap_or(&self.root);
        fs::create_dir_all(folder)?;
        fs::rename(&aside, &home)?;
        File::open(folder)?.sync_all()?;
        Ok((HEADER + packed.len()) as u64)
    }
}

/// A key as files are named.
pub(crate) fn hex(key: &Key) -> String {
    key.iter().map(|b| format!("{b:02x}")).collect()
}

fn checksum(length: &[u8], packed: &[u8]) -> [u8; 32] {
    *blake3::Hasher::new().update(length).update(packed).finalize().as_bytes()
}

#[cfg(test)]
mod tests;
