//! Chunks that lie in shards, as they are stored: where they are found, and their bytes, part by part.
//!
//! Of a folder nothing is read before somebody goes through them: then one thread reads part after part into one buffer, which takes
//! less than a request each. Of other stores they are in memory.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::ErrorKind;
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::path::PathBuf;

use bytes::Bytes;

pub(crate) const TOO_SHORT: &str = "its shard is shorter than its index says";

/// Bytes that a thread keeps to read the next part into: fresh memory has to be mapped and cleared for every one.
const MOST_KEPT: usize = 8 << 20;

thread_local! {
    static OF_THREAD: Cell<Vec<u8>> = const { Cell::new(vec![]) };
}

/// A chunk that cannot be read or decoded: its place among those asked for, and why.
#[derive(Debug)]
pub struct Undecoded(pub(crate) usize, pub(crate) String);

/// A part of a shard, with chunks that lie near one another.
#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) source: Source,
    pub(crate) chunks: Vec<InPart>,
}

/// Where the bytes of a part are.
#[derive(Debug)]
pub(crate) enum Source {
    Held(Bytes),
    File(PathBuf, Range<u64>),
}

impl Source {
    /// Bytes of the part.
    pub(crate) fn length(&self) -> usize {
        match self {
            Self::Held(content) => content.len(),
            Self::File(_path, range) => (range.end - range.start) as usize,
        }
    }

    /// Some of its bytes.
    fn part(&self, bytes: &Range<usize>) -> Self {
        match self {
            Self::Held(content) => Self::Held(content.slice(bytes.clone())),
            Self::File(path, range) => {
                let at = |byte: usize| range.start + byte as u64;
                Self::File(path.clone(), at(bytes.start)..at(bytes.end))
            }
        }
    }
}

/// A chunk in a part.
#[derive(Debug, Clone)]
pub(crate) struct InPart {
    /// Its place among those asked for.
    pub(crate) number: usize,
    /// Its bytes in the part.
    pub(crate) bytes: Range<usize>,
}

/// Chunks that were asked for; those that are not stored, since no cell has data, are in no part.
#[derive(Debug, Default)]
pub(crate) struct StoredChunks(pub(crate) Vec<Part>);

/// The file that was read last, and its length.
#[derive(Default)]
struct Opened(Option<(PathBuf, File, u64)>);

impl Opened {
    /// Reads a part of a file into a buffer from `at` on, which is made longer where it has to be.
    fn read(
        &mut self,
        path: &PathBuf,
        range: &Range<u64>,
        (to, at): (&mut Vec<u8>, usize),
    ) -> std::io::Result<()> {
        let (file, file_bytes) = match &mut self.0 {
            Some((own, file, bytes)) if own == path => (file, bytes),
            other => {
                let opened = File::open(path)?;
                let bytes = opened.metadata()?.len();
                let (_, file, bytes) = other.insert((path.clone(), opened, bytes));
                (file, bytes)
            }
        };
        // Before anything is allocated for what an index made up.
        if range.end > *file_bytes {
            return Err(ErrorKind::UnexpectedEof.into());
        }
        let end = at + (range.end - range.start) as usize;
        if to.len() < end {
            to.resize(end, 0);
        }
        file.read_exact_at(&mut to[at..end], range.start)
    }
}

fn unread(chunks: &[InPart], error: &std::io::Error) -> Undecoded {
    let number = chunks.first().map_or(0, |chunk| chunk.number);
    let reason = match error.kind() {
        ErrorKind::UnexpectedEof => TOO_SHORT.to_owned(),
        _ => error.to_string(),
    };
    Undecoded(number, reason)
}

impl StoredChunks {
    /// Bytes of all chunks.
    pub(crate) fn stored_bytes(&self) -> usize {
        let chunks = self.0.iter().flat_map(|part| &part.chunks);
        chunks.map(|chunk| chunk.bytes.len()).sum()
    }

    /// The same in `count` parts: those of the first `each` numbers, and so on; numbers begin anew in each.
    pub(crate) fn split(self, each: usize, count: usize) -> Vec<Self> {
        let mut split: Vec<Self> = (0..count).map(|_| Self::default()).collect();
        for Part { source, chunks } in self.0 {
            let mut by_part: BTreeMap<usize, Vec<InPart>> = BTreeMap::new();
            for InPart { number, bytes } in chunks {
                let own = by_part.entry(number / each).or_default();
                let number = number % each;
                own.push(InPart { number, bytes });
            }
            for (part, mut chunks) in by_part {
                let starts = chunks.iter().map(|chunk| chunk.bytes.start);
                let ends = chunks.iter().map(|chunk| chunk.bytes.end);
                let range = starts.min().unwrap_or(0)..ends.max().unwrap_or(0);
                for InPart { bytes, .. } in &mut chunks {
                    *bytes = bytes.start - range.start..bytes.end - range.start;
                }
                let source = source.part(&range);
                split[part].0.push(Part { source, chunks });
            }
        }
        split
    }

    /// Hands over each chunk with its number, as they lie in their shards. `take` says whether to go on.
    ///
    /// # Errors
    /// A part that cannot be read; what `take` says of a chunk.
    pub(crate) fn each(
        &self,
        mut take: impl FnMut(usize, &[u8]) -> Result<bool, Undecoded>,
    ) -> Result<(), Undecoded> {
        let mut buffer = OF_THREAD.take();
        let gone_through = self.each_in(&mut buffer, &mut take);
        if buffer.len() <= MOST_KEPT {
            OF_THREAD.set(buffer);
        }
        gone_through
    }

