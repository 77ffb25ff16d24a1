//! A region of the cells where a mask has a code: a version of the mask and the code, or what it means, in; polygons along the
//! edges of these cells out, so that it is a region on any grid.

use std::collections::{BTreeMap, BTreeSet};

use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::region::{AskedRegion, MAX_CORNERS, MAX_REGIONS, MaskCode, Polygon, Region};
use futures::future::BoxFuture;
use storage::{Store, fields};

use crate::ComputeError;
use crate::workshop::Workshop;

/// Codes that are named where the one asked for is not there.
const NAMED_CODES: usize = 20;

/// The cells of a mask that have the code, as a region named after the version of the mask.
///
/// # Errors
/// `Region` if the product has several maps, no code of this meaning, no cell with the code, or cells too scattered; its field
/// cannot be read.
pub fn region<'a>(
    store: &'a Store,
    mask: &'a Manifest,
    code: &'a MaskCode,
) -> BoxFuture<'a, Result<AskedRegion, ComputeError>> {
    Box::pin(async move {
        let code = code.number(mask)?;
        let (mut traced, mut codes) = (Traced::of(code), Codes::default());
        let workshop = Workshop::of(store);
        each_row(workshop, mask, |row, values| {
            traced.row(&mask.grid, row, values);
            codes.add(values);
            Ok(())
        })
        .await?;
        traced.region(mask, || codes.text())
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
        let mut all: Vec<Traced> = vec![];
        let workshop = Workshop::of(store);
        each_row(workshop, mask, |row, values| {
            for value in values.iter().filter(|value| !value.is_nan()) {
                if let Err(at) = all.binary_search_by(|own| own.code.total_cmp(value)) {
                    all.insert(at, Traced::of(*value));
                }
                if all.len() > MAX_REGIONS {
                    let reason = format!("it has more than {MAX_REGIONS} codes");
                    return Err(refused(mask, &reason));
                }
            }
            for traced in &mut all {
                traced.row(&mask.grid, row, values);
            }
            Ok(())
        })
        .await?;
        if all.is_empty() {
            return Err(refused(mask, "no cell has a code"));
        }
        let all = all.into_iter();
        all.map(|traced| traced.region(mask, String::new)).collect()
    })
}

/// Hands over the rows of the one map of a mask, north to south.
async fn each_row(
    workshop: Workshop<'_>,
    mask: &Manifest,
    mut take: impl FnMut(u32, &[f32]) -> Result<(), ComputeError>,
) -> Result<(), ComputeError> {
    let [step] = &mask.steps[..] else {
        let count = mask.steps.len();
        return Err(refused(
            mask,
            &format!("the product has {count} steps; a mask is one map"),
        ));
    };
    let (store, band_cells) = (workshop.store, workshop.band_cells);
    let mut bands = fields::bands(store, &step.field, &mask.grid, band_cells).await?;
    while let Some((rows, values)) = bands.next().await? {
        for (row, values) in rows.zip(values.chunks_exact(mask.grid.cols as usize)) {
            take(row, values)?;
        }
    }
    Ok(())
}

fn refused(mask: &Manifest, reason: &str) -> ComputeError {
    ComputeError::Region {
        reason: format!("{}: {reason}", mask.product),
    }
}

/// Runs of cells with a code, each joined with the same run of the rows below; none wider than half a turn.
struct Traced {
    code: f32,
    /// Columns of a run, and the row where it begins.
    open: BTreeMap<(usize, usize), u32>,
    /// As many as are taken, and one.
    found: Vec<Polygon>,
    count: usize,
}

impl Traced {
    fn of(code: f32) -> Self {
        Self {
            code,
            open: BTreeMap::new(),
            found: vec![],
            count: 0,
        }
    }

    /// Takes the next row.
    #[expect(clippy::float_cmp, reason = "a code is one exact number")]
    fn row(&mut self, grid: &Grid, row: u32, values: &[f32]) {
        let runs = runs(values, |value| value == self.code);
        self.close(grid, row, |run| !runs.contains(run));
        for run in runs {
            self.open.entry(run).or_insert(row);
        }
    }

