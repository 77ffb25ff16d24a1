//! NetCDF classic files: header and declared sizes are checked against the file's length before anything is read.

use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use contract::event::RejectReason;

use super::corrupt;
use super::description::{Description, Dimension, Part, Variable};
use super::netcdf3_header::{self, ExternalType, Header, HeaderVariable, Version};
use crate::error::Rejection;

/// Largest header that is read.
const MAX_HEADER_BYTES: u64 = 16 << 20;
/// Values read at a time.
const BLOCK_VALUES: usize = 1 << 16;

/// An open NetCDF classic file.
pub(crate) struct NetCdf3File {
    file: BufReader<File>,
    description: Description,
    layouts: Vec<Layout>,
}

/// Where the values of a variable lie.
#[derive(Debug, Clone, Copy)]
struct Layout {
    external: ExternalType,
    begin_bytes: u64,
    /// Distance from one record to the next; none for a variable that is not cut into records.
    record_bytes: Option<u64>,
}

impl NetCdf3File {
    pub(super) fn open(path: &Path, version: Version) -> Result<Self, Rejection> {
        let mut file = File::open(path).map_err(|e| unreadable(&e))?;
        let file_bytes = file.metadata().map_err(|e| unreadable(&e))?.len();
        let mut head = Vec::new();
        (&mut file)
            .take(MAX_HEADER_BYTES)
            .read_to_end(&mut head)
            .map_err(|e| unreadable(&e))?;
        let header = netcdf3_header::parse(&head, version)?;
        let (description, layouts) = lay_out(&header, file_bytes)?;
        Ok(Self {
            file: BufReader::new(file),
            description,
            layouts,
        })
    }

    pub(super) fn description(&self) -> &Description {
        &self.description
    }

    pub(super) fn read(&mut self, name: &str, part: &[Part]) -> Result<Vec<f64>, Rejection> {
        let missing = || corrupt(name, "no such variable");
        let index = self
            .description
            .variables
            .iter()
            .position(|v| v.name == name)
            .ok_or_else(missing)?;
        let (variable, layout) = (&self.description.variables[index], self.layouts[index]);
        let lens: Vec<u64> = variable.dimensions.iter().map(|d| d.len).collect();
        if part.len() != lens.len() {
            return Err(corrupt(
                name,
                format!("{} parts for {} dimensions", part.len(), lens.len()),
            ));
        }
        let mut values = Vec::new();
        self.read_part(name, layout, &lens, part, &mut values)?;
        Ok(values)
    }

    /// Reads runs that lie together; `lens` and `part` run over the dimensions, slowest first.
    fn read_part(
        &mut self,
        name: &str,
        layout: Layout,
        lens: &[u64],
        part: &[Part],
        values: &mut Vec<f64>,
    ) -> Result<(), Rejection> {
        if lens.contains(&0) {
            return Ok(());
        }
        let size_bytes = layout.external.size_bytes();
        let past = || corrupt(name, "an index past its dimension");
        let spans = part.iter().zip(lens).map(|(part, len)| part.span(*len));
        let spans: Vec<(u64, u64)> = spans.collect::<Option<_>>().ok_or_else(past)?;
        // Trailing dimensions taken whole make one run, with a part of the one before them; records lie apart.
        let is_whole = |((_, count), len): &(&(u64, u64), &u64)| count == *len;
        let pairs = spans.iter().zip(lens);
        let whole = pairs.rev().take_while(is_whole).count();
        let records = usize::from(layout.record_bytes.is_some());
        let outer = (lens.len() - whole).saturating_sub(1).max(records);
        let run: u64 = spans[outer..].iter().map(|(_, count)| count).product();
        let mut index: Vec<u64> = spans.iter().take(outer + 1).map(|span| span.0).collect();
        loop {
            self.read_run(
                name,
                layout,
                offset_bytes(layout, lens, &index, size_bytes),
                run,
                values,
            )?;
            // The next index over the outer dimensions, slowest last.
            let has_next = |i: &usize| index[*i] + 1 < spans[*i].0 + spans[*i].1;
            let Some(next) = (0..outer).rev().find(has_next) else {
                return Ok(());
            };
            index[next] += 1;
            for i in next + 1..outer {
                index[i] = spans[i].0;
            }
        }
    }

    fn read_run(
        &mut self,
        name: &str,
        layout: Layout,
        at_bytes: u64,
        count: u64,
        values: &mut Vec<f64>,
    ) -> Result<(), Rejection> {
        let size = layout.external.size_bytes() as usize;
        self.file
            .seek(SeekFrom::Start(at_bytes))
            .map_err(|e| unreadable(&e))?;
        let mut left = usize::try_from(count)
            .map_err(|_too_many| corrupt(name, "more values than memory has addresses"))?;
        let mut buffer = vec![0; left.min(BLOCK_VALUES) * size];
        while left > 0 {
            let taken = left.min(BLOCK_VALUES);
            let bytes = &mut buffer[..taken * size];
            self.file.read_exact(bytes).map_err(|_short| {
                corrupt(
                    name,
                    "the file ends within it; it is truncated, fetch it again",
                )
            })?;
            values.extend(bytes.chunks_exact(size).map(|b| layout.external.number(b)));
            left -= taken;
        }
        Ok(())
    }
}

