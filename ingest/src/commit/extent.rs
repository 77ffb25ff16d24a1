//! The cells that hold data in some step of the next version: only fields that come or go are read.

mod along_time;

use std::collections::BTreeSet;

use contract::chunk::{BAND_CELLS, Window};
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::product::ProductId;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use storage::domain::{self, Cells};
use storage::fields::Reader;
use storage::{StorageError, Store};

use crate::error::IngestError;

/// Fields that are read at a time.
pub(crate) const FIELDS_AT_ONCE: usize = 2;

/// Fields that are looked through one by one before a cube is asked: most cells are found in the first.
const FIELDS_AT_FIRST: usize = 2;
/// Fields that are no more work than to open a cube.
const FEW_FIELDS: usize = 16;

/// Fields of a file that was just read, and the cells that hold a value in some of them.
pub(super) struct Valued<'a> {
    pub(super) fields: BTreeSet<&'a ObjectKey>,
    pub(super) cells: &'a Cells,
}

/// Writes the domain of steps that follow the newest version.
///
/// What was dropped or revised may have held the only value of a cell: of such cells other steps are looked at until each was
/// found in one, which most are in the first; no further than the window that the rest lie in, and where steps are many, by what
/// the product's cube says of 128 of them together.
pub(crate) async fn write(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    newest: Option<&Manifest>,
    steps: &[Step],
) -> Result<ObjectKey, IngestError> {
    write_knowing(store, product, grid, (newest, steps), &[]).await
}