    /// Ends some of the runs above a row.
    fn close(&mut self, grid: &Grid, row: u32, is_ended: impl Fn(&(usize, usize)) -> bool) {
        for ((first, end), top) in self.open.extract_if(.., |run, _| is_ended(run)) {
            self.count += 1;
            if self.found.len() * 4 > MAX_CORNERS {
                continue;
            }
            let [west, east] = [first, end].map(|col| grid.col_west_deg(col as u32));
            let [north, south] = [top, row].map(|row| grid.row_north_deg(row));
            self.found.push(Polygon {
                outer: vec![[west, south], [east, south], [east, north], [west, north]],
                holes: vec![],
            });
        }
    }

    /// The region of all rows; `codes` are those that there are.
    fn region(
        mut self,
        mask: &Manifest,
        codes: impl FnOnce() -> String,
    ) -> Result<AskedRegion, ComputeError> {
        self.close(&mask.grid, mask.grid.rows, |_run| true);
        let code = self.code;
        let refused = |reason: String| {
            Err(ComputeError::Region {
                reason: format!("{}:{code}: {reason}", mask.product),
            })
        };
        if self.count == 0 {
            return refused(format!("no cell has this code; there are {}", codes()));
        }
        if self.count * 4 > MAX_CORNERS {
            let count = self.count;
            return refused(format!(
                "its cells are {count} rectangles, at most {} are taken; give a coarser mask, or polygons",
                MAX_CORNERS / 4
            ));
        }
        Ok(AskedRegion {
            region: Region::Polygons(self.found),
            name: match mask.quantity.meaning(code) {
                Some(meaning) => format!("{}:{code} ({meaning})", mask.id()),
                None => format!("{}:{code}", mask.id()),
            },
        })
    }
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
#[derive(Default)]
struct Codes(BTreeMap<i64, f32>);

impl Codes {
    fn add(&mut self, values: &[f32]) {
        for value in values.iter().filter(|value| !value.is_nan()) {
            if self.0.len() > NAMED_CODES {
                return;
            }
            self.0
                .insert(i64::from(value.to_bits().cast_signed()), *value);
        }
    }

    fn text(&self) -> String {
        if self.0.len() > NAMED_CODES {
            return format!("more than {NAMED_CODES} others");
        }
        let all: Vec<String> = self.0.values().map(ToString::to_string).collect();
        all.join(", ")
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "codes are exact numbers")]
mod tests {
    use super::*;
    use contract::digest::Digest;
    use contract::earth::Earth;
    use contract::key::ObjectKey;
    use contract::manifest::{MANIFEST_SCHEMA, Step};
    use contract::product::ProductId;
    use contract::quantity::{Flag, OpenQuantity, OpenWords, Quantity};
    use contract::time::Period;

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

    fn rectangles(values: &[f32], code: f32) -> Vec<Polygon> {
        let mut traced = Traced::of(code);
        for (row, values) in (0..).zip(values.chunks_exact(8)) {
            traced.row(&GRID, row, values);
        }
        traced.close(&GRID, GRID.rows, |_run| true);
        traced.found
    }

