//! Reading files whole, gzip undone wherever its magic number stands, and text in whatever encoding it comes.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use super::LoadError;

/// The most that a gzip stream may unpack to: gzip packs at best 1 : 1032, so that 4 MB could ask for 4 GB of memory.
pub(super) const MAX_UNPACKED_BYTES: u64 = 2 << 30;

/// The bytes of a file, unpacked if it is gzipped.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, LoadError> {
    let failed = |cause| LoadError::Read { file: path.to_owned(), cause };
    // Devices and pipes may never end.
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        return Err(failed(std::io::Error::other("it is not a plain file")));
    }
    let raw = std::fs::read(path).map_err(failed)?;
    if !raw.starts_with(&[0x1f, 0x8b]) {
        return Ok(raw);
    }
    let mut out = vec![];
    let n = flate2::read::MultiGzDecoder::new(&raw[..])
        .take(MAX_UNPACKED_BYTES + 1)
        .read_to_end(&mut out)
        .map_err(|e| LoadError::data(path, "gzip stream", e.to_string()))?;
    if n as u64 > MAX_UNPACKED_BYTES {
        return Err(LoadError::data(path, "gzip stream", format!("unpacks to more than {MAX_UNPACKED_BYTES} bytes")));
    }
    Ok(out)
}

/// Bytes that are read one after another, counted.
pub(super) struct Input<'a> {
    from: Box<dyn BufRead + 'a>,
    read: u64,
    /// How many there are; not known of gzip streams.
    total: Option<u64>,
}

impl<'a> Input<'a> {
    /// Bytes in memory.
    pub(super) fn held(data: &'a [u8]) -> Self {
        Self { from: Box::new(data), read: 0, total: Some(data.len() as u64) }
    }

    /// A file, unpacked if it is gzipped.
    pub(super) fn open(path: &Path) -> Result<Self, LoadError> {
        let failed = |cause| LoadError::Read { file: path.to_owned(), cause };
        if !std::fs::metadata(path).map_err(failed)?.is_file() {
            return Err(failed(io::Error::other("it is not a plain file")));
        }
        let file = File::open(path).map_err(failed)?;
        let total = file.metadata().map_err(failed)?.len();
        let mut raw = BufReader::with_capacity(1 << 20, file);
        if !raw.fill_buf().map_err(failed)?.starts_with(&[0x1f, 0x8b]) {
            return Ok(Self { from: Box::new(raw), read: 0, total: Some(total) });
        }
        let unpacked = flate2::bufread::MultiGzDecoder::new(raw);
        Ok(Self { from: Box::new(BufReader::with_capacity(1 << 20, unpacked)), read: 0, total: None })
    }

    /// Whether what comes next begins with these bytes.
    pub(super) fn starts_with(&mut self, bytes: &[u8]) -> bool {
        self.from.fill_buf().is_ok_and(|b| b.starts_with(bytes))
    }

    /// Bytes that have been read.
    pub(super) fn position(&self) -> u64 {
        self.read
    }

    /// Bytes that are left, where that is known.
    pub(super) fn left(&self) -> Option<u64> {
        self.total.map(|t| t.saturating_sub(self.read))
    }
}

impl Read for Input<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.from.read(buffer)?;
        self.read += n as u64;
        Ok(n)
    }
}

impl BufRead for Input<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.from.fill_buf()
    }

    fn consume(&mut self, n: usize) {
        self.read += n as u64;
        self.from.consume(n);
    }
}

/// Text from UTF-8 or, by its byte order mark, UTF-16. Bytes that are neither (Latin-1 names and comments) become U+FFFD.
pub(super) fn text(bytes: &[u8]) -> Cow<'_, str> {
    let wide = |unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..].chunks_exact(2).map(|b| unit([b[0], b[1]])).collect();
        Cow::Owned(String::from_utf16_lossy(&units))
    };
    match bytes {
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => String::from_utf8_lossy(rest),
        _ => String::from_utf8_lossy(bytes),
    }
}

/// At most `n` characters of `s`, for error texts; control characters become U+FFFD.
pub(super) fn excerpt(s: &str, n: usize) -> String {
    let shown = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let mut out: String = s.trim().chars().take(n).map(shown).collect();
    if s.trim().chars().count() > n {
        out.push_str("...");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn text_is_read_in_four_encodings() {
        let be = [0xfe, 0xff, 0, b'v', 0, b' '];
        let le = [0xff, 0xfe, b'v', 0, b' ', 0];
        for bytes in [&be[..], &le, b"\xef\xbb\xbfv ", b"v "] {
            assert_eq!(text(bytes), "v ");
        }
        assert_eq!(text(b"caf\xe9"), "caf\u{fffd}");
    }

    #[test]
    fn gzip_is_undone_and_its_damage_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.obj.gz");
        let mut packed = flate2::write::GzEncoder::new(vec![], flate2::Compression::default());
        packed.write_all(b"hello hello hello").unwrap();
        let packed = packed.finish().unwrap();
        std::fs::write(&path, &packed).unwrap();
        assert_eq!(read(&path).unwrap(), b"hello hello hello");
        std::fs::write(&path, &packed[..packed.len() - 9]).unwrap();
        let e = read(&path).unwrap_err().to_string();
        assert!(e.contains("a.obj.gz: gzip stream: "), "{e}");
    }
}
