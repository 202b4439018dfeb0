//! Keys: hashes of everything that a block was made from.

/// A block's name.
pub type Key = [u8; 32];

/// The key of some inputs: BLAKE3 over their kind, the store's format, and each part with its length before it, so that
/// parts cannot run into each other.
pub fn key(kind: &str, parts: &[&[u8]]) -> Key {
    let mut hash = blake3::Hasher::new_derive_key("farfield store, format 4");
    for part in std::iter::once(kind.as_bytes()).chain(parts.iter().copied()) {
        hash.update(&(part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    *hash.finalize().as_bytes()
}
