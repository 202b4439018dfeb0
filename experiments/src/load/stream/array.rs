//! Arrays in temporary files, for what does not fit in memory.
//!
//! They are appended to, and read and changed at many places at once: places are visited in ascending order and neighbours in
//! one go, so that a visit costs no more than one pass over the file, however scattered the places are (the idea of external
//! sorting, as in P. Lindstrom and C. Silva, "A memory insensitive technique for large model simplification", 2001). The files
//! have no name: the system removes them when the process ends, whatever ends it.

use std::fs::File;
use std::io;
use std::marker::PhantomData;
use std::ops::Range;
use std::path::Path;

use bytemuck::Pod;

use crate::chunks::ReadAt;

/// Elements that lie nearer together than this are read in one go, bytes.
const GAP_BYTES: usize = 8 << 10;
/// The most that is read or appended in one go, bytes.
const RUN_BYTES: usize = 1 << 20;

/// An array in a file.
pub(super) struct Array<T> {
    file: File,
    len: u64,
    /// What is appended and not yet written.
    tail: Vec<T>,
    of: PhantomData<T>,
}

/// Places in an array: ascending, none twice.
pub(super) enum Places {
    /// All of a range.
    Range(Range<u32>),
    /// These.
    List(Vec<u32>),
}

impl Places {
    /// Those that `wanted` names: the range that holds them, where that is not much more than they are.
    pub(super) fn of(mut wanted: Vec<u32>) -> Self {
        let (low, high) = wanted.iter().fold((u32::MAX, 0), |(l, h), &v| (l.min(v), h.max(v)));
        if wanted.is_empty() {
            return Self::List(vec![]);
        }
        if (high - low) as usize <= wanted.len() {
            return Self::Range(low..high + 1);
        }
        wanted.sort_unstable();
        wanted.dedup();
        Self::List(wanted)
    }

    /// Where among them a place is.
    ///
    /// # Panics
    /// Where it is none of them.
    pub(super) fn slot(&self, place: u32) -> usize {
        match self {
            Self::Range(r) => (place - r.start) as usize,
            Self::List(l) => l.binary_search(&place).expect("one of the places"),
        }
    }

    /// The first, and one after the last; 0 and 0 of none.
    pub(super) fn ends(&self) -> Range<u32> {
        match self {
            Self::Range(r) => r.clone(),
            Self::List(l) => l.first().copied().unwrap_or(0)..l.last().map_or(0, |&v| v + 1),
        }
    }

    /// How many there are.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Range(r) => r.len(),
            Self::List(l) => l.len(),
        }
    }
}

impl<T: Pod> Array<T> {
    /// An empty one; its file is in `folder`.
    pub(super) fn new(folder: &Path) -> io::Result<Self> {
        Ok(Self { file: tempfile::tempfile_in(folder)?, len: 0, tail: vec![], of: PhantomData })
    }

    /// One of `len` times `value`.
    pub(super) fn filled(folder: &Path, len: u64, value: T) -> io::Result<Self> {
        let mut out = Self::new(folder)?;
        let run = vec![value; RUN_BYTES / size_of::<T>()];
        while out.len < len {
            let n = (len - out.len).min(run.len() as u64);
            out.write(&run[..n as usize], out.len)?;
            out.len += n;
        }
        Ok(out)
    }

    pub(super) fn len(&self) -> u64 {
        self.len + self.tail.len() as u64
    }

    pub(super) fn push(&mut self, value: T) -> io::Result<()> {
        self.tail.push(value);
        if self.tail.len() * size_of::<T>() >= RUN_BYTES { self.flush() } else { Ok(()) }
    }

