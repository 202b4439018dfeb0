//! Timestamps around a frame and counts of primitives that reach the clipper.

use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;

use crate::gpu::Gpu;
use crate::record::Recorder;

/// Query pools; a pool is null where the device lacks the feature.
pub(crate) struct Queries {
    gpu: Arc<Gpu>,
    times: vk::QueryPool,
    counts: vk::QueryPool,
    /// How many queries `counts` has.
    capacity: u32,
}

impl Queries {
    /// Two timestamps, and no counts yet.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, Fault> {
        let null = vk::QueryPool::null();
        let mut made = Self { gpu: gpu.clone(), times: null, counts: null, capacity: 0 };
        if gpu.caps.timestamp_bits > 0 {
            let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2);
            // SAFETY: the queue has timestamps.
            made.times = unsafe { gpu.raw.create_query_pool(&info, None) }.map_err(|e| gpu.fault("timestamps", e))?;
        }
        Ok(made)
    }

    /// Makes room for `passes` counts.
    pub(crate) fn reserve(&mut self, passes: u32) -> Result<(), Fault> {
        if !self.gpu.caps.statistics || passes <= self.capacity {
            return Ok(());
        }
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::PIPELINE_STATISTICS)
            .pipeline_statistics(vk::QueryPipelineStatisticFlags::CLIPPING_INVOCATIONS)
            .query_count(passes);
        // SAFETY: the device has pipeline statistics; the pool that goes is not in use, every frame was waited for.
        let pool = unsafe {
            self.gpu.raw.destroy_query_pool(self.counts, None);
            self.counts = vk::QueryPool::null();
            self.capacity = 0;
            self.gpu.raw.create_query_pool(&info, None)
        };
        self.counts = pool.map_err(|e| self.gpu.fault("statistics", e))?;
        self.capacity = passes;
        Ok(())
    }

    /// Records the frame's start.
    pub(crate) fn start(&self, record: &Recorder<'_>, passes: u32) {
        // SAFETY: recording, outside a render pass; the pools have these queries, and a null pool is not touched.
        unsafe {
            if self.times != vk::QueryPool::null() {
                self.gpu.raw.cmd_reset_query_pool(record.raw, self.times, 0, 2);
                (self.gpu.write_timestamp)(record.raw, vk::PipelineStageFlags2::ALL_COMMANDS, self.times, 0);
            }
            if self.counts != vk::QueryPool::null() && passes > 0 {
                self.gpu.raw.cmd_reset_query_pool(record.raw, self.counts, 0, passes);
            }
        }
    }

    /// Records the frame's end.
    pub(crate) fn end(&self, record: &Recorder<'_>) {
        if self.times != vk::QueryPool::null() {
            // SAFETY: recording; the pool has two queries, and this one was reset at the start.
            unsafe { (self.gpu.write_timestamp)(record.raw, vk::PipelineStageFlags2::ALL_COMMANDS, self.times, 1) };
        }
    }

    /// Counts what `draw` records (a whole render pass) in query `pass`.
    pub(crate) fn count<T>(&self, record: &Recorder<'_>, pass: u32, draw: impl FnOnce() -> T) -> T {
        let counted = self.counts != vk::QueryPool::null() && pass < self.capacity;
        if counted {
            // SAFETY: recording, outside a render pass; the query was reset and is ended outside one too.
            unsafe { self.gpu.raw.cmd_begin_query(record.raw, self.counts, pass, vk::QueryControlFlags::empty()) };
        }
        let out = draw();
        if counted {
            // SAFETY: begun above.
            unsafe { self.gpu.raw.cmd_end_query(record.raw, self.counts, pass) };
        }
        out
    }

    /// After the frame's end: its time in milliseconds, and the primitives that reached the clipper in `passes` counts.
    ///
    /// # Errors
    /// [`Fault::Device`].
    pub(crate) fn results(&self, passes: u32) -> Result<(Option<f64>, Option<u64>), Fault> {
        let gpu = &*self.gpu;
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        let mut ms = None;
        if self.times != vk::QueryPool::null() {
            let mut ticks = [0u64; 2];
            // SAFETY: both were written in the submission that just ended.
            unsafe { gpu.raw.get_query_pool_results(self.times, 0, &mut ticks, flags) }
                .map_err(|e| gpu.fault("timestamps", e))?;
            let mask = u64::MAX >> (64 - gpu.caps.timestamp_bits.min(64));
            let ticks = ticks[1].wrapping_sub(ticks[0]) & mask;
            // timestampPeriod is nanoseconds a tick.
            ms = Some(ticks as f64 * f64::from(gpu.caps.limits.timestamp_period) * 1e-6);
        }
        let mut clipped = None;
        if gpu.caps.statistics {
            let mut counts = vec![0u64; passes as usize];
            if passes > 0 {
                // SAFETY: these queries were ended in the submission that just ended.
                unsafe { gpu.raw.get_query_pool_results(self.counts, 0, &mut counts, flags) }
                    .map_err(|e| gpu.fault("statistics", e))?;
            }
            clipped = Some(counts.iter().sum());
        }
        Ok((ms, clipped))
    }
}

impl Drop for Queries {
    fn drop(&mut self) {
        // SAFETY: no frame is under way; each is destroyed once (null is allowed).
        unsafe {
            self.gpu.raw.destroy_query_pool(self.times, None);
            self.gpu.raw.destroy_query_pool(self.counts, None);
        }
    }
}