/// The same for who knows of some files which cells they hold: their fields are not read.
pub(super) async fn write_knowing(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    (newest, steps): (Option<&Manifest>, &[Step]),
    known: &[Valued<'_>],
) -> Result<ObjectKey, IngestError> {
    let newest = newest.filter(|newest| newest.grid == *grid);
    let before = match newest {
        Some(newest) => domain::read_cells(store, &newest.domain)
            .await
            .map_err(IngestError::storage("read the domain"))?,
        None => Cells::none(grid.cell_count()),
    };
    if before.map_count() != grid.cell_count() {
        let of_another = StorageError::Damaged {
            object: newest.map_or_else(String::new, |newest| newest.domain.to_string()),
            reason: format!(
                "{} cells, its grid has {}",
                before.map_count(),
                grid.cell_count()
            ),
        };
        return Err(IngestError::storage("read the domain")(of_another));
    }
    let there = newest.map_or(&[][..], |newest| &newest.steps);
    let (gone, mut come) = exchanged(there, steps);
    let mut cells = before.clone();
    let mut lost = Cells::none(grid.cell_count());
    let seen = each(store, grid, gone, |first, values| {
        lost.add_valued(first, values);
        true
    });
    match seen.await {
        // What is damaged may have held a value anywhere; it is on its way out, and must not keep what replaces it from landing.
        Err(IngestError::Storage {
            source: StorageError::Damaged { .. },
            ..
        }) => lost.clone_from(&before),
        other => other?,
    }
    for Valued {
        fields,
        cells: held,
    } in known
    {
        // Of a file of which not all comes it is not known what does.
        let own: BTreeSet<&ObjectKey> = come.iter().collect();
        if held.map_count() == grid.cell_count() && fields.is_subset(&own) {
            cells.add(held);
            lost.remove(held);
            come.retain(|field| !fields.contains(field));
        }
    }
    each(store, grid, come, |first, values| {
        cells.add_valued(first, values);
        lost.remove_valued(first, values);
        true
    })
    .await?;
    if lost.is_any() {
        look_through(store, (newest, steps), &mut lost).await?;
        cells.remove(&lost);
    }
    match newest {
        // It was read just now: to store it again would be two requests for nothing.
        Some(newest) if cells == before => Ok(newest.domain.clone()),
        _ => domain::write_cells(store, product, cells)
            .await
            .map_err(IngestError::storage("store the domain")),
    }
}

/// Writes the domain of a version again, from all of its fields.
pub(super) async fn write_again(
    store: &Store,
    version: &Manifest,
) -> Result<ObjectKey, IngestError> {
    write(store, &version.product, &version.grid, None, &version.steps).await
}

fn fields_of(steps: &[Step]) -> BTreeSet<&ObjectKey> {
    steps.iter().map(|step| &step.field).collect()
}

/// Fields that go, and fields that come, where some steps follow others.
///
/// Steps that both begin or end with are passed through once: to look each of 100,000 up in sets takes longer than to land one more.
fn exchanged(there: &[Step], next: &[Step]) -> (Vec<ObjectKey>, Vec<ObjectKey>) {
    let is_same = |(before, after): &(&Step, &Step)| before.field == after.field;
    let head = there.iter().zip(next).take_while(is_same).count();
    let ends = there[head..].iter().rev().zip(next[head..].iter().rev());
    let tail = ends.take_while(is_same).count();
    let (before, after) = (
        &there[head..there.len() - tail],
        &next[head..next.len() - tail],
    );
    let (mut gone, mut come) = (fields_of(before), fields_of(after));
    let both: Vec<&ObjectKey> = gone.intersection(&come).copied().collect();
    // One field may be that of several steps.
    let kept = there[..head].iter().chain(&there[there.len() - tail..]);
    for field in both.into_iter().chain(kept.map(|step| &step.field)) {
        gone.remove(field);
        come.remove(field);
    }
    let own = |fields: BTreeSet<&ObjectKey>| fields.into_iter().cloned().collect();
    (own(gone), own(come))
}

/// Hands the values of each field over, band by band with the number of the first cell, until `take` says that it needs no more.
async fn each(
    store: &Store,
    grid: &Grid,
    keys: Vec<ObjectKey>,
    mut take: impl FnMut(usize, &[f32]) -> bool,
) -> Result<(), IngestError> {
    let failed = || IngestError::storage("read a field");
    // The first band of the next field is read while that of the one before is looked at.
    let mut begun = stream::iter(keys)
        .map(|key| async move {
            let mut bands = Reader::open(store, &key, Some(grid)).await?.bands();
            let first = bands.next().await?;
            Ok::<_, StorageError>((bands, first))
        })
        .buffered(FIELDS_AT_ONCE);
    while let Some((mut bands, mut band)) = begun.try_next().await.map_err(failed())? {
        while let Some((rows, values)) = band {
            if !take(rows.start as usize * grid.cols as usize, &values) {
                return Ok(());
            }
            band = bands.next().await.map_err(failed())?;
        }
    }
    Ok(())
}

/// Takes cells away that hold data in steps of the newest version that the next one keeps.
async fn look_through(
    store: &Store,
    (newest, steps): (Option<&Manifest>, &[Step]),
    lost: &mut Cells,
) -> Result<(), IngestError> {
    let Some(newest) = newest else {
        return Ok(());
    };
    let own = fields_of(&newest.steps);
    let kept = steps.iter().rev().map(|step| &step.field);
    let kept: Vec<&ObjectKey> = kept.filter(|field| own.contains(field)).collect();
    let (first, rest) = kept.split_at(kept.len().min(FIELDS_AT_FIRST));
    look_for(store, &newest.grid, first.iter().copied(), lost).await?;
    let looked = if lost.is_any() && rest.len() > FEW_FIELDS {
        along_time::look_for(store, newest, &fields_of(steps), lost).await
    } else {
        BTreeSet::new()
    };
    let rest = rest.iter().copied().filter(|field| !looked.contains(field));
    look_for(store, &newest.grid, rest, lost).await
}

/// Takes cells away that hold data in some of these fields; of each no more is read than the window that the rest lie in.
async fn look_for<'a>(
    store: &Store,
    grid: &Grid,
    fields: impl Iterator<Item = &'a ObjectKey>,
    lost: &mut Cells,
) -> Result<(), IngestError> {
    let failed = || IngestError::storage("read a field");
    let mut all = Window {
        row: 0,
        col: 0,
        rows: grid.rows,
        cols: grid.cols,
    };
    for field in fields {
        let Some(window) = around(lost, grid, all) else {
            return Ok(());
        };
        all = window;
        let reader = Reader::open(store, field, Some(grid));
        let reader = reader.await.map_err(failed())?;
        let rows_at_once = (BAND_CELLS / u64::from(window.cols)).max(1) as u32;
        let mut left = window;
        while left.rows > 0 {
            let rows = left.rows.min(rows_at_once);
            let values = reader.window(Window { rows, ..left }).await;
            let values = values.map_err(failed())?;
            for (row, values) in (left.row..).zip(values.chunks(window.cols as usize)) {
                let first = row as usize * grid.cols as usize + window.col as usize;
                lost.remove_valued(first, values);
            }
            left.row += rows;
            left.rows -= rows;
        }
    }
    Ok(())
}

