//! Statistics of a region whose products have the cells about it alone: the same values at the same places, in fields and in cubes.

use std::collections::BTreeSet;
use std::sync::Arc;

use compute::Engine;
use compute::computed::{Request, RequestedInput, compute};
use compute::derive::{derive_statistic, derive_statistics};
use contract::analysis::{MapOptions, MapStatistic};
use contract::chunk::Window;
use contract::computed::{Computation, Matching};
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs, TimeStep};
use storage::{Store, fields};

use crate::fixture::{folder_store, land, parts, product};

const GLOBE: Grid = Grid {
    rows: 36,
    cols: 72,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 5.0,
    dlon_deg: 5.0,
};
const DAY_MS: i64 = 86_400_000;
/// Three runs of steps.
const DAYS: usize = 300;

async fn landed(store: &Store) {
    let first: TimeMs = "2001-01-01".parse().unwrap();
    let at = |number: usize| TimeMs::new(first.ms() + number as i64 * DAY_MS).unwrap();
    let value = |number: usize, cell: usize| match (cell * 31 + number * 17) % 11 {
        3 => f32::NAN,
        rest => rest as f32 + cell as f32 * 0.01 + (number % 37) as f32,
    };
    let of_day = |number: usize| {
        let cells = (0..GLOBE.cell_count()).map(|cell| value(number, cell));
        let period = Period::new(at(number), at(number + 1)).unwrap();
        (period, cells.collect())
    };
    let steps: Vec<(Period, Vec<f32>)> = (0..DAYS).map(of_day).collect();
    land(store, &product("wind"), Quantity::WindSpeed, GLOBE, &steps).await;
}

/// One of each way in which maps are made.
fn asked(region: &str, crop: bool, name: &str) -> Vec<MapOptions> {
    let of = |statistic: MapStatistic, anomaly_step: Option<TimeStep>| {
        let step = anomaly_step.map_or_else(String::new, |step| format!("-{}", step.as_str()));
        MapOptions {
            region: Some(region.parse().unwrap()),
            crop,
            anomaly_step,
            name: Some(product(&format!("{name}-{}{step}", statistic.word()))),
            ..MapOptions::new(statistic)
        }
    };
    vec![
        of(MapStatistic::Mean, None),
        of(MapStatistic::Climatology, None),
        of(MapStatistic::Anomaly, None),
        of(MapStatistic::Anomaly, Some(TimeStep::Week)),
    ]
}

async fn read(store: &Store, manifest: &Manifest, step: usize) -> Vec<f32> {
    let field = &manifest.steps[step].field;
    fields::read(store, field, &manifest.grid).await.unwrap()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Has the cube what the fields have, map by map and along time?
async fn check_cube(store: &Store, manifest: &Manifest) {
    let (grid, steps) = (manifest.grid, manifest.steps.len());
    let whole = Window {
        row: 0,
        col: 0,
        rows: grid.rows,
        cols: grid.cols,
    };
    let manifest_of = Arc::new(manifest.clone());
    let values = cube::Values::of(store, &manifest_of).await.unwrap();
    assert_eq!(values.in_fields_count(), 0, "the cube has followed");
    let at = |row: u32| (0..grid.cols.div_ceil(8)).map(move |col| [row, col]);
    let blocks: Vec<[u32; 2]> = (0..grid.rows.div_ceil(8)).flat_map(at).collect();
    let along_time = values.blocks(&blocks, 0..steps).await.unwrap();
    for step in 0..steps {
        let right = bits(&read(store, manifest, step).await);
        let map = values.windows(step, &[whole]).await.unwrap();
        assert_eq!(bits(&map[0]), right, "{} {step}", manifest.product);
        for block in &along_time {
            let places = block.window.cell_indices(&grid);
            for (place, series) in places.zip(block.values.chunks_exact(steps)) {
                assert_eq!(series[step].to_bits(), right[place], "{step} {place}");
            }
        }
    }
}

/// Around a region, around one on both sides of the date line, and at the edge of the grid; made along time, held and not, and of whole fields.
#[tokio::test(flavor = "multi_thread")]
async fn cropped_statistics_are_those_of_the_same_places() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let roomy = Engine::in_process(store.clone(), parts(2));
    let engines = [
        ("roomy", roomy.clone()),
        ("small", roomy.clone().with_memory_bytes(2 << 20)),
        ("tiny", roomy.clone().with_memory_bytes(256 << 10)),
    ];
    for (place, region, cells) in [
        ("inland", "12,-28,33,11", [16, 16]),
        ("across", "163,-19,-171,21", [16, 16]),
        // To the last rows, which are half a block.
        ("south", "-21,-90,33,-66", [12, 24]),
    ] {
        let whole = asked(region, false, &format!("{place}-whole"));
        let whole = derive_statistics(&roomy, &product("wind"), &whole, &|_| ()).await;
        let whole = whole.unwrap();
        for (memory, engine) in &engines {
            let options = asked(region, true, &format!("{place}-{memory}"));
            let made = derive_statistics(engine, &product("wind"), &options, &|_| ()).await;
            let made = made.unwrap();
            for (own, whole) in made.iter().zip(&whole) {
                assert_eq!([own.grid.rows, own.grid.cols], cells, "{place}");
                assert_eq!(own.title, whole.title);
                assert_eq!(own.steps.len(), whole.steps.len());
                for step in 0..own.steps.len() {
                    let (values, of_whole) = (
                        read(&store, own, step).await,
                        read(&store, whole, step).await,
                    );
                    let mut seen = BTreeSet::new();
                    for (cell, value) in values.iter().enumerate() {
                        let (row, col) = (cell as u32 / own.grid.cols, cell as u32 % own.grid.cols);
                        let (row, col) = GLOBE.cell_at(own.grid.cell_center(row, col)).unwrap();
                        let place = (row * GLOBE.cols + col) as usize;
                        assert_eq!(value.to_bits(), of_whole[place].to_bits(), "{step} {place}");
                        seen.insert(place);
                    }
                    let elsewhere = of_whole.iter().enumerate();
                    let mut elsewhere = elsewhere.filter(|(place, _)| !seen.contains(place));
                    assert!(elsewhere.all(|(_, value)| value.is_nan()));
                    assert_eq!(own.steps[step].valid_cells, whole.steps[step].valid_cells);
                }
                assert!(own.steps.iter().any(|step| step.valid_cells > 30));
                check_cube(&store, own).await;
            }
        }
    }
}

