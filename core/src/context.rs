//! What a stage gets from outside: captures, an executor, a memory of intermediate results, a way to be stopped.

use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::id::LocalPayload;
use crate::image::SurfaceImage;
use crate::scene::ChunkSet;
use crate::strategy::Sink;
use crate::{Camera, Fault};

/// Handed to every stage. The core has no clock, no files and no threads of its own.
pub struct Context<'a> {
    /// Takes pictures of the scene.
    pub capture: &'a dyn Capture,
    /// Runs independent jobs.
    pub run: &'a dyn Executor,
    /// Remembers intermediate results across interruptions.
    pub memo: &'a dyn Memo,
    /// Set when the work should stop.
    pub cancel: &'a AtomicBool,
}

impl Context<'_> {
    /// To be called between pieces of work.
    ///
    /// # Errors
    /// [`Fault::Cancelled`] once the caller has asked to stop.
    pub fn check(&self) -> Result<(), Fault> {
        if self.cancel.load(Ordering::Relaxed) { Err(Fault::Cancelled) } else { Ok(()) }
    }
}

/// One surface image to take.
#[derive(Clone, Debug)]
pub struct Shot {
    /// What is in it.
    pub chunks: ChunkSet,
    /// Through which camera.
    pub camera: Camera,
}

/// Takes surface images of original geometry, in batches.
pub trait Capture: Sync {
    /// Which captures these are: backend, device and version. Part of every store key, since backends differ at
    /// silhouettes.
    fn identity(&self) -> &str;

    /// One image a shot, in order.
    ///
    /// # Errors
    /// What the backend behind it gives.
    fn shoot(&self, shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault>;
}

/// Runs independent jobs, on as many threads as the caller likes.
pub trait Executor: Sync {
    /// Calls `job` once for every index below `n`, in any order, on any thread. The caller writes its results by index, so
    /// that nothing depends on timing.
    ///
    /// # Errors
    /// One of the jobs' errors: that of the lowest index that failed among those that ran.
    fn each(&self, n: usize, job: &(dyn Fn(usize) -> Result<(), Fault> + Sync)) -> Result<(), Fault>;
}

/// Every job after the other, on this thread.
pub struct Serial;

impl Executor for Serial {
    fn each(&self, n: usize, job: &(dyn Fn(usize) -> Result<(), Fault> + Sync)) -> Result<(), Fault> {
        (0..n).try_for_each(job)
    }
}

/// `make(i)` for every index below `n`, collected in order.
///
/// # Errors
/// As [`Executor::each`].
pub fn collect<T: Send>(
    run: &dyn Executor,
    n: usize,
    make: &(dyn Fn(usize) -> Result<T, Fault> + Sync),
) -> Result<Vec<T>, Fault> {
    let slots: Vec<std::sync::Mutex<Option<T>>> = (0..n).map(|_| std::sync::Mutex::new(None)).collect();
    run.each(n, &|i| {
        let made = make(i)?;
        *slots[i].lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(made);
        Ok(())
    })?;
    slots
        .into_iter()
        .map(|s| s.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
        .collect::<Option<Vec<T>>>()
        .ok_or_else(|| Fault::Refused("the executor left out a job".into()))
}

/// What a bake that was interrupted knew already. Only the same bake, begun again, is told.
pub trait Memo: Sync {
    /// What was remembered under `key`, whole.
    fn get(&self, key: &[u8]) -> Option<Vec<u8>>;

    /// Remembers `bytes`; it may forget.
    fn put(&self, key: &[u8], bytes: &[u8]);
}

/// Remembers nothing.
pub struct Forget;

impl Memo for Forget {
    fn get(&self, _key: &[u8]) -> Option<Vec<u8>> {
        None
    }

    fn put(&self, _key: &[u8], _bytes: &[u8]) {}
}

/// A piece of a bake that is not made again when the bake is interrupted: `make` makes it and puts its payloads, those that `payloads` names
/// (ascending); what it makes is remembered under `key`, and taken from there once all these payloads are whole. Claims are not remembered.
///
/// # Errors
/// What `make` and the sink give.
pub fn remembered<T: Serialize + DeserializeOwned>(
    key: &[u8],
    payloads: &dyn Fn(&T) -> Vec<LocalPayload>,
    make: &mut dyn FnMut() -> Result<T, Fault>,
    out: &dyn Sink,
    cx: &Context<'_>,
) -> Result<T, Fault> {
    if let Some(known) = cx.memo.get(key).and_then(|bytes| postcard::from_bytes(&bytes).ok())
        && out.kept(&payloads(&known))?
    {
        return Ok(known);
    }
    let made = make()?;
    let bytes = postcard::to_allocvec(&made).map_err(|e| Fault::Refused(format!("what cannot be remembered: {e}")))?;
    cx.memo.put(key, &bytes);
    Ok(made)
}
