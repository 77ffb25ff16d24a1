//! Two products correlated cell by cell, as products: each cell what the two series of that cell say.

use compute::analysis::correlation as of_series;
use compute::computed::{Request, RequestedInput, compute};
use compute::dependents::follow;
use compute::derive::derive_statistics;
use compute::{ComputeError, Engine, ErrorClass};
use contract::analysis::{
    CorrelationQuery, CorrelationRow, CorrelationStatistic, MapCorrelation, MapOptions,
    MapStatistic, SeriesQuery,
};
use contract::computed::{Computation, Matching};
use contract::grid::{Grid, LonLatDeg};
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time::{Period, TimeStep};
use storage::gc::Kept;
use storage::{Store, fields};

use crate::fixture::{folder_store, land, parts, product};

/// Blocks that are cut at both edges.
const GRID: Grid = Grid {
    rows: 19,
    cols: 37,
    north_deg: 40.0,
    west_deg: -30.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};
/// Everything that is said of a correlation.
const ALL: [CorrelationStatistic; 4] = [
    CorrelationStatistic::Coefficient,
    CorrelationStatistic::PValue,
    CorrelationStatistic::Pairs,
    CorrelationStatistic::EffectivePairs,
];
/// Column of land in the first product.
const LAND: usize = 3;
/// Column of gaps in the first.
const GAPS: usize = 5;
/// Column of one value in the second.
const EQUAL: usize = 6;
/// Column of two pairs.
const TWO: usize = 7;
/// Column where one has data when the other has none.
const NONE: usize = 8;

fn month(month: u32) -> Period {
    Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap()
}

/// Noise between 0 and 1 that a cell has at a time.
fn noise(time: u32, cell: usize) -> f32 {
    let mut mixed = (time * 613 + cell as u32 * 37).wrapping_mul(2_654_435_761);
    mixed = (mixed ^ (mixed >> 15)).wrapping_mul(2_246_822_519);
    mixed ^= mixed >> 13;
    (mixed >> 20) as f32 / 4096.0
}

/// K: a season, noise, and gaps.
fn sst(time: u32, cell: usize) -> f32 {
    let season = 290.0 + 5.0 * (time % 12) as f32;
    match cell % 37 {
        LAND => f32::NAN,
        GAPS if time % 7 < 3 => f32::NAN,
        TWO if time != 20 && time != 30 => f32::NAN,
        NONE if time.is_multiple_of(2) => f32::NAN,
        _ => season + noise(time, cell) + noise(time + 1, cell),
    }
}

/// m s⁻¹: another season, and the noise that the temperature has a month later, the more the further south.
fn wind(time: u32, cell: usize) -> f32 {
    let share = (cell / 37) as f32 / 18.0;
    let season = ((time + 4) % 12) as f32 * 0.25;
    match cell % 37 {
        EQUAL => 7.3,
        NONE if !time.is_multiple_of(2) => f32::NAN,
        _ => season + share * noise(time + 1, cell) + (1.0 - share) * noise(time + 900, cell),
    }
}

fn steps(
    times: impl Iterator<Item = u32>,
    value: impl Fn(u32, usize) -> f32,
) -> Vec<(Period, Vec<f32>)> {
    times
        .map(|time| {
            let cells = (0..GRID.cell_count()).map(|cell| value(time, cell));
            (month(time), cells.collect())
        })
        .collect()
}

/// Five years of temperature, and of wind from half a year later on; the wind of two months is missing.
async fn landed(store: &Store) -> [Manifest; 2] {
    let quantity = Quantity::SeaSurfaceTemperature;
    let first = land(store, &product("sst"), quantity, GRID, &steps(0..60, sst)).await;
    let times = (6..66).filter(|time| ![17, 41].contains(time));
    let second = steps(times, wind);
    let second = land(store, &product("wind"), Quantity::WindSpeed, GRID, &second).await;
    [first, second]
}

fn with(lag_steps: i32, deseasonalise: bool) -> MapCorrelation {
    MapCorrelation {
        lag_steps,
        deseasonalise,
        ..MapCorrelation::new(product("wind"))
    }
}

