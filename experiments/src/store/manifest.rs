//! What a bake left: its index, its payloads' blocks, its claims. A manifest is stored last, so that a bake that has one is whole.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use farfield_core::Fault;
use farfield_core::claim::Claim;
use farfield_core::extent::Extent;
use farfield_core::id::LocalPayload;
use farfield_core::payload::Payload;
use farfield_core::strategy::{LeftOut, Sink};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{Key, Store, key, pack, unpack};
use crate::progress::Bar;

/// One payload's block.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stored {
    /// Its key.
    pub key: Key,
    /// Its file's size, bytes.
    pub bytes: u64,
    /// Its bytes before compression.
    pub raw_bytes: u64,
    /// What it holds.
    pub extent: Extent,
    /// Triangles in it.
    pub triangles: u64,
    /// Bytes of its texels.
    pub texture_bytes: u64,
}

impl Stored {
    fn of(key: Key, bytes: u64, raw_bytes: u64, payload: &Payload) -> Self {
        let (triangles, texture_bytes) = (payload.triangles(), payload.texture_bytes());
        Self { key, bytes, raw_bytes, extent: Extent::of_payload(payload), triangles, texture_bytes }
    }
}

/// A finished bake.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// The far field's own index.
    pub index: Vec<u8>,
    /// Its payloads.
    pub payloads: BTreeMap<LocalPayload, Stored>,
    /// What it claims, in a fixed order.
    pub claims: Vec<Claim>,
    /// What it left out, in a fixed order.
    pub left_out: Vec<LeftOut>,
}

impl Manifest {
    /// Triangles of all payloads.
    pub fn triangles(&self) -> u64 {
        self.payloads.values().map(|p| p.triangles).sum()
    }

    /// Bytes of all payloads' files.
    pub fn bytes(&self) -> u64 {
        self.payloads.values().map(|p| p.bytes).sum()
    }
}

/// Takes what a bake makes to the store.
pub struct Recorder<'a> {
    store: &'a Store,
    asset: Key,
    bar: &'a Bar,
    made: Mutex<Manifest>,
}

impl<'a> Recorder<'a> {
    /// For the bake with this key. The bar counts payloads.
    pub fn new(store: &'a Store, asset: Key, bar: &'a Bar) -> Self {
        Self { store, asset, bar, made: Mutex::default() }
    }

    fn key(&self, id: LocalPayload) -> Key {
        key("payload", &[&self.asset, &id.0.to_le_bytes()])
    }

    fn note(&self, id: LocalPayload, stored: Stored) -> Result<(), Fault> {
        self.bar.inc();
        let mut m = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        match m.payloads.insert(id, stored) {
            None => Ok(()),
            Some(_) => Err(Fault::Refused(format!("a bake wrote payload {} twice", id.0))),
        }
    }

    /// The manifest, stored; claims and what was left out are put in order, since bakes state them from many threads.
    ///
    /// # Errors
    /// What storing gives.
    pub fn finish(self, index: Vec<u8>) -> Result<Manifest, Fault> {
        let mut m = self.made.into_inner().unwrap_or_else(PoisonError::into_inner);
        m.index = index;
        m.claims.sort_by(|a, b| (a.quantity, a.payload).cmp(&(b.quantity, b.payload)).then(a.max.total_cmp(&b.max)));
        m.left_out.sort_by(|a, b| (&a.stage, &a.reason).cmp(&(&b.stage, &b.reason)));
        m.left_out.dedup();
        self.store.put(&self.asset, &encode(&m)?).map_err(|e| stored(&e))?;
        Ok(m)
    }
}

impl Sink for Recorder<'_> {
    fn put(&self, id: LocalPayload, payload: &Payload) -> Result<(), Fault> {
        let (key, raw) = (self.key(id), pack(payload)?);
        let bytes = self.store.put(&key, &raw).map_err(|e| stored(&e))?;
        self.note(id, Stored::of(key, bytes, raw.len() as u64, payload))
    }

    fn kept(&self, ids: &[LocalPayload]) -> Result<bool, Fault> {
        let whole = |id: &LocalPayload| {
            let key = self.key(*id);
            let (raw, bytes) = self.store.get_with_size(&key)?;
            Some(Stored::of(key, bytes, raw.len() as u64, &unpack(&raw).ok()?))
        };
        let Some(all) = ids.iter().map(whole).collect::<Option<Vec<_>>>() else { return Ok(false) };
        ids.iter().zip(all).try_for_each(|(id, s)| self.note(*id, s)).map(|()| true)
    }

    fn claim(&self, claim: Claim) {
        self.made.lock().unwrap_or_else(PoisonError::into_inner).claims.push(claim);
    }

    fn left_out(&self, what: LeftOut) {
        self.made.lock().unwrap_or_else(PoisonError::into_inner).left_out.push(what);
    }
}

pub(super) fn stored(e: &std::io::Error) -> Fault {
    Fault::Data { place: "store".into(), cause: e.to_string() }
}

/// As the store keeps it.
///
/// # Errors
/// [`Fault::Data`], which no type of this crate gives.
pub fn encode<T: Serialize>(value: &T) -> Result<Vec<u8>, Fault> {
    postcard::to_allocvec(value).map_err(|e| Fault::Data { place: "store".into(), cause: e.to_string() })
}

/// Back from [`encode`].
///
/// # Errors
/// [`Fault::Data`] where the bytes are of another type or version.
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Fault> {
    postcard::from_bytes(bytes).map_err(|e| Fault::Data { place: "store".into(), cause: e.to_string() })
}
