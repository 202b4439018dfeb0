//! What unfinished bakes know already, kept beside the store's blocks until they are whole.

use std::fs;

use farfield_core::context::Memo;

use super::{Key, Store, key};

/// The memory of one bake: a store of its own in `unfinished/`, whose folders appear with the first thing to remember.
pub struct StoreMemo(Store);

impl StoreMemo {
    /// Of the bake with this key.
    pub fn of(store: &Store, bake: &Key) -> Self {
        let root = store.root.join("unfinished").join(super::hex(bake));
        Self(Store { root, report: store.report.clone() })
    }

    /// Forgets all: the bake is whole.
    pub fn clear(&self) {
        _ = fs::remove_dir_all(&self.0.root);
    }
}

impl Memo for StoreMemo {
    fn get(&self, own: &[u8]) -> Option<Vec<u8>> {
        self.0.get(&key("memory", &[own]))
    }

    fn put(&self, own: &[u8], bytes: &[u8]) {
        let put = fs::create_dir_all(self.0.aside()).and_then(|()| self.0.put(&key("memory", &[own]), bytes));
        if let Err(e) = put {
            (self.0.report)(format!("what is built cannot be remembered in {}: {e}", self.0.root.display()));
        }
    }
}
