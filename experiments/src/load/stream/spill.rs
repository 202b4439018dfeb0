//! Many sequences in one temporary file: each is appended to on its own and read back in order.

use std::fs::File;
use std::io;
use std::path::Path;

use bytemuck::Pod;

use super::array::write_at;
use crate::chunks::ReadAt;

/// Sequences by number.
pub(super) struct Spill<T> {
    file: File,
    end: u64,
    sequences: Vec<Sequence<T>>,
    /// Elements that a sequence gathers before they are written.
    buffered: usize,
}

struct Sequence<T> {
    tail: Vec<T>,
    /// First byte and number of elements.
    extents: Vec<(u64, u32)>,
    len: u64,
}

impl<T: Pod> Spill<T> {
    /// `count` empty sequences that together hold at most `memory_bytes` before they write.
    pub(super) fn new(folder: &Path, count: usize, memory_bytes: u64) -> io::Result<Self> {
        let each = (memory_bytes as usize / count.max(1)).clamp(4 << 10, 256 << 10);
        let sequences = (0..count).map(|_| Sequence { tail: vec![], extents: vec![], len: 0 }).collect();
        Ok(Self { file: tempfile::tempfile_in(folder)?, end: 0, sequences, buffered: (each / size_of::<T>()).max(1) })
    }

    pub(super) fn push(&mut self, sequence: usize, value: T) -> io::Result<()> {
        let s = &mut self.sequences[sequence];
        s.tail.push(value);
        s.len += 1;
        if s.tail.len() >= self.buffered { self.flush(sequence) } else { Ok(()) }
    }

    fn flush(&mut self, sequence: usize) -> io::Result<()> {
        let s = &mut self.sequences[sequence];
        if s.tail.is_empty() {
            return Ok(());
        }
        write_at(&self.file, bytemuck::cast_slice(&s.tail), self.end)?;
        s.extents.push((self.end, s.tail.len() as u32));
        self.end += size_of_val(s.tail.as_slice()) as u64;
        s.tail.clear();
        Ok(())
    }

    /// Writes all that was appended, before anything is read, and frees the buffers.
    pub(super) fn finish(&mut self) -> io::Result<()> {
        (0..self.sequences.len()).try_for_each(|i| self.flush(i))?;
        self.sequences.iter_mut().for_each(|s| s.tail = vec![]);
        Ok(())
    }

    /// Elements of a sequence.
    pub(super) fn len(&self, sequence: usize) -> u64 {
        self.sequences[sequence].len
    }

    /// A whole sequence, appended to `out`.
    pub(super) fn read(&self, sequence: usize, out: &mut Vec<T>) -> io::Result<()> {
        self.batches(sequence, u32::MAX as usize, &mut |all| {
            out.extend(all);
            Ok(())
        })
    }

    /// A sequence in pieces of at most `most` elements and one extent.
    pub(super) fn batches(
        &self,
        sequence: usize,
        most: usize,
        f: &mut dyn FnMut(Vec<T>) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut held: Vec<T> = vec![];
        for &(at, n) in &self.sequences[sequence].extents {
            let start = held.len();
            held.resize(start + n as usize, T::zeroed());
            self.file.read_at(bytemuck::cast_slice_mut(&mut held[start..]), at)?;
            while held.len() >= most {
                let rest = held.split_off(most);
                f(std::mem::replace(&mut held, rest))?;
            }
        }
        if held.is_empty() { Ok(()) } else { f(held) }
    }
}
