//! A region of the cells where a mask has a code: `PRODUCT:CODE` in, polygons along the edges of these cells out, so that it
//! is a region on any grid.

use std::collections::{BTreeMap, BTreeSet};

use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::region::{AskedRegion, MAX_CORNERS, MAX_REGIONS, Polygon, Region};
use futures::future::BoxFuture;
use storage::Store;

use crate::ComputeError;

/// Codes that are named where the one asked for is not there.
const NAMED_CODES: usize = 20;

/// The product and the code of `PRODUCT:CODE`; none if the text is not that.
pub fn asked(text: &str) -> Option<(ProductId, f32)> {
    let (product, code) = text.split_once(':')?;
    let code: f32 = code.trim().parse().ok()?;
    Some((product.parse().ok()?, code)).filter(|_| code.is_finite())
}

/// The cells of a mask that have the code, as a region named after the version of the mask.
///
/// # Errors
/// `Region` if the product has several maps, no cell with the code, or cells too scattered; its field cannot be read.
pub fn region<'a>(
    store: &'a Store,
    mask: &'a Manifest,
    code: f32,
) -> BoxFuture<'a, Result<AskedRegion, ComputeError>> {
    Box::pin(async move {
        let values = map(store, mask).await?;
        of_code(mask, &values, code)
    })
}

/// The same of every code of a mask, in the order of codes.
///
/// # Errors
/// As of one, and more codes than regions are asked for at once.
pub fn regions<'a>(
    store: &'a Store,
    mask: &'a Manifest,
) -> BoxFuture<'a, Result<Vec<AskedRegion>, ComputeError>> {
    Box::pin(async move {
        let values = map(store, mask).await?;
        let mut codes: Vec<f32> = vec![];
        for value in values.iter().filter(|value| !value.is_nan()) {
            if let Err(at) = codes.binary_search_by(|code| code.total_cmp(value)) {
                codes.insert(at, *value);
            }
            if codes.len() > MAX_REGIONS {
                return Err(refused(
                    mask,
                    &format!("it has more than {MAX_REGIONS} codes"),
                ));
            }
        }
        if codes.is_empty() {
            return Err(refused(mask, "no cell has a code"));
        }
        codes
            .iter()
            .map(|code| of_code(mask, &values, *code))
            .collect()
    })
}

/// The one map of a mask, `[row, col]`.
async fn map(store: &Store, mask: &Manifest) -> Result<Vec<f32>, ComputeError> {
    let [step] = &mask.steps[..] else {
        let count = mask.steps.len();
        return Err(refused(
            mask,
            &format!("the product has {count} steps; a mask is one map"),
        ));
    };
    Ok(storage::fields::read(store, &step.field, &mask.grid).await?)
}

fn refused(mask: &Manifest, reason: &str) -> ComputeError {
    ComputeError::Region {
        reason: format!("{}: {reason}", mask.product),
    }
}

fn of_code(mask: &Manifest, values: &[f32], code: f32) -> Result<AskedRegion, ComputeError> {
    let refused = |reason: String| {
        Err(ComputeError::Region {
            reason: format!("{}:{code}: {reason}", mask.product),
        })
    };
    let rectangles = rectangles(&mask.grid, values, code);
    if rectangles.is_empty() {
        return refused(format!(
            "no cell has this code; there are {}",
            codes(values)
        ));
    }
    if rectangles.len() * 4 > MAX_CORNERS {
        let count = rectangles.len();
        return refused(format!(
            "its cells are {count} rectangles, at most {} are taken; give a coarser mask, or polygons",
            MAX_CORNERS / 4
        ));
    }
    Ok(AskedRegion {
        region: Region::Polygons(rectangles),
        name: format!("{}:{code}", mask.id()),
    })
}