    /// Area of a region against that of the cells, which are counted one by one.
    #[test]
    fn a_region_has_the_area_of_its_cells_and_no_other() {
        for code in [1.0, 2.0, 3.0] {
            let values = values();
            let region = Region::Polygons(rectangles(&values, code));
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
        assert_eq!(rectangles(&values(), 2.0).len(), 3);
        assert_eq!(rectangles(&values(), 1.0).len(), 9);
        let mut codes = Codes::default();
        codes.add(&values());
        assert_eq!(codes.text(), "1, 2, 3");
        codes.add(&(4..30).map(|code| code as f32).collect::<Vec<_>>());
        assert_eq!(codes.text(), "more than 20 others");
    }

    /// Three rows of chunks, the last one short.
    const LARGE: Grid = Grid {
        rows: 150,
        cols: 130,
        north_deg: 75.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    /// The version of a mask on that grid.
    async fn landed(store: &Store, values: &[f32]) -> Manifest {
        let product: ProductId = "basins".parse().unwrap();
        let period = Period::year(2000).unwrap();
        let field = fields::write(store, &product, &LARGE, values, period);
        let digest = Digest::of(b"");
        let step = Step {
            masked: None,
            period,
            field: field.await.unwrap(),
            raw_sha256: digest,
            origin: "basins.nc".to_owned(),
            valid_cells: 1,
            contributed: None,
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            number: 1,
            title: "Basins".to_owned(),
            quantity: Quantity::open("basin", "1", "Basin").unwrap(),
            synthetic: true,
            source: String::new(),
            grid: LARGE,
            steps: vec![step],
            domain: ObjectKey::domain(&product, &digest),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product,
        }
    }

    /// A square goes over the edge of a band, another code begins below it.
    #[tokio::test]
    async fn a_mask_that_is_read_in_bands_has_the_rows_and_regions_of_the_whole() {
        let code = |cell: usize| match (cell / 130, cell % 130) {
            (50..70, 20..40) => 1.0,
            (125..150, 0..65) => 2.0,
            (row, _) if row % 50 == 7 => f32::NAN,
            _ => 0.0,
        };
        let values: Vec<f32> = (0..LARGE.cell_count()).map(code).collect();
        let store = Store::memory();
        let mask = landed(&store, &values).await;
        for band_cells in [1, 1 << 30] {
            let workshop = Workshop {
                band_cells,
                ..Workshop::of(&store)
            };
            let (mut rows, mut traced) = (vec![], Traced::of(1.0));
            let taken = each_row(workshop, &mask, |row, own| {
                rows.push((
                    row,
                    own.iter().map(|value| value.to_bits()).collect::<Vec<_>>(),
                ));
                traced.row(&LARGE, row, own);
                Ok(())
            });
            taken.await.unwrap();
            let bits: Vec<u32> = values.iter().map(|value| value.to_bits()).collect();
            let whole = (0..).zip(bits.chunks_exact(130).map(<[u32]>::to_vec));
            assert_eq!(rows, whole.collect::<Vec<_>>(), "{band_cells}");
            traced.close(&LARGE, LARGE.rows, |_run| true);
            let corners: Vec<_> = traced.found.into_iter().map(|own| own.outer).collect();
            let square = vec![[20.0, 5.0], [40.0, 5.0], [40.0, 25.0], [20.0, 25.0]];
            assert_eq!(corners, [square], "{band_cells}");
        }
        let all = regions(&store, &mask).await.unwrap();
        let names: Vec<String> = all.into_iter().map(|own| own.name).collect();
        let wanted = ["0", "1", "2"].map(|code| format!("{}:{code}", mask.id()));
        assert_eq!(names, wanted);
        let of = |code: MaskCode| {
            let (store, mask) = (&store, &mask);
            async move { region(store, mask, &code).await }
        };
        let none = of(MaskCode::Number(7.0)).await.unwrap_err().to_string();
        assert!(none.contains("there are 0, 1, 2"), "{none}");
        let word = MaskCode::Meaning("square".to_owned());
        let none = of(word).await.unwrap_err().to_string();
        assert!(none.contains("does not say"), "{none}");
    }

    #[tokio::test]
    async fn a_code_is_asked_for_by_what_it_means_and_told_with_it() {
        let values: Vec<f32> = (0..LARGE.cell_count())
            .map(|cell| if cell % 130 < 65 { 12.0 } else { 1.0 })
            .collect();
        let store = Store::memory();
        let flag = |value, meaning: &str| Flag {
            value,
            meaning: meaning.to_owned(),
        };
        let words = OpenWords {
            name: "basin".to_owned(),
            unit: "1".to_owned(),
            title: "Basin".to_owned(),
            range: None,
            flags: vec![flag(12, "west"), flag(3, "nowhere")],
            is_standard_name: false,
        };
        let mask = Manifest {
            quantity: Quantity::Open(OpenQuantity::new(words).unwrap()),
            ..landed(&store, &values).await
        };
        let of = |text: &str| {
            let (_mask, code) = MaskCode::split(&format!("basins:{text}")).unwrap();
            let (store, mask) = (&store, &mask);
            async move { region(store, mask, &code).await }
        };
        let west = of("west").await.unwrap();
        assert_eq!(west, of("12").await.unwrap());
        assert_eq!(west.name, format!("{}:12 (west)", mask.id()));
        assert_eq!(of("1").await.unwrap().name, format!("{}:1", mask.id()));
        let names: Vec<_> = regions(&store, &mask).await.unwrap();
        let names: Vec<_> = names.iter().map(|own| own.name.clone()).collect();
        assert_eq!(names, [format!("{}:1", mask.id()), west.name]);
        // Meant by a code that no cell has, and by none.
        let none = of("nowhere").await.unwrap_err().to_string();
        assert!(
            none.contains("3: no cell has this code; there are 1, 12"),
            "{none}"
        );
        let none = of("East").await.unwrap_err().to_string();
        assert!(none.contains("there are nowhere, west"), "{none}");
    }
}
