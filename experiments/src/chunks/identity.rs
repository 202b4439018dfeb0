//! What a file's contents are, without reading a file again that has not changed.
//!
//! A file is known by its path, length, time of change and number (inode). Where the store has seen exactly that before, it knows
//! the digest of the contents. As with git's index, a file that changed within the two seconds before it was read is not remembered: it could
//! change again without its time of change telling.

use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;
use std::time::{Duration, SystemTime};

use crate::store::{Key, Store, key};

/// The digest of a file's contents (BLAKE3). `go_on` is asked after every megabyte.
///
/// # Errors
/// What reading gives, and what `go_on` does.
pub fn digest(store: &Store, file: &Path, go_on: &dyn Fn() -> io::Result<()>) -> io::Result<[u8; 32]> {
    let path = std::path::absolute(file)?;
    let (before, began) = (std::fs::metadata(&path)?, SystemTime::now());
    // Devices and pipes may never end.
    if !before.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no file"));
    }
    let name = stamp(&path, &before)?;
    if let Some(known) = store.get(&name).and_then(|b| b.try_into().ok()) {
        return Ok(known);
    }
    let mut hash = blake3::Hasher::new();
    let mut reader = File::open(&path)?;
    let mut buffer = vec![0; 1 << 20];
    loop {
        go_on()?;
        match reader.read(&mut buffer)? {
            0 => break,
            n => _ = hash.update(&buffer[..n]),
        }
    }
    let made = *hash.finalize().as_bytes();
    let settled = began.duration_since(changed(&before)?).is_ok_and(|age| age > Duration::from_secs(2));
    if settled && stamp(&path, &std::fs::metadata(&path)?)? == name {
        store.put(&name, &made)?;
    }
    Ok(made)
}

/// When a file, or what is known of it, changed last.
fn changed(m: &Metadata) -> io::Result<SystemTime> {
    let modified = m.modified()?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let seconds = Duration::from_secs(u64::try_from(m.ctime()).unwrap_or(0));
        Ok(modified.max(SystemTime::UNIX_EPOCH + seconds + Duration::from_nanos(m.ctime_nsec() as u64)))
    }
    #[cfg(not(unix))]
    Ok(modified)
}

fn stamp(path: &Path, m: &Metadata) -> io::Result<Key> {
    let since = |t: SystemTime| t.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_nanos());
    #[cfg(unix)]
    let more = {
        use std::os::unix::fs::MetadataExt;
        [m.dev(), m.ino(), m.ctime() as u64, m.ctime_nsec() as u64]
    };
    #[cfg(not(unix))]
    let more = [0_u64; 4];
    let numbers = [&m.len().to_le_bytes()[..], &since(m.modified()?).to_le_bytes()].concat();
    Ok(key("stamp", &[path.as_os_str().as_encoded_bytes(), &numbers, bytemuck::cast_slice(&more)]))
}
