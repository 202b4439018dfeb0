//! Pages of device memory that many blocks share, so that one multi-draw reaches them all: which ranges are free.
//!
//! First fit over a sorted list of free ranges, O(free ranges) an allocation. Ranges count elements (vertices, indices,
//! projectors, points), not bytes. Pages grow: the next one is as large as all before it, within limits. Pages are never given back.

use std::ops::Range;

/// What a page holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stream {
    /// [`crate::layout::ChunkVertex`], a vertex buffer.
    ChunkVertices,
    /// [`crate::layout::MeshVertex`], a vertex buffer.
    MeshVertices,
    /// [`crate::layout::ProjectedVertex`], a vertex buffer.
    ProjectedVertices,
    /// 32-bit indices, an index buffer.
    Indices,
    /// [`crate::layout::GpuProjector`], a read-only storage buffer.
    Projectors,
    /// [`crate::layout::GpuSample`] and objects of layered depth images, a read-only storage buffer.
    Samples,
    /// [`crate::layout::GpuPoint`], a read-only storage buffer.
    Points,
    /// [`crate::layout::GpuLine`], a read-only storage buffer.
    Lines,
}

impl Stream {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::ChunkVertices,
        Self::MeshVertices,
        Self::ProjectedVertices,
        Self::Indices,
        Self::Projectors,
        Self::Samples,
        Self::Points,
        Self::Lines,
    ];

    /// Whether shaders read it through a storage binding, whose size devices bound.
    pub fn is_storage(self) -> bool {
        matches!(self, Self::Projectors | Self::Samples | Self::Points | Self::Lines)
    }

    /// Bytes of an element.
    pub fn stride(self) -> u64 {
        match self {
            Self::ChunkVertices => 28,
            Self::MeshVertices => 20,
            Self::ProjectedVertices => 24,
            Self::Indices => 4,
            Self::Projectors => 112,
            Self::Samples => 16,
            Self::Points => 20,
            Self::Lines => 40,
        }
    }
}

/// A page's name: the stream and the number among its pages, counted from 0 as they were made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PageId {
    /// What it holds.
    pub stream: Stream,
    /// Which one.
    pub index: u32,
}

/// The smallest and the largest page, bytes. One request larger than a page gets a page of its own, up to `max_bytes`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PageSizes {
    /// The first page's size.
    pub first_bytes: u64,
    /// No page grows beyond.
    pub usual_bytes: u64,
    /// What the device takes at most in one buffer (and, for what shaders read as storage, in one storage binding).
    pub max_bytes: u64,
}

impl PageSizes {
    /// Sizes for a device that takes buffers of up to `max_bytes`: pages from 4 to 64 MiB.
    pub fn for_device(max_bytes: u64) -> Self {
        Self { first_bytes: (4 << 20).min(max_bytes), usual_bytes: (64 << 20).min(max_bytes), max_bytes }
    }
}

/// Where an allocation lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The page.
    pub page: u32,
    /// Its first element.
    pub first: u32,
    /// Its number of elements.
    pub len: u32,
}

/// Sorted, disjoint, non-adjacent free ranges.
#[derive(Clone, Debug)]
struct FreeList(Vec<Range<u32>>);

impl FreeList {
    fn take(&mut self, len: u32) -> Option<u32> {
        let i = self.0.iter().position(|r| r.end - r.start >= len)?;
        let first = self.0[i].start;
        self.0[i].start += len;
        if self.0[i].is_empty() {
            self.0.remove(i);
        }
        Some(first)
    }

    fn give(&mut self, r: Range<u32>) {
        let i = self.0.partition_point(|f| f.start < r.start);
        let joins_next = self.0.get(i).is_some_and(|f| f.start == r.end);
        match i.checked_sub(1).filter(|&p| self.0[p].end == r.start) {
            Some(p) if joins_next => {
                self.0[p].end = self.0[i].end;
                self.0.remove(i);
            }
            Some(p) => self.0[p].end = r.end,
            None if joins_next => self.0[i].start = r.start,
            None => self.0.insert(i, r),
        }
    }
}

/// The pages of one stream.
#[derive(Clone, Debug)]
pub struct Pool {
    stream: Stream,
    sizes: PageSizes,
    pages: Vec<FreeList>,
    total_bytes: u64,
}