/// The smallest window that holds those of some cells that lie in another one; none without any.
fn around(cells: &Cells, grid: &Grid, all: Window) -> Option<Window> {
    let rows = all.row..all.row + all.rows;
    let (mut north, mut south, mut west, mut east) = (u32::MAX, 0, u32::MAX, 0);
    for row in rows {
        let row_start = row as usize * grid.cols as usize;
        let start = row_start + all.col as usize;
        let mut own = cells.within(start..start + all.cols as usize);
        let Some(first) = own.next() else {
            continue;
        };
        let last = own.next_back().unwrap_or(first);
        let [first, last] = [first, last].map(|cell| (cell - row_start) as u32);
        (north, south) = (north.min(row), row);
        (west, east) = (west.min(first), east.max(last));
    }
    (north <= south).then(|| Window {
        row: north,
        col: west,
        rows: south - north + 1,
        cols: east - west + 1,
    })
}

#[cfg(test)]
mod tests {
    use contract::digest::Digest;
    use contract::manifest::MANIFEST_SCHEMA;
    use contract::quantity::Quantity;
    use contract::time::Period;
    use storage::fields;

    use super::*;

    const GRID: Grid = Grid {
        rows: 1,
        cols: 4,
        north_deg: 1.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };
    const NONE: f32 = f32::NAN;

    async fn step(store: &Store, month: u32, values: [f32; 4]) -> Step {
        let (product, period) = ("p".parse().unwrap(), Period::month(2000, month).unwrap());
        let field = fields::write(store, &product, &GRID, &values, period).await;
        Step {
            period,
            field: field.unwrap(),
            raw_sha256: Digest::of(b""),
            origin: String::new(),
            valid_cells: 1,
            masked: None,
            contributed: None,
        }
    }

    /// The domain of steps that follow others.
    async fn after(store: &Store, before: &[Step], steps: &[Step]) -> Vec<bool> {
        let product: ProductId = "p".parse().unwrap();
        let domain = write(store, &product, &GRID, None, before).await.unwrap();
        let newest = Manifest {
            schema: MANIFEST_SCHEMA,
            number: 1,
            title: String::new(),
            quantity: Quantity::CarbonFlux,
            synthetic: false,
            source: String::new(),
            grid: GRID,
            steps: before.to_vec(),
            domain,
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product: product.clone(),
        };
        let found = write(store, &product, &GRID, Some(&newest), steps).await;
        let anew = write(store, &product, &GRID, None, steps).await.unwrap();
        let found = found.unwrap();
        assert_eq!(found, anew, "it is that of a product that has no past");
        domain::read(store, &found).await.unwrap()
    }

    #[tokio::test]
    async fn fields_that_come_and_go_are_told_wherever_they_stand() {
        let store = Store::memory();
        let mut all = vec![];
        for month in 1..=6 {
            all.push(step(&store, month, [month as f32; 4]).await);
        }
        let some = |months: &[usize]| -> Vec<Step> {
            months.iter().map(|month| all[*month].clone()).collect()
        };
        // The third step with the values of the first.
        let mut again = some(&[0, 1, 2]);
        again[2].field = again[0].field.clone();
        for (there, next) in [
            (some(&[]), some(&[0, 1])),
            (some(&[0, 1]), some(&[])),
            (some(&[0, 1, 2]), some(&[0, 1, 2])),
            (some(&[0, 1, 2]), some(&[0, 1, 2, 3])),
            (some(&[1, 2, 3]), some(&[0, 1, 2, 3])),
            (some(&[0, 1, 2, 3]), some(&[0, 5, 4, 3])),
            (some(&[0, 1, 2]), again.clone()),
            (again.clone(), some(&[0, 1, 2])),
            (again.clone(), some(&[1, 2])),
            (again.clone(), some(&[0, 1])),
            (again, some(&[3, 4, 5])),
        ] {
            let [before, after] = [fields_of(&there), fields_of(&next)];
            let but = |fields: &BTreeSet<&ObjectKey>, others| -> Vec<ObjectKey> {
                fields.difference(others).copied().cloned().collect()
            };
            let wanted = (but(&before, &after), but(&after, &before));
            assert_eq!(exchanged(&there, &next), wanted);
        }
    }