    /// Writes what was appended: before anything is read.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        let tail = std::mem::take(&mut self.tail);
        self.write(&tail, self.len)?;
        self.len += tail.len() as u64;
        self.tail = tail;
        self.tail.clear();
        Ok(())
    }

    fn write(&self, values: &[T], at: u64) -> io::Result<()> {
        write_at(&self.file, bytemuck::cast_slice(values), at * size_of::<T>() as u64)
    }

    /// The elements of a range.
    ///
    /// # Errors
    /// What reading gives; a range outside the array is an end of file.
    pub(super) fn read(&self, range: Range<u64>) -> io::Result<Vec<T>> {
        let mut out = vec![T::zeroed(); (range.end - range.start) as usize];
        self.file.read_at(bytemuck::cast_slice_mut(&mut out), range.start * size_of::<T>() as u64)?;
        Ok(out)
    }

    /// The elements at these places.
    pub(super) fn gather(&self, places: &Places) -> io::Result<Vec<T>> {
        let list = match places {
            Places::Range(r) => return self.read(u64::from(r.start)..u64::from(r.end)),
            Places::List(l) => l,
        };
        let mut out = Vec::with_capacity(list.len());
        for run in runs::<T>(list) {
            let first = run[0];
            let all = self.read(u64::from(first)..u64::from(run[run.len() - 1]) + 1)?;
            out.extend(run.iter().map(|&i| all[(i - first) as usize]));
        }
        Ok(out)
    }

    /// Puts `values` at these places.
    pub(super) fn scatter(&mut self, places: &Places, values: &[T]) -> io::Result<()> {
        let list = match places {
            Places::Range(r) => return self.write(values, r.start.into()),
            Places::List(l) => l,
        };
        let mut values = values;
        for run in runs::<T>(list) {
            let first = run[0];
            let mut all = self.read(u64::from(first)..u64::from(run[run.len() - 1]) + 1)?;
            let (mine, rest) = values.split_at(run.len());
            run.iter().zip(mine).for_each(|(&i, &v)| all[(i - first) as usize] = v);
            self.write(&all, first.into())?;
            values = rest;
        }
        Ok(())
    }
}

/// Groups of places that are visited in one go.
fn runs<T>(list: &[u32]) -> impl Iterator<Item = &[u32]> {
    let (gap, most) = (GAP_BYTES / size_of::<T>(), RUN_BYTES / size_of::<T>());
    let mut rest = list;
    std::iter::from_fn(move || {
        let first = *rest.first()?;
        let near = |k: &usize| (rest[k + 1] - rest[*k]) as usize <= gap && ((rest[k + 1] - first) as usize) < most;
        let n = 1 + (0..rest.len() - 1).take_while(near).count();
        let (run, after) = rest.split_at(n);
        rest = after;
        Some(run)
    })
}

pub(super) fn write_at(file: &File, bytes: &[u8], at: u64) -> io::Result<()> {
    #[cfg(unix)]
    {
        std::os::unix::fs::FileExt::write_all_at(file, bytes, at)
    }
    #[cfg(windows)]
    {
        let mut done = 0;
        while done < bytes.len() {
            done += std::os::windows::fs::FileExt::seek_write(file, &bytes[done..], at + done as u64)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn an_array_in_a_file_is_an_array(
            len in 1_u32..40_000,
            wanted in prop::collection::vec(any::<prop::sample::Index>(), 0..60),
            dense in any::<bool>(),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let mut file = Array::<[u32; 3]>::new(folder.path()).unwrap();
            let mut held: Vec<[u32; 3]> = (0..len).map(|i| [i, i * 7, i ^ 5]).collect();
            held.iter().for_each(|&v| file.push(v).unwrap());
            file.flush().unwrap();
            prop_assert_eq!(file.len(), u64::from(len));
            let wanted: Vec<u32> = if dense { (len / 2..len).collect() } else { wanted.iter().map(|i| i.index(len as usize) as u32).collect() };
            let places = Places::of(wanted.clone());
            let got = file.gather(&places).unwrap();
            prop_assert_eq!(got.len(), places.len());
            for &w in &wanted {
                prop_assert_eq!(got[places.slot(w)], held[w as usize]);
            }
            let new: Vec<[u32; 3]> = got.iter().map(|v| v.map(|x| x.wrapping_mul(3))).collect();
            file.scatter(&places, &new).unwrap();
            match &places {
                Places::Range(r) => r.clone().for_each(|i| held[i as usize] = held[i as usize].map(|x| x.wrapping_mul(3))),
                Places::List(l) => l.iter().for_each(|&i| held[i as usize] = held[i as usize].map(|x| x.wrapping_mul(3))),
            }
            prop_assert_eq!(file.read(0..len.into()).unwrap(), held);
        }
    }
}