/// All four maps, named after what they begin with.
fn all(name: &str, step: TimeStep, correlation: &MapCorrelation) -> Vec<MapOptions> {
    let one = |of: &CorrelationStatistic| MapOptions {
        step,
        name: Some(product(&format!("{name}-{}", of.as_str()))),
        ..MapOptions::of_two(*of, correlation.clone())
    };
    ALL.iter().map(one).collect()
}

async fn derived(engine: &Engine, options: &[MapOptions]) -> Result<Vec<Manifest>, ComputeError> {
    derive_statistics(engine, &product("sst"), options, &|_| ()).await
}

async fn maps(store: &Store, made: &[Manifest]) -> Vec<Vec<f32>> {
    let mut maps = vec![];
    for one in made {
        assert_eq!(one.steps.len(), 1);
        let map = fields::read(store, &one.steps[0].field, &GRID).await;
        maps.push(map.unwrap());
    }
    maps
}

fn at(row: usize, col: usize) -> usize {
    row * 37 + col
}

fn is_same(a: &[Vec<f32>], b: &[Vec<f32>]) -> bool {
    let bits = |maps: &[Vec<f32>]| -> Vec<u32> {
        maps.iter().flatten().map(|value| value.to_bits()).collect()
    };
    bits(a) == bits(b)
}