fn unreadable(error: &std::io::Error) -> Rejection {
    Rejection::new(
        RejectReason::Unreadable,
        "file",
        format!("cannot be read: {error}"),
    )
}

/// First byte of the run that starts at `index` over the outer dimensions. Sizes were checked when the file was opened.
fn offset_bytes(layout: Layout, lens: &[u64], index: &[u64], size_bytes: u64) -> u64 {
    let stride = |i: usize| lens[i + 1..].iter().product::<u64>() * size_bytes;
    let inner: u64 = match layout.record_bytes {
        Some(record_bytes) => {
            index[0] * record_bytes + (1..index.len()).map(|i| index[i] * stride(i)).sum::<u64>()
        }
        None => (0..index.len()).map(|i| index[i] * stride(i)).sum(),
    };
    layout.begin_bytes + inner
}

/// Turns a header into a description and the place of every variable, all of it inside the file.
fn lay_out(header: &Header, file_bytes: u64) -> Result<(Description, Vec<Layout>), Rejection> {
    let is_record = |v: &HeaderVariable| {
        v.dimension_ids
            .first()
            .is_some_and(|id| header.dimensions[*id].1 == 0)
    };
    let record_bytes = record_bytes(header, is_record)?;
    let first_record_bytes = header
        .variables
        .iter()
        .filter(|v| is_record(v))
        .map(|v| v.begin_bytes)
        .min();
    let record_count = match (header.record_count, first_record_bytes) {
        (Some(count), _) => count,
        // Left open by a streaming writer: as many whole records as the file has.
        (None, Some(begin)) if record_bytes > 0 => file_bytes.saturating_sub(begin) / record_bytes,
        (None, _) => 0,
    };
    let mut variables = Vec::new();
    let mut layouts = Vec::new();
    for found in &header.variables {
        let dimensions: Vec<Dimension> = (found.dimension_ids.iter().enumerate())
            .map(|(place, id)| {
                let (name, len) = &header.dimensions[*id];
                let len = if place == 0 && *len == 0 {
                    record_count
                } else {
                    *len
                };
                Dimension {
                    name: Some(name.clone()),
                    len,
                }
            })
            .collect();
        let layout = Layout {
            external: found.external,
            begin_bytes: found.begin_bytes,
            record_bytes: is_record(found).then_some(record_bytes),
        };
        check_extent(&found.name, layout, &dimensions, file_bytes)?;
        layouts.push(layout);
        variables.push(Variable {
            name: found.name.clone(),
            dimensions,
            kind: found.external.kind(),
            attributes: found.attributes.clone(),
        });
    }
    let description = Description {
        format: "NetCDF classic".to_owned(),
        attributes: header.attributes.clone(),
        variables,
        library_bytes: 0,
        groups: vec![],
    };
    Ok((description, layouts))
}

/// Bytes of one record: the sum of all record variables, each padded to four unless it is the only one.
fn record_bytes(
    header: &Header,
    is_record: impl Fn(&HeaderVariable) -> bool,
) -> Result<u64, Rejection> {
    let mut sizes = Vec::new();
    for variable in header.variables.iter().filter(|v| is_record(v)) {
        let cells = variable.dimension_ids[1..]
            .iter()
            .try_fold(1u64, |n, id| n.checked_mul(header.dimensions[*id].1));
        let size = cells.and_then(|n| n.checked_mul(variable.external.size_bytes()));
        sizes.push(size.ok_or_else(|| too_large(&variable.name))?);
    }
    if let [only] = sizes.as_slice() {
        return Ok(*only);
    }
    let padded = sizes.iter().try_fold(0u64, |sum, size| {
        size.checked_next_multiple_of(4)?.checked_add(sum)
    });
    padded.ok_or_else(|| too_large("file"))
}

fn too_large(object: &str) -> Rejection {
    Rejection::new(
        RejectReason::TooLarge,
        object,
        "declares more bytes than a file can hold; the file is damaged",
    )
}

/// Does a variable end inside the file?
fn check_extent(
    name: &str,
    layout: Layout,
    dimensions: &[Dimension],
    file_bytes: u64,
) -> Result<(), Rejection> {
    let product = |dims: &[Dimension]| dims.iter().try_fold(1u64, |n, d| n.checked_mul(d.len));
    let size_bytes = match (layout.record_bytes, dimensions.split_first()) {
        (Some(record_bytes), Some((records, inner))) => {
            let last = product(inner).and_then(|n| n.checked_mul(layout.external.size_bytes()));
            let before = records
                .len
                .checked_sub(1)
                .map(|n| n.checked_mul(record_bytes));
            match before {
                None => Some(0),
                Some(before) => before.zip(last).and_then(|(a, b)| a.checked_add(b)),
            }
        }
        _ => product(dimensions).and_then(|n| n.checked_mul(layout.external.size_bytes())),
    };
    let end_bytes = size_bytes
        .and_then(|size| size.checked_add(layout.begin_bytes))
        .ok_or_else(|| too_large(name))?;
    if end_bytes > file_bytes && size_bytes != Some(0) {
        let detail = format!(
            "ends at byte {end_bytes} but the file has {file_bytes}; it is truncated, fetch it again"
        );
        return Err(corrupt(name, detail));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