    #[tokio::test]
    async fn fields_of_which_the_cells_are_known_are_not_read_where_all_of_them_come() {
        let (store, product) = (Store::memory(), "p".parse::<ProductId>().unwrap());
        let before = [step(&store, 1, [1.0, NONE, NONE, NONE]).await];
        let file = [
            step(&store, 2, [NONE, 2.0, NONE, NONE]).await,
            step(&store, 3, [NONE, NONE, 3.0, NONE]).await,
        ];
        let mut held = Cells::none(4);
        held.add_valued(0, &[NONE, 2.0, 3.0, NONE]);
        let known = [Valued {
            fields: fields_of(&file),
            cells: &held,
        }];
        let of = async |steps: &[Step]| {
            let (counted, traffic) = store.counted();
            let written = write_knowing(&counted, &product, &GRID, (None, steps), &known);
            let domain = written.await.unwrap();
            let anew = write(&store, &product, &GRID, None, steps).await;
            assert_eq!(domain, anew.unwrap(), "it is that of who reads all");
            (domain, traffic.counts().reads)
        };
        let [first, last] = &file;
        let all = [before[0].clone(), first.clone(), last.clone()];
        let (domain, reads_known) = of(&all).await;
        let cells = domain::read(&store, &domain).await.unwrap();
        assert_eq!(cells, [true, true, true, false]);
        let (_, reads_alone) = of(&before).await;
        assert_eq!(reads_known, reads_alone, "of the file nothing is read");
        // Of a file whose last step is not taken, what its first one holds is looked up.
        let part = [before[0].clone(), first.clone()];
        let (domain, reads) = of(&part).await;
        let cells = domain::read(&store, &domain).await.unwrap();
        assert_eq!(cells, [true, true, false, false]);
        assert!(reads > reads_alone);
    }

    #[test]
    fn cells_lie_in_a_window_around_them() {
        let grid = Grid {
            rows: 5,
            cols: 7,
            ..GRID
        };
        let all = Window {
            row: 0,
            col: 0,
            rows: 5,
            cols: 7,
        };
        let mut cells = Cells::none(35);
        assert_eq!(around(&cells, &grid, all), None);
        for (row, col) in [(1, 4), (3, 2)] {
            cells.add_valued(row * 7 + col, &[1.0]);
        }
        let found = around(&cells, &grid, all).unwrap();
        let corners = (found.row, found.col, found.rows, found.cols);
        assert_eq!(corners, (1, 2, 3, 3));
        cells.remove_valued(3 * 7 + 2, &[1.0]);
        let found = around(&cells, &grid, found).unwrap();
        assert_eq!((found.row, found.col, found.rows, found.cols), (1, 4, 1, 1));
    }

    #[tokio::test]
    async fn of_steps_that_are_looked_through_only_the_window_of_lost_cells_is_read() {
        let (store, product) = (Store::memory(), "p".parse::<ProductId>().unwrap());
        let grid = Grid {
            rows: 600,
            cols: 600,
            ..GRID
        };
        // Only the first step, at one cell, has what the revision takes away; the others have nothing there.
        let mut steps = vec![];
        for month in 1..=4 {
            let value = |i: usize| match (i, month) {
                (90_300, 1) => 5.0,
                (90_300, _) => f32::NAN,
                _ => (i * month as usize).wrapping_mul(2_654_435_761) as f32,
            };
            let values: Vec<f32> = (0..grid.cell_count()).map(value).collect();
            let period = Period::month(2000, month).unwrap();
            steps.push(
                fields::write(&store, &product, &grid, &values, period)
                    .await
                    .unwrap(),
            );
        }
        let mut lost = Cells::none(grid.cell_count());
        lost.add_valued(90_300, &[5.0]);
        let size_bytes = store.size_bytes(&steps[1]).await.unwrap();
        let (counted, traffic) = store.counted();
        let mut rest = lost.clone();
        look_for(&counted, &grid, steps[1..].iter(), &mut rest)
            .await
            .unwrap();
        assert_eq!(rest, lost, "nobody holds it");
        let read_bytes = traffic.counts().read_bytes;
        assert!(
            read_bytes < size_bytes,
            "{read_bytes} of three times {size_bytes}"
        );
        look_for(&store, &grid, steps.iter(), &mut rest)
            .await
            .unwrap();
        assert!(!rest.is_any());
    }

    #[tokio::test]
    async fn a_cell_is_of_the_domain_while_some_step_holds_it() {
        let store = Store::memory();
        let one = step(&store, 1, [1.0, 2.0, NONE, NONE]).await;
        let two = step(&store, 2, [1.0, NONE, 3.0, NONE]).await;
        let three = step(&store, 3, [NONE, NONE, NONE, 4.0]).await;
        let (f, t) = (false, true);
        let both = [one.clone(), two.clone()];
        let grown = [one.clone(), two.clone(), three.clone()];
        assert_eq!(after(&store, &both, &grown).await, [t, t, t, t]);
        // The only value of the second cell goes, that of the first is held by another step.
        let revised = step(&store, 1, [NONE, NONE, NONE, 5.0]).await;
        let next = [revised, two.clone(), three.clone()];
        assert_eq!(after(&store, &grown, &next).await, [t, f, t, t]);
        assert_eq!(after(&store, &grown, &[two, three]).await, [t, f, t, t]);
        assert_eq!(after(&store, &grown, &[one]).await, [t, t, f, f]);
    }
}