/// Runs of cells with the code, each joined with the same run of the rows below; none wider than half a turn.
#[expect(clippy::float_cmp, reason = "a code is one exact number")]
fn rectangles(grid: &Grid, values: &[f32], code: f32) -> Vec<Polygon> {
    let cols = grid.cols as usize;
    let mut found = vec![];
    // Columns of a run, and the row where it begins.
    let mut open: BTreeMap<(usize, usize), u32> = BTreeMap::new();
    let mut close = |(first, end): (usize, usize), top: u32, bottom: u32| {
        let [west, east] = [first, end].map(|col| grid.col_west_deg(col as u32));
        let [north, south] = [top, bottom].map(|row| grid.row_north_deg(row));
        found.push(Polygon {
            outer: vec![[west, south], [east, south], [east, north], [west, north]],
            holes: vec![],
        });
    };
    for row in 0..=grid.rows {
        let start = row as usize * cols;
        let runs: BTreeSet<(usize, usize)> = match values.get(start..start + cols) {
            Some(row) => runs(row, |value| value == code),
            None => BTreeSet::new(),
        };
        let ended: Vec<_> = open
            .iter()
            .filter(|(run, _)| !runs.contains(run))
            .map(|(run, top)| (*run, *top))
            .collect();
        for (run, top) in ended {
            open.remove(&run);
            close(run, top, row);
        }
        for run in runs {
            open.entry(run).or_insert(row);
        }
    }
    found
}

/// First column and the one after the last of each run, cut in the middle of the row.
fn runs(row: &[f32], is_in: impl Fn(f32) -> bool) -> BTreeSet<(usize, usize)> {
    let mut runs = BTreeSet::new();
    let mut first = None;
    for col in 0..=row.len() {
        let is_one = row.get(col).is_some_and(|value| is_in(*value));
        let is_cut = col == row.len() / 2;
        if let Some(start) = first.take_if(|_| !is_one || is_cut) {
            runs.insert((start, col));
        }
        if is_one && first.is_none() {
            first = Some(col);
        }
    }
    runs
}

/// The numbers of a mask, as far as they fit a line.
fn codes(values: &[f32]) -> String {
    let mut all = BTreeMap::new();
    for value in values.iter().filter(|value| !value.is_nan()) {
        all.insert(i64::from(value.to_bits().cast_signed()), *value);
        if all.len() > NAMED_CODES {
            return format!("more than {NAMED_CODES} others");
        }
    }
    let all: Vec<String> = all.values().map(ToString::to_string).collect();
    all.join(", ")
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "codes are exact numbers")]
mod tests {
    use super::*;
    use contract::earth::Earth;

    const GRID: Grid = Grid {
        rows: 4,
        cols: 8,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 45.0,
        dlon_deg: 45.0,
    };

    fn values() -> Vec<f32> {
        #[rustfmt::skip]
        let values = [
            1., 1., 1., 1., 1., 1., 1., 1.,
            1., 2., 2., 1., 3., 3., 1., 1.,
            1., 2., 2., 1., 1., 3., f32::NAN, 1.,
            1., 2., 1., 1., 1., 1., 1., 2.,
        ];
        values.to_vec()
    }

    /// Area of a region against that of the cells, which are counted one by one.
    #[test]
    fn a_region_has_the_area_of_its_cells_and_no_other() {
        for code in [1.0, 2.0, 3.0] {
            let values = values();
            let region = Region::Polygons(rectangles(&GRID, &values, code));
            let weights = crate::region::weights::compute(&GRID, &region, Earth::Wgs84).unwrap();
            let [(0, areas_m2)] = &weights[..] else {
                panic!("one chunk holds all cells")
            };
            for (cell, (value, area_m2)) in values.iter().zip(areas_m2).enumerate() {
                let whole = GRID.cell_area_m2(cell as u32 / 8, Earth::Wgs84);
                let wanted = if *value == code { whole } else { 0.0 };
                assert!(
                    (area_m2 - wanted).abs() < 1e-9 * whole,
                    "{code}: cell {cell}: {area_m2} is not {wanted}"
                );
            }
        }
    }

    #[test]
    fn runs_that_go_on_below_are_one_rectangle() {
        assert_eq!(rectangles(&GRID, &values(), 2.0).len(), 3);
        assert_eq!(rectangles(&GRID, &values(), 1.0).len(), 9);
        assert_eq!(codes(&values()), "1, 2, 3");
    }

    #[test]
    fn a_code_follows_the_name_of_a_product() {
        let of = |text| asked(text).map(|(product, code)| (product.to_string(), code));
        assert_eq!(of("oceans:3"), Some(("oceans".to_owned(), 3.0)));
        assert_eq!(of("oceans:-1.5"), Some(("oceans".to_owned(), -1.5)));
        for text in [
            "oceans",
            "oceans:",
            "oceans:x",
            "oceans:nan",
            "A:1",
            "{\"a\":1}",
            "http://a:1",
        ] {
            assert_eq!(of(text), None, "{text}");
        }
    }
}
