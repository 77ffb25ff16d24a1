//! What accumulation has come to between two runs of steps, band by band: in memory for a grid of one band, else in a file without
//! a name.

use std::fs::File;
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::path::Path;

use contract::chunk::bands;
use contract::grid::Grid;
use contract::time::TimeMs;
use storage::StorageError;
use storage::contributed::Contributed;

use crate::workshop::Workshop;

/// Bytes of a cell: its sum, its steps, its milliseconds.
const CELL_BYTES: u64 = 20;
/// Numbers that are turned into bytes at a time.
const AT_ONCE: usize = 1 << 16;

/// A band of rows: exact sums, kg m⁻² in steps of 10⁻¹⁵, and what they hold; `[row, col]`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CarriedBand {
    pub(super) sums: Vec<i64>,
    pub(super) counts: Contributed,
}

impl CarriedBand {
    /// Before the first step.
    pub(super) fn nothing(grid: &Grid, rows: &Range<u32>, start: TimeMs) -> Self {
        let band = Grid {
            rows: rows.len() as u32,
            ..*grid
        };
        Self {
            sums: vec![0; band.cell_count()],
            counts: Contributed::nothing(&band, start),
        }
    }
}

/// All bands of a grid.
#[derive(Debug)]
pub(super) struct Carried {
    grid: Grid,
    start: TimeMs,
    bands: Vec<Range<u32>>,
    place: Place,
}

#[derive(Debug)]
enum Place {
    /// The one band, unless it is taken or there is nothing yet.
    Held(Option<CarriedBand>),
    /// Of every band, where there is anything, its end and the number of steps.
    File(File, Vec<Option<(TimeMs, u32)>>),
}

impl Carried {
    /// Before the first step, in the bands of a workshop.
    pub(super) fn nothing(
        workshop: Workshop<'_>,
        grid: &Grid,
        start: TimeMs,
    ) -> Result<Self, StorageError> {
        let bands: Vec<Range<u32>> = bands(grid, workshop.band_cells).collect();
        let place = if bands.len() == 1 {
            Place::Held(None)
        } else {
            let file = tempfile::tempfile_in(workshop.spool);
            Place::File(
                file.map_err(failed(workshop.spool))?,
                vec![None; bands.len()],
            )
        };
        Ok(Self {
            grid: *grid,
            start,
            bands,
            place,
        })
    }

    /// Rows of every band, north to south.
    pub(super) fn bands(&self) -> &[Range<u32>] {
        &self.bands
    }

    /// What a band has come to, which is put back when it goes on.
    pub(super) fn take(&mut self, band: usize, spool: &Path) -> Result<CarriedBand, StorageError> {
        let rows = self.bands[band].clone();
        let mut own = CarriedBand::nothing(&self.grid, &rows, self.start);
        match &mut self.place {
            Place::Held(held) => Ok(held.take().unwrap_or(own)),
            Place::File(file, begun) => {
                if let Some((end, of_steps)) = begun[band] {
                    own.counts.period.end = end;
                    own.counts.of_steps = of_steps;
                    let at = CELL_BYTES * u64::from(rows.start) * u64::from(self.grid.cols);
                    read(file, at, &mut own).map_err(failed(spool))?;
                }
                Ok(own)
            }
        }
    }

    /// What it goes on from.
    pub(super) fn put(
        &mut self,
        band: usize,
        own: CarriedBand,
        spool: &Path,
    ) -> Result<(), StorageError> {
        match &mut self.place {
            Place::Held(held) => *held = Some(own),
            Place::File(file, begun) => {
                let rows = &self.bands[band];
                let at = CELL_BYTES * u64::from(rows.start) * u64::from(self.grid.cols);
                write(file, at, &own).map_err(failed(spool))?;
                begun[band] = Some((own.counts.period.end, own.counts.of_steps));
            }
        }
        Ok(())
    }
}

fn failed(spool: &Path) -> impl FnOnce(io::Error) -> StorageError {
    let folder = spool.to_owned();
    move |source| StorageError::Spool { folder, source }
}

fn write(file: &File, mut at: u64, own: &CarriedBand) -> io::Result<()> {
    let mut put = |bytes: Vec<u8>| {
        let put = file.write_all_at(&bytes, at);
        at += bytes.len() as u64;
        put
    };
    for some in own.sums.chunks(AT_ONCE) {
        put(some.iter().flat_map(|n| n.to_le_bytes()).collect())?;
    }
    for some in own.counts.steps.chunks(AT_ONCE) {
        put(some.iter().flat_map(|n| n.to_le_bytes()).collect())?;
    }
    for some in own.counts.milliseconds.chunks(AT_ONCE) {
        put(some.iter().flat_map(|n| n.to_le_bytes()).collect())?;
    }
    Ok(())
}

fn read(file: &File, mut at: u64, own: &mut CarriedBand) -> io::Result<()> {
    let mut bytes = vec![];
    let mut get = |count: usize, number_bytes: usize| {
        bytes.resize(count * number_bytes, 0);
        file.read_exact_at(&mut bytes, at)?;
        at += bytes.len() as u64;
        Ok::<Vec<u8>, io::Error>(bytes.clone())
    };
    for some in own.sums.chunks_mut(AT_ONCE) {
        let bytes = get(some.len(), size_of::<i64>())?;
        for (number, bytes) in some.iter_mut().zip(bytes.as_chunks().0) {
            *number = i64::from_le_bytes(*bytes);
        }
    }
    for some in own.counts.steps.chunks_mut(AT_ONCE) {
        let bytes = get(some.len(), size_of::<u32>())?;
        for (number, bytes) in some.iter_mut().zip(bytes.as_chunks().0) {
            *number = u32::from_le_bytes(*bytes);
        }
    }
    for some in own.counts.milliseconds.chunks_mut(AT_ONCE) {
        let bytes = get(some.len(), size_of::<i64>())?;
        for (number, bytes) in some.iter_mut().zip(bytes.as_chunks().0) {
            *number = i64::from_le_bytes(*bytes);
        }
    }
    Ok(())
}
