//! A cache with a hard limit on its bytes: least recently used first out, safe for many threads.
//!
//! What is in use is pinned and stays; what is being read counts in full before the first byte is read. So the sum of what is
//! held and what is on its way never exceeds the limit. Where everything held is in use, a reader waits until some of it is
//! free; a thread that itself holds a value does not wait, since it might wait for itself: it is told that the limit is too
//! small. O(log values) a use.

use std::cell::Cell;
use std::collections::{BTreeMap, HashMap};
use std::ops::Deref;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

thread_local! {
    /// Values that this thread holds, of any cache.
    static HELD: Cell<usize> = const { Cell::new(0) };
}

/// Values by number.
pub struct Cache<V> {
    limit_bytes: u64,
    state: Mutex<State<V>>,
    changed: Condvar,
}

struct State<V> {
    /// Held and on the way.
    bytes: u64,
    peak_bytes: u64,
    clock: u64,
    slots: HashMap<u32, Slot<V>>,
    /// Values that nobody uses, by the time of their last use.
    idle: BTreeMap<u64, u32>,
    idle_bytes: u64,
}

enum Slot<V> {
    Loading,
    Held { value: Arc<V>, bytes: u64, users: usize, used_at: u64 },
}

/// Why a value is not to be had.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum CacheError<E> {
    /// It alone is larger than the limit.
    #[error("takes {bytes} bytes while it is read; the limit is {limit_bytes}")]
    TooLarge {
        /// What it takes.
        bytes: u64,
        /// What there is.
        limit_bytes: u64,
    },
    /// This thread holds another value, and both do not fit.
    #[error("{bytes} bytes do not fit beside what the same thread holds; the limit is {limit_bytes}")]
    Nested {
        /// What it takes.
        bytes: u64,
        /// What there is.
        limit_bytes: u64,
    },
    /// What loading gave.
    #[error("{0}")]
    Load(E),
}

/// A value in use.
pub struct Pin<'a, V> {
    cache: &'a Cache<V>,
    key: u32,
    value: Option<Arc<V>>,
}

impl<V> Deref for Pin<'_, V> {
    type Target = V;
    fn deref(&self) -> &V {
        self.value.as_ref().expect("there until it is dropped")
    }
}

impl<V> Drop for Pin<'_, V> {
    fn drop(&mut self) {
        self.value = None;
        HELD.set(HELD.get() - 1);
        let mut state = self.cache.lock();
        if let Some(Slot::Held { users, used_at, bytes, .. }) = state.slots.get_mut(&self.key) {
            *users -= 1;
            if *users == 0 {
                let (at, bytes) = (*used_at, *bytes);
                state.idle.insert(at, self.key);
                state.idle_bytes += bytes;
                self.cache.changed.notify_all();
            }
        }
    }
}

impl<V> Cache<V> {
    /// One that never holds more than `limit_bytes`.
    pub fn new(limit_bytes: u64) -> Self {
        let slots = HashMap::new();
        let state = State { bytes: 0, peak_bytes: 0, clock: 0, slots, idle: BTreeMap::new(), idle_bytes: 0 };
        Self { limit_bytes, state: Mutex::new(state), changed: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, State<V>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The most bytes that were held and on the way at once.
    pub fn peak_bytes(&self) -> u64 {
        self.lock().peak_bytes
    }

    /// Drops all values that nobody uses.
    pub fn let_go(&self) {
        let mut state = self.lock();
        while let Some((_, key)) = state.idle.pop_first() {
            state.drop_idle(key);
        }
        self.changed.notify_all();
    }

    /// The value with this number, loaded where it is not held. It takes `held_bytes`, and `extra_bytes` more while it is loaded.
    /// Of several threads that ask for one value, one loads it.
    ///
    /// # Errors
    /// [`CacheError`]; the next to ask loads anew.
    pub fn get<E>(
        &self,
        key: u32,
        held_bytes: u64,
        extra_bytes: u64,
        load: impl FnOnce() -> Result<V, E>,
    ) -> Result<Pin<'_, V>, CacheError<E>> {
        let bytes = held_bytes + extra_bytes;
        let limit_bytes = self.limit_bytes;
        if bytes > limit_bytes {
            return Err(CacheError::TooLarge { bytes, limit_bytes });
        }
        let mut state = self.lock();
        loop {
            let loading = match state.slots.get(&key) {
                Some(Slot::Held { .. }) => return Ok(self.pin(&mut state, key)),
                slot => slot.is_some(),
            };
            // Who is loading it has its room already and waits for nobody.
            if !loading && state.make_room(bytes, limit_bytes) {
                break;
            }
            if !loading && HELD.get() > 0 {
                return Err(CacheError::Nested { bytes, limit_bytes });
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.bytes += bytes;
        state.peak_bytes = state.peak_bytes.max(state.bytes);
        state.slots.insert(key, Slot::Loading);
        drop(state);
        let _loading = Loading { cache: self, key, bytes };
        let value = load().map_err(CacheError::Load)?;
        let mut state = self.lock();
        state.bytes -= extra_bytes;
        let slot = Slot::Held { value: Arc::new(value), bytes: held_bytes, users: 0, used_at: 0 };
        state.slots.insert(key, slot);
        let pin = self.pin(&mut state, key);
        drop(state);
        Ok(pin)
    }

    fn pin(&self, state: &mut State<V>, key: u32) -> Pin<'_, V> {
        state.clock += 1;
        let now = state.clock;
        let mut taken = None;
        let State { slots, idle, idle_bytes, .. } = &mut *state;
        if let Some(Slot::Held { value, users, used_at, bytes }) = slots.get_mut(&key) {
            if idle.remove(used_at).is_some() {
                *idle_bytes -= *bytes;
            }
            *users += 1;
            *used_at = now;
            taken = Some(value.clone());
        }
        HELD.set(HELD.get() + 1);
        Pin { cache: self, key, value: taken }
    }
}

impl<V> State<V> {
    /// Drops idle values, the least recently used first, until `bytes` more fit; `false`, and none is dropped, where they never do.
    fn make_room(&mut self, bytes: u64, limit_bytes: u64) -> bool {
        if self.bytes - self.idle_bytes + bytes > limit_bytes {
            return false;
        }
        while self.bytes + bytes > limit_bytes {
            let Some((_, key)) = self.idle.pop_first() else { return false };
            self.drop_idle(key);
        }
        true
    }

    /// Drops a value that is idle no longer.
    fn drop_idle(&mut self, key: u32) {
        if let Some(Slot::Held { bytes, .. }) = self.slots.remove(&key) {
            self.bytes -= bytes;
            self.idle_bytes -= bytes;
        }
    }
}

/// A value that is being read: its room and its slot are given back when it did not come, whatever the reason.
struct Loading<'a, V> {
    cache: &'a Cache<V>,
    key: u32,
    bytes: u64,
}

impl<V> Drop for Loading<'_, V> {
    fn drop(&mut self) {
        let mut state = self.cache.lock();
        if matches!(state.slots.get(&self.key), Some(Slot::Loading)) {
            state.slots.remove(&self.key);
            state.bytes -= self.bytes;
        }
        drop(state);
        self.cache.changed.notify_all();
    }
}