/// Whoever asks for the whole grid after a crop gets a version of it, and the other way round; asked again it is as it is.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_cropped_can_be_had_whole_again() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let derived = async |crop: bool| {
        let options = &asked("12,-28,33,11", crop, "here")[2];
        let wind = product("wind");
        let made = derive_statistic(&engine, &wind, options, &|_| ()).await;
        made.unwrap()
    };
    for (crop, number, cells) in [
        (true, 1, 256),
        (true, 1, 256),
        (false, 2, GLOBE.cell_count()),
        (false, 2, GLOBE.cell_count()),
        (true, 3, 256),
    ] {
        let made = derived(crop).await;
        assert_eq!((made.number, made.grid.cell_count()), (number, cells));
        check_cube(&store, &made).await;
    }
}

/// What others are made of stays on the grid that they are on, unless nobody asked for it otherwise.
#[tokio::test(flavor = "multi_thread")]
async fn what_others_are_made_of_keeps_its_grid() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let derived = async |region: &str, crop: bool| {
        let options = &asked(region, crop, "here")[2];
        derive_statistic(&engine, &product("wind"), options, &|_| ()).await
    };
    let whole = derived("12,-28,33,11", false).await.unwrap();
    // Statistics of it follow to any grid.
    let spread = MapOptions {
        name: Some(product("spread-here")),
        ..MapOptions::new(MapStatistic::Spread)
    };
    let spread = derive_statistic(&engine, &whole.product, &spread, &|_| ()).await;
    spread.unwrap();
    assert_eq!(derived("12,-28,33,11", true).await.unwrap().number, 2);
    assert_eq!(derived("12,-28,33,11", false).await.unwrap().number, 3);
    let twice = Request {
        target: product("twice-here"),
        title: None,
        quantity: Some(whole.quantity),
        how: Computation::Expression {
            expression: "a * 2".to_owned(),
        },
        grid: None,
        inputs: vec![RequestedInput {
            name: "a".to_owned(),
            product: whole.product.clone(),
            matching: Matching::SamePeriod,
        }],
        from: None,
        to: None,
    };
    compute(&engine, &twice, &|_| ()).await.unwrap();
    let refused = derived("12,-28,33,11", true).await.unwrap_err().to_string();
    for part in [
        "36 x 72 cells",
        "16 x 16",
        "twice-here is made of it",
        "give another name",
    ] {
        assert!(refused.contains(part), "{refused}");
    }
    // Another region on the same grid is another version of it.
    assert_eq!(derived("-60,-28,33,11", false).await.unwrap().number, 4);
}
