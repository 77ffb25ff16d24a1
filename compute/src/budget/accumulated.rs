//! A budget of accumulated carbon: that of the flux which it was accumulated from, exact, and how complete it is.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use contract::budget::{BudgetAnswer, BudgetQuery, Completeness};
use contract::chunk::{CHUNK_COLS, CHUNK_ROWS, Window, bands, field_chunks};
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::time::{Period, TimeMs};
use storage::StorageError;
use storage::contributed::Reader;

use super::over_region::{AskedArea, weights};

use crate::region::loaded::{RegionWeights, weights_failed};
use crate::workshop::Workshop;
use crate::{ComputeError, Engine};

/// Objects of counts that are open at a time, each as it is stored: no period needs more.
const NEEDED_OPEN: u64 = 4;
/// The same on small grids: an object that two groups of periods need is read for each.
const MOST_OPEN: u64 = 64;

/// The budget of the flux as that of a version of the carbon that was accumulated from it.
pub(super) async fn completed(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
    mut answer: BudgetAnswer,
) -> Result<BudgetAnswer, ComputeError> {
    answer.product = manifest.product.clone();
    answer.manifest = manifest.id();
    answer.title.clone_from(&manifest.title);
    let address = weights(engine, manifest, AskedArea::of(query)).await?.all;
    let areas = engine.objects().weights(&address).await;
    let areas = areas.map_err(weights_failed)?;
    let periods = answer.rows.iter().map(|row| Period {
        start: row.start,
        end: row.end,
    });
    let periods: Vec<Period> = periods.collect();
    let workshop = Workshop::of(engine.store());
    let of = (&manifest.grid, &manifest.steps[..]);
    let found = completeness(workshop, of, &areas, &periods).await?;
    for (row, own) in answer.rows.iter_mut().zip(found) {
        row.completeness = own;
    }
    Ok(answer)
}

/// How complete the sums after some steps are in each of some periods; none where that was not counted.
async fn completeness(
    workshop: Workshop<'_>,
    (grid, steps): (&Grid, &[Step]),
    areas: &Arc<RegionWeights>,
    periods: &[Period],
) -> Result<Vec<Option<Completeness>>, ComputeError> {
    let cells = grid.cell_count().max(1) as u64;
    let most_open = (workshop.band_cells / cells).clamp(NEEDED_OPEN, MOST_OPEN);
    let mut found = vec![None; periods.len()];
    for group in groups(steps, periods, most_open as usize) {
        for row in group.read(workshop, grid, areas).await? {
            found[row.number] = Some(row.completeness);
        }
    }
    Ok(found)
}

/// What says the time with data until an instant, by keys of counts or by their places among those that are read.
#[derive(Debug, Clone, Copy)]
struct Until<K> {
    /// Counts at the end of the last step that is over; none before the first one.
    before: Option<K>,
    /// Of the step that the instant lies in: the counts at its end, and how much of it is over, ms.
    cut: Option<(K, i64)>,
}

impl<'a> Until<&'a ObjectKey> {
    /// None where it was not counted.
    fn of(steps: &'a [Step], time: TimeMs) -> Option<Self> {
        let whole = steps.partition_point(|step| step.period.end <= time);
        let before = match whole.checked_sub(1) {
            Some(last) => Some(counts_of(&steps[last])?),
            None => None,
        };
        let cut = match steps.get(whole).filter(|step| step.period.start < time) {
            Some(step) => Some((counts_of(step)?, time.ms() - step.period.start.ms())),
            None => None,
        };
        Some(Self { before, cut })
    }

    fn keys(&self) -> impl Iterator<Item = &'a ObjectKey> + use<'a> {
        self.before.into_iter().chain(self.cut.map(|(key, _)| key))
    }

    fn placed(&self, places: &BTreeMap<&ObjectKey, usize>) -> Until<usize> {
        Until {
            before: self.before.map(|key| places[key]),
            cut: self.cut.map(|(key, inside_ms)| (places[key], inside_ms)),
        }
    }
}

impl Until<usize> {
    /// Time with data of a cell, ms: its part of a step that the instant lies in is the part of that step's time.
    fn with_data_ms(&self, counts_ms: &[Vec<i64>], cell: usize) -> i64 {
        let own_ms = self.before.map_or(0, |at| counts_ms[at][cell]);
        match self.cut {
            Some((at, inside_ms)) if counts_ms[at][cell] > own_ms => own_ms + inside_ms,
            _ => own_ms,
        }
    }
}

fn counts_of(step: &Step) -> Option<&ObjectKey> {
    step.contributed.as_ref().map(|counted| &counted.counts)
}