    fn each_in(
        &self,
        buffer: &mut Vec<u8>,
        take: &mut impl FnMut(usize, &[u8]) -> Result<bool, Undecoded>,
    ) -> Result<(), Undecoded> {
        let mut opened = Opened::default();
        for Part { source, chunks } in &self.0 {
            let content: &[u8] = match source {
                Source::Held(content) => content,
                Source::File(path, range) => {
                    let read = opened.read(path, range, (buffer, 0));
                    read.map_err(|error| unread(chunks, &error))?;
                    &buffer[..source.length()]
                }
            };
            for InPart { number, bytes } in chunks {
                if !take(*number, &content[bytes.clone()])? {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// The same in the order of their numbers; all are held at once.
    ///
    /// # Errors
    /// As [`Self::each`].
    pub(crate) fn in_order(
        &self,
        mut take: impl FnMut(usize, &[u8]) -> Result<bool, Undecoded>,
    ) -> Result<(), Undecoded> {
        let (mut opened, mut buffer, mut places) = (Opened::default(), vec![], vec![]);
        for Part { source, chunks } in &self.0 {
            let start = buffer.len();
            match source {
                Source::Held(content) => buffer.extend_from_slice(content),
                Source::File(path, range) => {
                    let read = opened.read(path, range, (&mut buffer, start));
                    read.map_err(|error| unread(chunks, &error))?;
                }
            }
            let moved = |chunk: &InPart| {
                (
                    chunk.number,
                    start + chunk.bytes.start..start + chunk.bytes.end,
                )
            };
            places.extend(chunks.iter().map(moved));
        }
        places.sort_unstable_by_key(|(number, _bytes)| *number);
        for (number, bytes) in places {
            if !take(number, &buffer[bytes])? {
                return Ok(());
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(source: Source, chunks: &[(usize, Range<usize>)]) -> Part {
        let chunk = |(number, bytes): &(usize, Range<usize>)| InPart {
            number: *number,
            bytes: bytes.clone(),
        };
        Part {
            source,
            chunks: chunks.iter().map(chunk).collect(),
        }
    }

    fn gone_through(
        chunks: &StoredChunks,
        is_in_order: bool,
    ) -> Result<Vec<(usize, Vec<u8>)>, Undecoded> {
        let mut found = vec![];
        let take = |number: usize, bytes: &[u8]| {
            found.push((number, bytes.to_vec()));
            Ok(true)
        };
        if is_in_order {
            chunks.in_order(take)?;
        } else {
            chunks.each(take)?;
        }
        Ok(found)
    }

    #[test]
    fn chunks_of_files_are_those_of_memory() {
        let folder = tempfile::tempdir().unwrap();
        let (one, other) = (folder.path().join("one"), folder.path().join("other"));
        std::fs::write(&one, b"abcdefgh").unwrap();
        std::fs::write(&other, b"ijklmnop").unwrap();
        let parts = |source: &dyn Fn(&PathBuf, Range<u64>) -> Source| {
            StoredChunks(vec![
                part(source(&one, 2..6), &[(4, 0..2), (1, 3..4)]),
                part(source(&other, 0..3), &[(0, 1..3)]),
                part(source(&one, 0..1), &[(7, 0..1)]),
            ])
        };
        let held = parts(&|path, range| {
            let content = Bytes::from(std::fs::read(path).unwrap());
            Source::Held(content.slice(range.start as usize..range.end as usize))
        });
        let files = parts(&|path, range| Source::File(path.clone(), range));
        let text = |found: Vec<(usize, Vec<u8>)>| {
            let each = found
                .into_iter()
                .map(|(number, bytes)| format!("{number}{}", String::from_utf8(bytes).unwrap()));
            each.collect::<Vec<String>>().join(" ")
        };
        for chunks in [&held, &files] {
            assert_eq!(text(gone_through(chunks, false).unwrap()), "4cd 1f 0jk 7a");
            assert_eq!(text(gone_through(chunks, true).unwrap()), "0jk 1f 4cd 7a");
            assert_eq!(chunks.stored_bytes(), 6);
        }
        for chunks in [
            held,
            parts(&|path, range| Source::File(path.clone(), range)),
        ] {
            let split = chunks.split(3, 3);
            let text: Vec<String> = split
                .iter()
                .map(|own| text(gone_through(own, true).unwrap()))
                .collect();
            assert_eq!(text, ["0jk 1f", "1cd", "1a"]);
        }
        let mut count = 0;
        let stopped = files.each(|_number, _bytes| {
            count += 1;
            Ok(count < 2)
        });
        assert!(stopped.is_ok() && count == 2);
    }

    #[test]
    fn a_file_that_is_gone_or_cut_off_is_an_error_of_its_chunk() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shard");
        std::fs::write(&path, b"abcd").unwrap();
        let chunks = StoredChunks(vec![
            part(Source::File(path.clone(), 0..2), &[(3, 0..2)]),
            part(Source::File(path.clone(), 2..5), &[(9, 0..3)]),
        ]);
        for is_in_order in [true, false] {
            let Undecoded(number, reason) = gone_through(&chunks, is_in_order).unwrap_err();
            assert_eq!((number, reason.as_str()), (9, TOO_SHORT));
        }
        std::fs::remove_file(path).unwrap();
        let Undecoded(number, reason) = gone_through(&chunks, false).unwrap_err();
        assert!(number == 3 && reason.contains("No such file"), "{reason}");
    }
}