/// What the series of a cell say at a lag.
async fn of_cell(
    engine: &Engine,
    [a, b]: [&Manifest; 2],
    cell: usize,
    (step, correlation): (TimeStep, &MapCorrelation),
) -> CorrelationRow {
    let (lon, lat) = ((cell % 37) as f64 - 29.5, 39.5 - (cell / 37) as f64);
    let series = SeriesQuery::Cell {
        product: a.product.clone(),
        place: LonLatDeg::new(lon, lat).unwrap(),
        from: None,
        to: None,
    };
    let most = correlation.lag_steps.unsigned_abs();
    let mut query = CorrelationQuery::new(series, b.product.clone(), most).unwrap();
    (query.step, query.deseasonalise) = (step, correlation.deseasonalise);
    let found = of_series(engine, (a, &a.id()), (b, &b.id()), &query).await;
    let mut rows = found.unwrap().rows.into_iter();
    rows.find(|row| row.lag_steps == correlation.lag_steps)
        .unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn each_cell_has_what_the_series_of_that_cell_say() {
    let (_folder, store) = folder_store();
    let [a, b] = landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    // Most pairs by hand: 54 months are common, and 19 seasons, each in part.
    for (number, (step, correlation, most)) in [
        (TimeStep::Month, with(0, false), 54),
        (TimeStep::Month, with(-1, true), 53),
        (TimeStep::Native, with(3, true), 51),
        (TimeStep::Season, with(0, false), 19),
    ]
    .into_iter()
    .enumerate()
    {
        let options = all(&format!("x{number}"), step, &correlation);
        let made = derived(&engine, &options).await.unwrap();
        let maps = maps(&store, &made).await;
        let cells = (0..GRID.cell_count()).step_by(11);
        let special = [LAND, GAPS, EQUAL, TWO, NONE].map(|col| at(9, col));
        let (mut held, mut withheld) = (0, 0);
        for cell in cells.chain(special) {
            let row = of_cell(&engine, [&a, &b], cell, (step, &correlation)).await;
            let is_enough = 2 * row.count >= most;
            let right = [
                row.correlation.filter(|_| is_enough),
                row.p_value.filter(|_| is_enough),
                (row.count > 0).then_some(row.count as f64),
                row.effective_count.filter(|_| is_enough),
            ];
            for ((map, right), of) in maps.iter().zip(right).zip(ALL) {
                let right = right.map_or(f32::NAN, |right| right as f32);
                let is_right = map[cell].to_bits() == right.to_bits();
                assert!(is_right, "{step} {cell} {of:?}: {} {right}", map[cell]);
            }
            held += usize::from(right[0].is_some());
            withheld += usize::from(right[0].is_none());
        }
        assert!(held > 40 && withheld > 4, "{held} {withheld}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn maps_of_a_correlation_are_products_that_say_what_they_are_of() {
    let (_folder, store) = folder_store();
    let [a, b] = landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let of = |of| MapOptions::of_two(of, with(-1, true));
    let made = derived(&engine, &ALL.map(of)).await.unwrap();
    let names: Vec<&str> = made.iter().map(|one| one.product.as_str()).collect();
    assert_eq!(
        names,
        [
            "sst-correlation-wind",
            "sst-correlation-p-value-wind",
            "sst-correlation-pairs-wind",
            "sst-correlation-effective-pairs-wind"
        ]
    );
    assert_eq!(
        made[0].title,
        "Test sst and Test wind, correlation of months over 1 July 2001 to 31 December 2005, seasons taken off, the second 1 step earlier, \
         where 50 % or more hold data"
    );
    assert_eq!(made[0].quantity.word(), "correlation");
    assert_eq!(made[1].quantity.unit(), "1");
    assert_eq!(
        made[0].source,
        format!(
            "Correlated; {} (made by a test); {} (made by a test)",
            a.id(),
            b.id()
        )
    );
    assert_eq!(made[0].steps[0].period.start, month(6).start);
    assert_eq!(made[0].steps[0].period.end, month(59).end);
    assert_eq!(made[0].derived_from, Some(a.id()));
    let computed = made[1].computed.as_ref().unwrap();
    let versions = computed.inputs.iter().map(|input| input.manifest.clone());
    assert_eq!(versions.collect::<Vec<_>>(), [a.id(), b.id()]);
    let how = Computation::Correlation {
        statistic: CorrelationStatistic::PValue,
        lag_steps: -1,
        step: TimeStep::Month,
        deseasonalised: true,
        least_percent: 50,
    };
    assert_eq!(computed.how, how);
    let maps = maps(&store, &made).await;
    // The noise of the wind is that of the temperature a month later: in the south alone they go together.
    let (north, south) = (at(0, 20), at(18, 20));
    assert!(maps[0][south] > 0.5 && maps[0][north].abs() < 0.4);
    assert!(maps[1][south] < 1e-3, "{}", maps[1][south]);
    // What is withheld says how little there is: 54 months less one, of which two pairs are left.
    assert!(maps[0][at(9, TWO)].is_nan());
    assert!((maps[2][at(9, TWO)] - 2.0).abs() < 1e-6);
    assert!(maps[2][at(9, LAND)].is_nan() && maps[0][at(9, EQUAL)].is_nan());
    // What is never there at the same time is there a month later.
    assert!(!maps[0][at(9, NONE)].is_nan());
}

#[tokio::test(flavor = "multi_thread")]
async fn parts_memory_regions_and_company_change_no_bit() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let correlation = with(1, true);
    let of = |name: &str| all(name, TimeStep::Month, &correlation);
    let expected = derived(&engine, &of("roomy")).await.unwrap();
    let expected = maps(&store, &expected).await;
    // A block at a time: it holds 118 steps of both.
    for (count, bytes) in [(1, 1 << 30), (5, 160 << 10)] {
        let engine = Engine::in_process(store.clone(), parts(count)).with_memory_bytes(bytes);
        let made = derived(&engine, &of(&format!("of-{count}"))).await.unwrap();
        assert!(is_same(&maps(&store, &made).await, &expected), "{count}");
    }
    let tiny = engine.clone().with_memory_bytes(32 << 10);
    let refused = derived(&tiny, &of("tiny")).await.unwrap_err();
    assert!(refused.to_string().contains("--memory-mib"), "{refused}");
    // Among others, of which one has another lag and one no second product.
    let mut options = of("among");
    options.insert(1, MapOptions::new(MapStatistic::Trend));
    options.insert(
        3,
        MapOptions {
            name: Some(product("other")),
            ..MapOptions::of_two(CorrelationStatistic::Coefficient, with(0, true))
        },
    );
    let mut made = derived(&engine, &options).await.unwrap();
    let other = made.remove(3);
    let trend = made.remove(1).computed.unwrap();
    assert_eq!(trend.inputs.len(), 1, "it is of one product");
    assert!(is_same(&maps(&store, &made).await, &expected));
    assert!(!is_same(&maps(&store, &[other]).await, &expected[..1]));
    // Of a region its cells alone: one whose middle lies outside too.
    let mut options = of("inside");
    for one in &mut options {
        one.region = Some("-22.7,29.5,-20.2,31.4".parse().unwrap());
    }
    let made = derived(&engine, &options).await.unwrap();
    for (map, whole) in maps(&store, &made).await.iter().zip(&expected) {
        for cell in 0..GRID.cell_count() {
            let is_inside = (8..=10).contains(&(cell / 37)) && (7..=9).contains(&(cell % 37));
            let right = if is_inside { whole[cell] } else { f32::NAN };
            assert_eq!(map[cell].to_bits(), right.to_bits(), "{cell}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn it_is_up_to_date_while_both_products_are_and_asked_for_once_follows_neither() {
    let (_folder, store) = folder_store();
    let [a, b] = landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let options = [MapOptions {
        once: true,
        ..MapOptions::of_two(
            CorrelationStatistic::Coefficient,
            MapCorrelation::new(product("wind")),
        )
    }];
    let made = derived(&engine, &options).await.unwrap().remove(0);
    let again = derived(&engine, &options).await.unwrap().remove(0);
    assert_eq!(again, made);
    // The second product changes: nothing is made of it until somebody asks.
    let changed = |time: u32, cell: usize| {
        let more = if time == 30 { 4.0 } else { 0.0 };
        wind(time, cell) + more
    };
    let newer = steps(6..66, changed);
    let newer = land(&store, &product("wind"), Quantity::WindSpeed, GRID, &newer).await;
    assert!(follow(&engine, &product("wind")).await.unwrap().is_empty());
    assert!(follow(&engine, &product("sst")).await.unwrap().is_empty());
    let kept = Kept::read(&store, 1, i64::MAX).await.unwrap();
    let is_kept = |manifest: &Manifest| kept.manifests.iter().any(|own| own.id() == manifest.id());
    assert!(
        is_kept(&a) && is_kept(&b) && is_kept(&newer),
        "clean-up would take what it is of"
    );
    let anew = derived(&engine, &options).await.unwrap().remove(0);
    assert_eq!(anew.number, 2);
    let of = |manifest: &Manifest| {
        let inputs = &manifest.computed.as_ref().unwrap().inputs;
        inputs
            .iter()
            .map(|it| it.manifest.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(of(&anew), [a.id(), newer.id()]);
    assert!(!is_same(
        &maps(&store, std::slice::from_ref(&anew)).await,
        &maps(&store, &[made]).await
    ));
    // And the first.
    let quantity = Quantity::SeaSurfaceTemperature;
    let first = land(&store, &product("sst"), quantity, GRID, &steps(0..66, sst)).await;
    let third = derived(&engine, &options).await.unwrap().remove(0);
    assert_eq!(
        (third.number, of(&third)),
        (3, vec![first.id(), newer.id()])
    );
    assert_eq!(derived(&engine, &options).await.unwrap().remove(0), third);
    // Other options under the same name are another version.
    let lagged = [MapOptions {
        correlation: Some(with(2, false)),
        ..options[0].clone()
    }];
    assert_eq!(derived(&engine, &lagged).await.unwrap()[0].number, 4);
}

#[tokio::test(flavor = "multi_thread")]
#[expect(clippy::too_many_lines, reason = "a list of cases")]
async fn what_cannot_be_correlated_is_refused_with_the_reason() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let coarse = Grid {
        rows: 10,
        dlat_deg: 1.9,
        ..GRID
    };
    let values = vec![5.0; coarse.cell_count()];
    let one = [(month(0), values)];
    land(
        &store,
        &product("coarse"),
        Quantity::WindSpeed,
        coarse,
        &one,
    )
    .await;
    for (name, times) in [("later", 70..80), ("few", 58..70)] {
        let steps = steps(times, wind);
        land(&store, &product(name), Quantity::WindSpeed, GRID, &steps).await;
    }
    let equal = steps(0..60, |_, _| 7.3);
    land(&store, &product("equal"), Quantity::WindSpeed, GRID, &equal).await;
    let engine = Engine::in_process(store.clone(), parts(1));
    let of = |name: &str| {
        MapOptions::of_two(
            CorrelationStatistic::Coefficient,
            MapCorrelation::new(product(name)),
        )
    };
    let lagged = |lag| MapOptions::of_two(CorrelationStatistic::Coefficient, with(lag, false));
    let alone = MapOptions {
        correlation: None,
        ..of("wind")
    };
    let crowd = MapOptions {
        correlation: Some(with(0, false)),
        ..MapOptions::new(MapStatistic::Mean)
    };
    let in_step = |step| MapOptions { step, ..of("wind") };
    for (options, reason) in [
        (
            vec![of("coarse")],
            "fluxglobe derive regrid --product coarse --like sst",
        ),
        (
            vec![of("later")],
            "no step is common to both: sst covers 2001",
        ),
        (vec![of("few")], "sst and few have 2"),
        (vec![lagged(52)], "nearer to 0"),
        (vec![lagged(-401)], "0 to 400"),
        (vec![of("equal")], "three pairs of values that vary"),
        (vec![of("wind"), of("wind")], "one product"),
        (vec![of("wind"), of("few")], "with one product"),
        (vec![alone], "--with"),
        (vec![crowd], "not of two"),
        (vec![in_step(TimeStep::Total)], "does not vary"),
        (vec![in_step(TimeStep::Day)], "the steps of sst are longer"),
    ] {
        let refused = derived(&engine, &options).await.unwrap_err();
        assert!(refused.to_string().contains(reason), "{refused}");
        assert_eq!(refused.class(), ErrorClass::BadRequest, "{refused}");
    }
    let unknown = derived(&engine, &[of("nobody")]).await.unwrap_err();
    assert!(matches!(unknown, ComputeError::UnknownProduct { .. }));
    assert!(
        store
            .list("frames/sst-correlation-wind")
            .await
            .unwrap()
            .is_empty()
    );
    // A name that is taken by something else, either way.
    derived(&engine, &[of("wind")]).await.unwrap();
    let named = |name: &str, options: MapOptions| MapOptions {
        name: Some(product(name)),
        ..options
    };
    derived(
        &engine,
        &[named("spread", MapOptions::new(MapStatistic::Spread))],
    )
    .await
    .unwrap();
    for (options, reason) in [
        (named("spread", of("wind")), "no statistic of sst and wind"),
        (
            named("sst-correlation-wind", MapOptions::new(MapStatistic::Mean)),
            "no statistic of sst:",
        ),
    ] {
        let refused = derived(&engine, &[options]).await.unwrap_err();
        assert!(refused.to_string().contains(reason), "{refused}");
    }
    let request = Request {
        target: product("sst-correlation-wind"),
        title: None,
        quantity: Some(Quantity::WindSpeed),
        how: Computation::Expression {
            expression: "wind".to_owned(),
        },
        grid: None,
        inputs: vec![RequestedInput {
            name: "wind".to_owned(),
            product: product("wind"),
            matching: Matching::SamePeriod,
        }],
        from: None,
        to: None,
    };
    let refused = compute(&engine, &request, &|_| ()).await.unwrap_err();
    assert!(
        refused.to_string().contains("was not computed"),
        "{refused}"
    );
}

/// As the series of a product with itself: it is itself at the same time, and how it goes together with itself later.
#[tokio::test(flavor = "multi_thread")]
async fn a_product_with_itself_is_itself_and_later_what_its_series_say() {
    let (_folder, store) = folder_store();
    let [a, _] = landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let itself = |lag_steps| MapCorrelation {
        lag_steps,
        ..MapCorrelation::new(product("sst"))
    };
    for (name, lag) in [("now", 0), ("later", 6)] {
        let options = all(name, TimeStep::Month, &itself(lag));
        let made = derived(&engine, &options).await.unwrap();
        let maps = maps(&store, &made).await;
        let cell = at(4, 20);
        let row = of_cell(&engine, [&a, &a], cell, (TimeStep::Month, &itself(lag))).await;
        let right = row.correlation.unwrap();
        assert_eq!(maps[0][cell].to_bits(), (right as f32).to_bits());
        assert!(if lag == 0 {
            right > 1.0 - 1e-12
        } else {
            right < 0.0
        });
    }
}