/// Periods whose counts are read together.
#[derive(Default)]
struct Group<'a> {
    counts: BTreeSet<&'a ObjectKey>,
    /// Number of each, how long it is, ms, and where it starts and ends.
    periods: Vec<(usize, i64, [Until<&'a ObjectKey>; 2])>,
}

/// Periods one after the other, so many together that they need at most so many objects. What was not counted is in no group.
fn groups<'a>(steps: &'a [Step], periods: &[Period], most_open: usize) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = vec![];
    for (number, period) in periods.iter().enumerate() {
        let ends = [period.start, period.end].map(|time| Until::of(steps, time));
        let [Some(start), Some(end)] = ends else {
            continue;
        };
        let keys: BTreeSet<&ObjectKey> = start.keys().chain(end.keys()).collect();
        let is_full = |group: &Group<'a>| group.counts.union(&keys).count() > most_open;
        if groups.last().is_none_or(is_full) {
            groups.push(Group::default());
        }
        if let Some(group) = groups.last_mut() {
            let all_ms = period.end.ms() - period.start.ms();
            group.periods.push((number, all_ms, [start, end]));
            group.counts.extend(keys);
        }
    }
    groups
}

impl Group<'_> {
    /// Reads the counts once, from the north to the south.
    async fn read(
        &self,
        workshop: Workshop<'_>,
        grid: &Grid,
        areas: &Arc<RegionWeights>,
    ) -> Result<Vec<Row>, ComputeError> {
        let mut readers = vec![];
        for key in &self.counts {
            readers.push(Reader::open(workshop.store, key, grid).await?);
        }
        let places = self.counts.iter().copied().zip(0..);
        let places: BTreeMap<&ObjectKey, usize> = places.collect();
        let rows = self.periods.iter().map(|(number, all_ms, ends)| Row {
            number: *number,
            all_ms: *all_ms,
            ends: ends.map(|until| until.placed(&places)),
            completeness: Completeness {
                complete_m2: 0.0,
                incomplete_m2: 0.0,
            },
        });
        let mut rows: Vec<Row> = rows.collect();
        let most_cells = workshop.band_cells / readers.len().max(1) as u64;
        let (grid, areas) = (*grid, Arc::clone(areas));
        let adding = tokio::task::spawn_blocking(move || {
            let windows = field_chunks(&grid);
            for band in bands(&grid, most_cells) {
                let mut counts_ms = vec![];
                for reader in &mut readers {
                    counts_ms.push(reader.rows(band.len() as u32)?.milliseconds);
                }
                let regional = (&windows[..], &*areas);
                for row in &mut rows {
                    row.add(&grid, &band, regional, &counts_ms);
                }
            }
            Ok::<_, StorageError>(rows)
        });
        let rows = adding.await;
        Ok(rows.map_err(|e| ComputeError::inconsistent("counts of steps", e))??)
    }
}

/// A period on its way.
struct Row {
    number: usize,
    all_ms: i64,
    /// Where it starts and ends.
    ends: [Until<usize>; 2],
    completeness: Completeness,
}

