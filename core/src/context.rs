//! What a stage gets from outside: captures, an executor, a memory of intermediate results, a way to be stopped.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::image::SurfaceImage;
use crate::scene::ChunkSet;
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

/// A memory of intermediate results, by content.
pub trait Memo: Sync {
    /// What was remembered under `key`, or what `make` makes, remembered from now on.
    ///
    /// # Errors
    /// What `make` gives, or what the storage behind it gives.
    fn get_or(&self, key: &[u8; 32], make: &mut dyn FnMut() -> Result<Vec<u8>, Fault>) -> Result<Vec<u8>, Fault>;
}

/// Remembers nothing.
pub struct Forget;

impl Memo for Forget {
    fn get_or(&self, _key: &[u8; 32], make: &mut dyn FnMut() -> Result<Vec<u8>, Fault>) -> Result<Vec<u8>, Fault> {
        make()
    }
}
