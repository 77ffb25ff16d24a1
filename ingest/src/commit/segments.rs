//! Series segments and domain of the next manifest: only segments with a changed step are written again.

use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, SeriesSegment, Step};
use contract::product::ProductId;
use storage::{Store, domain, fields, series};

use super::merge::Merged;
use crate::error::IngestError;

/// Most steps of a segment: a leap year of days.
pub(crate) const MAX_SEGMENT_STEPS: usize = 366;
/// Most values of a segment, 1 GiB: what is held in memory to turn maps into series ([`crate::limits::memory::of_series`]).
pub(crate) const MAX_SEGMENT_VALUES: usize = 1 << 28;

/// What was written.
pub(super) struct Written {
    pub(super) series: Vec<SeriesSegment>,
    pub(super) domain: ObjectKey,
}

/// Writes the series segments and the domain of merged steps.
pub(super) async fn write(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    newest: Option<&Manifest>,
    merged: &Merged,
) -> Result<Written, IngestError> {
    let steps = &merged.steps;
    // What was replaced may have held the only value of a cell: then the domain is built from nothing.
    let grown = newest.filter(|_| !merged.is_revision);
    let before = match grown {
        Some(newest) => domain::read(store, &newest.domain)
            .await
            .map_err(IngestError::storage("read the domain"))?,
        None => vec![false; grid.cell_count()],
    };
    let mut cells = before.clone();
    let mut segments = Vec::new();
    for (first, count) in runs(steps, grid) {
        let own = &steps[first..first + count];
        let kept = newest.and_then(|m| same_segment(m, own));
        if kept.is_none() || merged.is_revision {
            let values = read_all(store, grid, own).await?;
            mark(&mut cells, &values);
            if kept.is_none() {
                let series = write_series(store, product, grid, values).await?;
                segments.push(SeriesSegment {
                    first_step: first as u32,
                    steps: count as u32,
                    series,
                });
                continue;
            }
        }
        segments.extend(kept.map(|series| SeriesSegment {
            first_step: first as u32,
            steps: count as u32,
            series,
        }));
    }
    let domain = match grown {
        // It was read just now: to store it again would be two requests for nothing.
        Some(newest) if cells == before => newest.domain.clone(),
        _ => domain::write(store, product, &cells)
            .await
            .map_err(IngestError::storage("store the domain"))?,
    };
    Ok(Written {
        series: segments,
        domain,
    })
}

/// First step and number of steps of each segment: a calendar year, or less where that is too much.
fn runs(steps: &[Step], grid: &Grid) -> Vec<(usize, usize)> {
    let most = MAX_SEGMENT_STEPS
        .min(MAX_SEGMENT_VALUES / grid.cell_count().max(1))
        .max(1);
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for (index, step) in steps.iter().enumerate() {
        match runs.last_mut() {
            Some((first, count)) if *count < most && year(&steps[*first]) == year(step) => {
                *count += 1;
            }
            _ => runs.push((index, 1)),
        }
    }
    runs
}

/// Values of the largest segment of all: as many are held at once while every segment is read or written again.
pub(super) fn most_values(steps: &[Step], grid: &Grid) -> usize {
    let longest = runs(steps, grid).into_iter().map(|(_, count)| count).max();
    longest.unwrap_or(0).saturating_mul(grid.cell_count())
}

fn year(step: &Step) -> i32 {
    step.period.start.year_month().0
}

/// The series of a manifest that holds exactly these fields.
fn same_segment(manifest: &Manifest, steps: &[Step]) -> Option<ObjectKey> {
    let holds = |segment: &&SeriesSegment| {
        let first = segment.first_step as usize;
        let own = manifest
            .steps
            .get(first..first + segment.steps as usize)
            .unwrap_or_default();
        own.len() == steps.len() && own.iter().zip(steps).all(|(a, b)| a.field == b.field)
    };
    manifest
        .series
        .iter()
        .find(holds)
        .map(|segment| segment.series.clone())
}

pub(super) async fn read_all(
    store: &Store,
    grid: &Grid,
    steps: &[Step],
) -> Result<Vec<Vec<f32>>, IngestError> {
    let mut all = Vec::with_capacity(steps.len());
    for step in steps {
        all.push(
            fields::read(store, &step.field, grid)
                .await
                .map_err(IngestError::storage("read a field"))?,
        );
    }
    Ok(all)
}

pub(super) fn mark(cells: &mut [bool], steps: &[Vec<f32>]) {
    for values in steps {
        cells
            .iter_mut()
            .zip(values)
            .for_each(|(cell, value)| *cell |= !value.is_nan());
    }
}

/// Turning maps into series takes seconds for a large grid: not on a task that others wait for.
pub(super) async fn write_series(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    values: Vec<Vec<f32>>,
) -> Result<ObjectKey, IngestError> {
    let grid = *grid;
    let encode =
        move || series::encode(&grid, &values.iter().map(Vec::as_slice).collect::<Vec<_>>());
    let series = tokio::task::spawn_blocking(encode)
        .await?
        .map_err(IngestError::storage("encode a series"))?;
    let key = ObjectKey::series(product, &series.values_sha256);
    store
        .put_new(&key, series.content)
        .await
        .map_err(IngestError::storage("store a series"))?;
    Ok(key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::digest::Digest;
    use contract::time::Period;

    fn steps(months: impl Iterator<Item = (i32, u32)>) -> Vec<Step> {
        let step = |(year, month)| Step {
            masked: None,
            period: Period::month(year, month).unwrap(),
            field: ObjectKey::field(&"p".parse().unwrap(), &Digest::of(b"")),
            raw_sha256: Digest::of(b""),
            origin: String::new(),
            valid_cells: 1,
            contributed: None,
        };
        months.map(step).collect()
    }

    #[test]
    fn segments_are_calendar_years_and_smaller_for_large_grids() {
        let grid = |rows, cols| Grid {
            rows,
            cols,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 0.001,
            dlon_deg: 0.001,
        };
        let two_years = steps((2000..=2001).flat_map(|y| (1..=12).map(move |m| (y, m))));
        assert_eq!(runs(&two_years, &grid(2, 4)), [(0, 12), (12, 12)]);
        assert_eq!(runs(&two_years[3..], &grid(2, 4)), [(0, 9), (9, 12)]);
        assert_eq!(
            runs(&two_years[..5], &grid(1 << 13, 1 << 14)),
            [(0, 2), (2, 2), (4, 1)]
        );
        assert_eq!(runs(&[], &grid(2, 4)), []);
        assert_eq!(most_values(&two_years[3..], &grid(2, 4)), 12 * 8);
        assert_eq!(most_values(&two_years, &grid(1 << 13, 1 << 14)), 2 << 27);
        assert_eq!(most_values(&[], &grid(2, 4)), 0);
    }
}