impl Row {
    /// Adds areas of the cells of a band by whether they hold data in all of the time, in some or in nothing; `counts_ms` are `[row, col]` of
    /// the band. Chunks come in the order of their numbers, whatever the bands.
    fn add(
        &mut self,
        grid: &Grid,
        band: &Range<u32>,
        (windows, areas): (&[Window], &RegionWeights),
        counts_ms: &[Vec<i64>],
    ) {
        let across = grid.cols.div_ceil(CHUNK_COLS);
        let own = band.start / CHUNK_ROWS * across..band.end.div_ceil(CHUNK_ROWS) * across;
        let first = band.start as usize * grid.cols as usize;
        let [start, end] = self.ends;
        for (chunk, areas) in areas.chunks().filter(|(chunk, _)| own.contains(chunk)) {
            let cells = windows[chunk as usize].cell_indices(grid);
            for (cell, area_m2) in cells.map(|cell| cell - first).zip(areas.iter()) {
                let until_ms = |time: Until<usize>| time.with_data_ms(counts_ms, cell);
                match until_ms(end) - until_ms(start) {
                    0 => {}
                    own_ms if own_ms == self.all_ms => self.completeness.complete_m2 += area_m2,
                    _ => self.completeness.incomplete_m2 += area_m2,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use contract::digest::Digest;
    use contract::manifest;
    use contract::product::ProductId;
    use storage::Store;
    use storage::contributed::{self, Contributed};

    use super::*;

    /// Three rows of two chunks.
    const GRID: Grid = Grid {
        rows: 130,
        cols: 125,
        north_deg: 65.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    fn has_data(cell: usize, step: usize) -> bool {
        !(cell + 3 * step).is_multiple_of(5) && !cell.is_multiple_of(7)
    }

    fn month(number: u32) -> Period {
        Period::month(2001, number).unwrap()
    }

    /// The months of a year, with the counts of each.
    async fn year(store: &Store) -> Vec<Step> {
        let product: ProductId = "p".parse().unwrap();
        let mut counts = Contributed::nothing(&GRID, month(1).start);
        let mut steps = vec![];
        for number in 1..=12 {
            let cells = 0..GRID.cell_count();
            let own: Vec<bool> = cells.map(|cell| has_data(cell, number as usize)).collect();
            counts.add(month(number), &own);
            let key = contributed::write(store, &product, &GRID, &counts).await;
            steps.push(Step {
                period: month(number),
                field: ObjectKey::field(&product, &Digest::of(b"")),
                raw_sha256: Digest::of(b""),
                origin: "a test".to_owned(),
                valid_cells: 1,
                masked: None,
                contributed: Some(manifest::Contributed {
                    counts: key.unwrap(),
                    complete_cells: counts.complete_cells(),
                    since: None,
                }),
            });
        }
        steps
    }

    /// Some chunks of the grid, each with an area of its own.
    fn region() -> Arc<RegionWeights> {
        let windows = field_chunks(&GRID);
        let areas = |chunk: u32| {
            let cells = windows[chunk as usize].cell_count();
            (chunk, vec![f64::from(chunk + 1); cells])
        };
        Arc::new(RegionWeights::new([0, 1, 3, 5].map(areas).to_vec()))
    }

    /// Cell by cell from what holds data.
    fn expected(steps: &[Step], period: Period, areas: &RegionWeights) -> Completeness {
        let overlap_ms = |step: &Step| {
            let (start, end) = (
                step.period.start.ms().max(period.start.ms()),
                step.period.end.ms().min(period.end.ms()),
            );
            (end - start).max(0)
        };
        let (mut complete_m2, mut incomplete_m2) = (0.0, 0.0);
        for (chunk, areas) in areas.chunks() {
            let cells = field_chunks(&GRID)[chunk as usize].cell_indices(&GRID);
            for (cell, area_m2) in cells.zip(areas.iter()) {
                let own = (1..)
                    .zip(steps)
                    .filter(|(number, _)| has_data(cell, *number));
                let own_ms: i64 = own.map(|(_, step)| overlap_ms(step)).sum();
                if own_ms == period.end.ms() - period.start.ms() {
                    complete_m2 += area_m2;
                } else if own_ms > 0 {
                    incomplete_m2 += area_m2;
                }
            }
        }
        Completeness {
            complete_m2,
            incomplete_m2,
        }
    }

    #[tokio::test]
    async fn completeness_is_the_same_in_bands_of_any_size_and_however_many_counts_are_open() {
        let store = Store::memory();
        let (mut steps, areas) = (year(&store).await, region());
        let mut periods: Vec<Period> = (1..=12).map(month).collect();
        for (start, end) in [
            ("2001-01-01", "2002-01-01"),
            ("2001-02-11", "2001-02-20"),
            ("2001-02-11", "2001-09-16"),
            ("2001-11-11", "2002-01-01"),
        ] {
            let [start, end] = [start, end].map(|time| time.parse().unwrap());
            periods.push(Period { start, end });
        }
        // Of one group, and of as many as four objects are enough for.
        for (band_cells, group_count) in [(1 << 30, 1), (1, 6)] {
            let workshop = Workshop {
                band_cells,
                ..Workshop::of(&store)
            };
            let most_open = (band_cells / GRID.cell_count() as u64).clamp(NEEDED_OPEN, MOST_OPEN);
            let groups = groups(&steps, &periods, most_open as usize);
            assert_eq!(groups.len(), group_count);
            let of = (&GRID, &steps[..]);
            let found = completeness(workshop, of, &areas, &periods).await.unwrap();
            for (period, found) in periods.iter().zip(found) {
                let expected = expected(&steps, *period, &areas);
                assert!(expected.complete_m2 > 0.0 || expected.incomplete_m2 > 0.0);
                assert_eq!(found, Some(expected), "{period} {band_cells}");
            }
        }
        // The fourth month was not counted: neither it nor the one that begins where it ends has an answer.
        steps[3].contributed = None;
        let of = (&GRID, &steps[..]);
        let found = completeness(Workshop::of(&store), of, &areas, &periods[..12]).await;
        let unknown = (1..).zip(found.unwrap()).filter(|(_, own)| own.is_none());
        assert_eq!(unknown.map(|(month, _)| month).collect::<Vec<_>>(), [4, 5]);
    }
}