impl Pool {
    /// A pool without pages.
    pub fn new(stream: Stream, sizes: PageSizes) -> Self {
        Self { stream, sizes, pages: vec![], total_bytes: 0 }
    }

    /// A range of `len` elements, and the bytes of a page that has to be made for it, if any. `None` where no buffer of the
    /// device can hold it.
    pub fn take(&mut self, len: u32) -> Option<(Span, Option<u64>)> {
        if len == 0 {
            return Some((Span { page: 0, first: 0, len }, None));
        }
        for (page, free) in self.pages.iter_mut().enumerate() {
            if let Some(first) = free.take(len) {
                return Some((Span { page: page as u32, first, len }, None));
            }
        }
        let stride = self.stream.stride();
        let wanted = u64::from(len) * stride;
        if wanted > self.sizes.max_bytes {
            return None;
        }
        let grown = self.total_bytes.max(self.sizes.first_bytes).min(self.sizes.usual_bytes);
        let capacity = u32::try_from(grown.max(wanted) / stride).ok()?;
        let bytes = u64::from(capacity) * stride;
        let mut free = FreeList(std::iter::once(0..capacity).collect());
        let first = free.take(len)?;
        self.pages.push(free);
        self.total_bytes += bytes;
        Some((Span { page: self.pages.len() as u32 - 1, first, len }, Some(bytes)))
    }

    /// The largest page, bytes.
    pub fn max_bytes(&self) -> u64 {
        self.sizes.max_bytes
    }

    /// Gives a range back.
    pub fn give(&mut self, span: Span) {
        if span.len > 0 {
            self.pages[span.page as usize].give(span.first..span.first + span.len);
        }
    }

    /// Forgets the page made last: for when the device refused it. Nothing may lie in it.
    pub fn forget_last_page(&mut self, bytes: u64) {
        self.pages.pop();
        self.total_bytes -= bytes;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn strides_are_those_of_the_structs() {
        use crate::layout::{ChunkVertex, GpuLine, GpuPoint, GpuProjector, GpuSample, MeshVertex, ProjectedVertex};
        use std::mem::size_of;
        let of = [
            size_of::<ChunkVertex>(),
            size_of::<MeshVertex>(),
            size_of::<ProjectedVertex>(),
            size_of::<u32>(),
            size_of::<GpuProjector>(),
            size_of::<GpuSample>(),
            size_of::<GpuPoint>(),
            size_of::<GpuLine>(),
        ];
        for (stream, size) in Stream::ALL.into_iter().zip(of) {
            assert_eq!(stream.stride(), size as u64, "{stream:?}");
        }
    }

    proptest! {
        #[test]
        fn spans_never_overlap_and_everything_comes_back(
            steps in prop::collection::vec((0u32..400, any::<bool>(), any::<prop::sample::Index>()), 1..120)
        ) {
            let sizes = PageSizes { first_bytes: 1200, usual_bytes: 2400, max_bytes: 4000 };
            let mut pool = Pool::new(Stream::Indices, sizes);
            let mut held: Vec<Span> = vec![];
            for (len, give, which) in steps {
                if give && !held.is_empty() {
                    pool.give(held.swap_remove(which.index(held.len())));
                } else {
                    let (span, _) = pool.take(len).unwrap();
                    for h in held.iter().filter(|h| h.page == span.page && h.len > 0 && span.len > 0) {
                        prop_assert!(span.first + span.len <= h.first || h.first + h.len <= span.first);
                    }
                    held.push(span);
                }
            }
            held.into_iter().for_each(|s| pool.give(s));
            prop_assert!(pool.pages.iter().all(|f| f.0.len() == 1 && f.0[0].start == 0));
        }
    }

    #[test]
    fn what_no_buffer_holds_is_refused() {
        let sizes = PageSizes { first_bytes: 100, usual_bytes: 200, max_bytes: 400 };
        let mut pool = Pool::new(Stream::Indices, sizes);
        assert_eq!(pool.take(101), None);
        assert_eq!(pool.take(100), Some((Span { page: 0, first: 0, len: 100 }, Some(400))));
    }
}
