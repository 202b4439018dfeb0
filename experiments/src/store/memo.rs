//! Intermediate results of bakes, kept in the store.

use farfield_core::Fault;
use farfield_core::context::Memo;

use super::{Key, Store, key};

/// A memory behind which the store stands. What a bake remembers may depend on the scene and on captures, so both enter the key.
pub struct StoreMemo<'a> {
    /// The store.
    pub store: &'a Store,
    /// Hash of the scene and of the capturer's identity.
    pub inputs: Key,
}

impl Memo for StoreMemo<'_> {
    fn get_or(&self, own: &[u8; 32], make: &mut dyn FnMut() -> Result<Vec<u8>, Fault>) -> Result<Vec<u8>, Fault> {
        let key = key("memo", &[&self.inputs, own]);
        if let Some(known) = self.store.get(&key) {
            return Ok(known);
        }
        let made = make()?;
        self.store.put(&key, &made).map_err(|e| super::manifest::stored(&e))?;
        Ok(made)
    }
}
