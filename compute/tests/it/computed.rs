//! Products computed from others: the values of the formula in every cell, the same bits however the work is cut, and what
//! is refused.

use compute::analysis::analyse;
use compute::computed::{Outcome, Request, RequestedInput, compute};
use compute::reduce::statistics;
use compute::{ComputeError, Engine, ErrorClass, point_series};
use contract::analysis::{AnalysisOptions, AnalysisPart, SeriesQuery};
use contract::computed::{Computation, Matching, Regridding};
use contract::earth::Earth;
use contract::grid::{Grid, LonLatDeg};
use contract::manifest::Manifest;
use contract::quantity::{Flag, OpenQuantity, OpenWords, Quantity};
use contract::statistics::StatisticsQuery;
use contract::time::{Period, TimeStep};
use storage::{Store, domain, fields, manifests};

use crate::fixture::{ONE_DEGREE, folder_store, land, months, parts, product, wavy_year};

/// A tenth of the earth's cells, so that many ways to cut the work take little time.
pub(crate) const FOUR_DEGREES: Grid = Grid {
    rows: 45,
    cols: 90,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 4.0,
    dlon_deg: 4.0,
};

/// Temperature, wind and ice of a year, each with gaps of its own.
pub(crate) async fn land_inputs(store: &Store) {
    let flux = wavy_year(&FOUR_DEGREES);
    let from_flux = |of: fn(f64) -> f64| -> Vec<(Period, Vec<f32>)> {
        let steps = flux.iter();
        steps
            .map(|(period, values)| {
                let value = |value: &f32| of(f64::from(*value) * 1e9) as f32;
                (*period, values.iter().map(value).collect())
            })
            .collect()
    };
    let kelvin = from_flux(|x| 285.0 + 8.0 * x);
    land(
        store,
        &product("sst"),
        Quantity::SeaSurfaceTemperature,
        FOUR_DEGREES,
        &kelvin,
    )
    .await;
    let mut wind = from_flux(|x| 7.0 + 3.0 * x);
    for (month, (_, values)) in wind.iter_mut().enumerate() {
        values
            .iter_mut()
            .skip(month)
            .step_by(23)
            .for_each(|value| *value = f32::NAN);
    }
    land(
        store,
        &product("wind"),
        Quantity::WindSpeed,
        FOUR_DEGREES,
        &wind,
    )
    .await;
    let ice = from_flux(|x| (0.3 * x).clamp(0.0, 1.0));
    land(
        store,
        &product("ice"),
        Quantity::IceFraction,
        FOUR_DEGREES,
        &ice[..10],
    )
    .await;
}

/// Wind's square root of the second moment over open water, by a formula that uses much of the language.
pub(crate) fn windy() -> Request {
    let expression = "CASE WHEN ice > 0.2 THEN 0.5 ELSE 1 - ice END \
        * gas_transfer_wanninkhof2014(power(wind, 2) * 4 / 3, schmidt_wanninkhof2014(sst)) * unit(10000, '1')";
    asked(expression, &["sst", "wind", "ice"])
}

fn asked(expression: &str, inputs: &[&str]) -> Request {
    let input = |name: &&str| RequestedInput {
        name: (*name).to_owned(),
        product: product(name),
        matching: Matching::SamePeriod,
    };
    Request {
        target: product("windy"),
        title: None,
        quantity: Some(Quantity::WindSpeed),
        how: Computation::Expression {
            expression: expression.to_owned(),
        },
        grid: None,
        inputs: inputs.iter().map(input).collect(),
        from: None,
        to: None,
    }
}

/// What the values of a mask are.
fn surface() -> Quantity {
    let flag = |value, meaning: &str| Flag {
        value,
        meaning: meaning.to_owned(),
    };
    let words = OpenWords {
        name: "surface".to_owned(),
        unit: "1".to_owned(),
        title: "Surface".to_owned(),
        range: None,
        flags: vec![flag(0, "sea"), flag(1, "coast"), flag(2, "land")],
        is_standard_name: false,
    };
    Quantity::Open(OpenQuantity::new(words).unwrap())
}

async fn computed(engine: &Engine, request: &Request) -> Outcome {
    compute(engine, request, &|_| ()).await.unwrap()
}

async fn values(store: &Store, manifest: &Manifest, step: usize) -> Vec<f32> {
    let field = &manifest.steps[step].field;
    fields::read(store, field, &manifest.grid).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_cell_holds_the_formula_of_its_inputs_and_the_product_says_where_it_is_from() {
    let (_folder, store) = folder_store();
    land_inputs(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let outcome = computed(&engine, &windy()).await;
    let manifest = &outcome.manifest;
    assert_eq!(
        (manifest.number, manifest.steps.len(), outcome.left_out),
        (1, 10, 2)
    );
    let inputs = ["sst", "wind", "ice"].map(product);
    let mut of = vec![];
    for input in &inputs {
        of.push(manifests::latest(&store, input).await.unwrap().unwrap());
    }
    let mut cells = vec![false; FOUR_DEGREES.cell_count()];
    let mut counted = [0, 0];
    for step in 0..10 {
        let [sst, wind, ice] = [0, 1, 2].map(|at| values(&store, &of[at], step));
        let (sst, wind, ice) = (sst.await, wind.await, ice.await);
        let found = values(&store, manifest, step).await;
        for (cell, &found) in found.iter().enumerate() {
            let (t, u, share) = (
                f64::from(sst[cell]),
                f64::from(wind[cell]),
                f64::from(ice[cell]),
            );
            let k = compute::air_sea::gas_transfer::wanninkhof2014(
                u * u * 4.0 / 3.0,
                compute::air_sea::schmidt::wanninkhof2014(t),
            );
            let by_hand = if share > 0.2 { 0.5 } else { 1.0 - share } * k * 1e4;
            if [t, u, share].iter().any(|it| it.is_nan()) {
                assert!(found.is_nan());
                counted[0] += 1;
            } else {
                assert!(
                    (f64::from(found) / by_hand - 1.0).abs() < 1e-6,
                    "{found} {by_hand}"
                );
                cells[cell] = true;
                counted[1] += 1;
            }
        }
        assert_eq!(
            manifest.steps[step].valid_cells,
            found.iter().filter(|it| !it.is_nan()).count() as u64
        );
    }
    assert!(counted[0] > 1000 && counted[1] > 1000, "{counted:?}");
    assert_eq!(domain::read(&store, &manifest.domain).await.unwrap(), cells);
    let how = manifest.computed.as_ref().unwrap();
    assert_eq!(how.how, windy().how);
    assert_eq!(how.inputs[1].manifest, of[1].id());
    assert_eq!(manifest.derived_from, Some(of[0].id()));
    assert!(
        manifest.source.contains("wind = wind@1-"),
        "{}",
        manifest.source
    );
    assert!(
        manifest.synthetic,
        "what is made of synthetic products is synthetic"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn however_the_work_is_cut_and_whoever_does_it_the_bits_are_the_same() {
    let (_folder, store) = folder_store();
    land_inputs(&store).await;
    let expected = computed(&Engine::local(store), &windy()).await.manifest;
    for count in [1, 3, 7] {
        let (_folder, store) = folder_store();
        land_inputs(&store).await;
        let engine = Engine::standalone(store, parts(count));
        assert_eq!(
            computed(&engine, &windy()).await.manifest,
            expected,
            "{count} parts"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn asked_again_it_is_there_and_after_a_revision_the_other_steps_are_kept() {
    let (_folder, store) = folder_store();
    land_inputs(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let first = computed(&engine, &windy()).await;
    let again = computed(&engine, &windy()).await;
    assert_eq!((&again.manifest, again.kept_count), (&first.manifest, 10));
    let mut steps = vec![];
    let wind = manifests::latest(&store, &product("wind"))
        .await
        .unwrap()
        .unwrap();
    for (index, step) in wind.steps.iter().enumerate() {
        let mut values = values(&store, &wind, index).await;
        if index == 4 {
            for value in &mut values {
                *value += 1.0;
            }
        }
        steps.push((step.period, values));
    }
    land(
        &store,
        &product("wind"),
        Quantity::WindSpeed,
        FOUR_DEGREES,
        &steps,
    )
    .await;
    let later = computed(&engine, &windy()).await;
    assert_eq!((later.manifest.number, later.kept_count), (2, 9));
    let (_folder, other) = folder_store();
    land_inputs(&other).await;
    land(
        &other,
        &product("wind"),
        Quantity::WindSpeed,
        FOUR_DEGREES,
        &steps,
    )
    .await;
    let anew = computed(&Engine::local(other), &windy()).await.manifest;
    assert_eq!(Manifest { number: 2, ..anew }, later.manifest);
    // Another formula keeps nothing.
    let other = Request {
        how: Computation::Expression {
            expression: "wind + 0 * ice * wind + 0 * sst / unit(1, 's') * unit(0, 'm K-1')".into(),
        },
        ..windy()
    };
    assert_eq!(computed(&engine, &other).await.kept_count, 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_makes_no_sense_is_refused_before_anything_is_stored() {
    let (_folder, store) = folder_store();
    land_inputs(&store).await;
    let coarse = Grid {
        rows: 9,
        cols: 18,
        dlat_deg: 20.0,
        dlon_deg: 20.0,
        ..FOUR_DEGREES
    };
    let year = wavy_year(&coarse);
    land(
        &store,
        &product("coarse"),
        Quantity::WindSpeed,
        coarse,
        &year,
    )
    .await;
    let engine = Engine::in_process(store.clone(), parts(1));
    let itself = Request {
        inputs: vec![RequestedInput {
            name: "a".into(),
            product: product("windy"),
            matching: Matching::SamePeriod,
        }],
        ..windy()
    };
    let cases = [
        (
            asked("wind + sst", &["wind", "sst"]),
            "one is in m s-1, the other in K",
        ),
        (asked("wind * wind", &["wind"]), "m2 s-2, but wind_speed is"),
        (
            asked("wind + coarse", &["wind", "coarse"]),
            "fluxglobe derive regrid --product coarse --like wind",
        ),
        (asked("wind", &["wind", "wind"]), "two inputs have the name"),
        (asked("wind", &[]), "names no product"),
        (asked("gust", &["wind"]), "gust"),
        (itself, "cannot be computed from itself"),
        (
            Request {
                target: product("sst"),
                ..asked("wind", &["wind"])
            },
            "was not computed",
        ),
        (
            Request {
                from: Some("2031".parse().unwrap()),
                ..windy()
            },
            "2000",
        ),
    ];
    for (request, reason) in cases {
        let error = compute(&engine, &request, &|_| ()).await.unwrap_err();
        assert_eq!(error.class(), ErrorClass::BadRequest, "{error:?}");
        assert!(error.to_string().contains(reason), "{error}");
    }
    assert!(store.list("frames/windy").await.unwrap().is_empty());
    let nobody = asked("nobody", &["nobody"]);
    let error = compute(&engine, &nobody, &|_| ()).await.unwrap_err();
    assert!(
        matches!(error, ComputeError::UnknownProduct { .. }),
        "{error}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_brought_to_another_grid_holds_what_its_source_holds_now_and_keeps_its_steps() {
    let (_folder, store) = folder_store();
    let engine = Engine::in_process(store.clone(), parts(2));
    let year = wavy_year(&ONE_DEGREE);
    let plain = Quantity::open("uptake", "1", "Uptake").unwrap();
    let [narrow, wide] = [[0.0, 1.0], [-5.0, 9.0]].map(|range| plain.over(range).unwrap());
    let source = product("source");
    land(&store, &source, narrow, ONE_DEGREE, &year[..10]).await;
    let request = Request {
        target: product("coarse"),
        quantity: None,
        how: Computation::Regrid {
            method: Regridding::Nearest,
            min_coverage: 0.5,
        },
        grid: Some(FOUR_DEGREES),
        ..asked("", &["source"])
    };
    let first = computed(&engine, &request).await.manifest;
    assert_eq!(first.quantity, narrow);
    // The range of a quantity grows with what lands.
    land(&store, &source, wide, ONE_DEGREE, &year).await;
    let outcome = computed(&engine, &request).await;
    let second = &outcome.manifest;
    assert_eq!((second.number, second.quantity), (2, wide));
    assert_eq!((outcome.kept_count, second.steps.len()), (10, 12));
    assert_eq!(second.steps[..10], first.steps);
    // It was taken for something else, and its files are read anew.
    land(&store, &source, Quantity::IceFraction, ONE_DEGREE, &year).await;
    let made = compute::dependents::follow(&engine, &source).await.unwrap();
    assert_eq!(made.len(), 1);
    assert_eq!(made[0].quantity, Quantity::IceFraction);
    assert_eq!(made[0].number, 3);
}

/// Between sea (0) and land (2) there is no coast (1).
#[tokio::test(flavor = "multi_thread")]
async fn codes_are_brought_to_another_grid_by_the_nearest_alone() {
    let (_folder, store) = folder_store();
    land_inputs(&store).await;
    let surface = surface();
    let coarse = Grid {
        rows: 9,
        cols: 18,
        dlat_deg: 20.0,
        dlon_deg: 20.0,
        ..FOUR_DEGREES
    };
    let codes: Vec<f32> = (0..coarse.cell_count())
        .map(|it| (it % 2 * 2) as f32)
        .collect();
    let year = [(Period::year(2000).unwrap(), codes)];
    land(&store, &product("mask"), surface, coarse, &year).await;
    let engine = Engine::in_process(store.clone(), parts(1));
    let request = |method| Request {
        target: product("mask-fine"),
        quantity: None,
        how: Computation::Regrid {
            method,
            min_coverage: 0.5,
        },
        grid: Some(FOUR_DEGREES),
        ..asked("", &["mask"])
    };
    for method in [Regridding::Bilinear, Regridding::Conservative] {
        let error = compute(&engine, &request(method), &|_| ()).await;
        let error = error.unwrap_err();
        assert_eq!(error.class(), ErrorClass::BadRequest, "{error:?}");
        assert!(error.to_string().contains("--method nearest"), "{error}");
    }
    let mask = computed(&engine, &request(Regridding::Nearest)).await;
    assert_eq!(mask.manifest.quantity, surface);
    let there = values(&store, &mask.manifest, 0).await;
    assert!(there.iter().all(|code| [0.0, 2.0].contains(code)));
    // What is advised where grids differ is what is done.
    let mixed = asked("wind * mask", &["wind", "mask"]);
    let error = compute(&engine, &mixed, &|_| ()).await.unwrap_err();
    let advice = "fluxglobe derive regrid --product mask --like wind --method nearest";
    assert!(error.to_string().contains(advice), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn codes_are_compared_in_expressions_and_neither_computed_with_nor_averaged() {
    let (_folder, store) = folder_store();
    let codes: Vec<f32> = (0..FOUR_DEGREES.cell_count())
        .map(|cell| (cell % 3) as f32)
        .collect();
    let year = [(Period::year(2000).unwrap(), codes)];
    land(&store, &product("mask"), surface(), FOUR_DEGREES, &year).await;
    let engine = Engine::in_process(store.clone(), parts(1));
    let request = |expression| Request {
        target: product("share"),
        quantity: Some(Quantity::open("share", "1", "Share").unwrap()),
        ..asked(expression, &["mask"])
    };
    for expression in [
        "mask + 0",
        "mask * 1",
        "2 * coalesce(mask, 0)",
        "CASE WHEN mask > 0 THEN mask ELSE 0 END",
    ] {
        let error = compute(&engine, &request(expression), &|_| ()).await;
        let error = error.unwrap_err();
        assert_eq!(error.class(), ErrorClass::BadRequest, "{error:?}");
        let told = "mask holds codes";
        assert!(error.to_string().contains(told), "{expression}: {error}");
    }
    let compared = request("CASE WHEN mask = 1 OR mask = 2 THEN 1 ELSE 0 END");
    let share = computed(&engine, &compared).await.manifest;
    let found = values(&store, &share, 0).await;
    let is_one: Vec<bool> = found[..3].iter().map(|share| *share > 0.5).collect();
    assert_eq!(is_one, [false, true, true]);
    let over = |of: &str, statistic: &str| StatisticsQuery {
        product: product(of),
        ..crate::statistics::asked(
            crate::statistics::area("-60,-20,60,20"),
            statistic,
            TimeStep::Native,
        )
    };
    let found = statistics(&engine, &over("mask", "min,max")).await;
    let found = &found.unwrap().rows[0].values;
    assert_eq!([found["min"], found["max"]], [Some(0.0), Some(2.0)]);
    let found = statistics(&engine, &over("share", "mean")).await.unwrap();
    let found = found.rows[0].values["mean"].unwrap();
    assert!((0.5..0.8).contains(&found), "{found}");
    let error = statistics(&engine, &over("mask", "mean")).await;
    let error = error.unwrap_err().to_string();
    assert!(error.contains("it holds codes"), "{error}");
    let mask = manifests::latest(&store, &product("mask")).await;
    let mask = mask.unwrap().unwrap();
    let at = SeriesQuery::Cell {
        product: product("mask"),
        place: LonLatDeg::new(5.0, 5.0).unwrap(),
        from: None,
        to: None,
    };
    let options = AnalysisOptions::new(AnalysisPart::ALL.to_vec()).unwrap();
    let error = analyse(&engine, (&mask, &mask.id()), &at, &options).await;
    let error = error.unwrap_err().to_string();
    assert!(error.contains("it holds codes"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
#[expect(clippy::too_many_lines, reason = "one way from beginning to end")]
async fn a_product_brought_to_another_grid_keeps_its_integral_and_fits_in_an_expression() {
    let (_folder, store) = folder_store();
    let year = wavy_year(&ONE_DEGREE);
    let flux = Quantity::CarbonFlux;
    land(&store, &product("fine"), flux, ONE_DEGREE, &year).await;
    land_inputs(&store).await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let request = |method, min_coverage| Request {
        target: product(&format!("fine-{method}")),
        quantity: None,
        how: Computation::Regrid {
            method,
            min_coverage,
        },
        grid: Some(FOUR_DEGREES),
        inputs: vec![RequestedInput {
            name: "source".into(),
            product: product("fine"),
            matching: Matching::SamePeriod,
        }],
        ..windy()
    };
    let outcome = computed(&engine, &request(Regridding::Conservative, 0.0)).await;
    let manifest = &outcome.manifest;
    assert_eq!(
        (manifest.grid, manifest.quantity, manifest.steps.len()),
        (FOUR_DEGREES, flux, 12)
    );
    // What it is stands in its title, and not only what it is of.
    let source = manifests::latest(&store, &product("fine")).await;
    let own = ", regridded to 45 x 90 cells (conservative)";
    assert_eq!(manifest.title, source.unwrap().unwrap().title + own);
    // With its coverage the integral is that of the source, but for what f32 rounds.
    let regridder =
        compute::regrid::Regridder::new(&ONE_DEGREE, &FOUR_DEGREES, Regridding::Conservative);
    let coverage = regridder.apply(&year[3].1).unwrap().coverage;
    let area = |grid: &Grid, cell: usize| grid.cell_area_m2(cell as u32 / grid.cols, Earth::Wgs84);
    let sum = |grid: &Grid, values: &[f32], share: &dyn Fn(usize) -> f64| -> f64 {
        let cells = values
            .iter()
            .enumerate()
            .filter(|(_, value)| !value.is_nan());
        cells
            .map(|(cell, &value)| f64::from(value) * share(cell) * area(grid, cell))
            .sum()
    };
    let before = sum(&ONE_DEGREE, &year[3].1, &|_| 1.0);
    let after = sum(&FOUR_DEGREES, &values(&store, manifest, 3).await, &|cell| {
        coverage[cell]
    });
    assert!((after / before - 1.0).abs() < 1e-6, "{after} {before}");
    // Cells that are covered too little hold no data.
    let strict = computed(&engine, &request(Regridding::Conservative, 1.0))
        .await
        .manifest;
    let strict = values(&store, &strict, 3).await;
    let whole = coverage.iter().filter(|it| **it > 1.0 - 1e-9).count();
    assert_eq!(strict.iter().filter(|it| !it.is_nan()).count(), whole);
    assert!(whole > 10);
    for method in [Regridding::Nearest, Regridding::Bilinear] {
        let manifest = computed(&engine, &request(method, 0.5)).await.manifest;
        assert!(
            manifest.steps.iter().all(|step| step.valid_cells > 1000),
            "{method}"
        );
    }
    let both = Request {
        target: product("both"),
        quantity: Some(flux),
        ..asked("a * (1 - ice)", &["ice"])
    };
    let inputs = vec![
        RequestedInput {
            name: "a".into(),
            product: product("fine-conservative"),
            matching: Matching::SamePeriod,
        },
        both.inputs[0].clone(),
    ];
    let both = computed(&engine, &Request { inputs, ..both }).await;
    assert_eq!(both.manifest.steps.len(), 10);
    assert_eq!(
        months(2000)[..10].to_vec(),
        both.manifest
            .steps
            .iter()
            .map(|it| it.period)
            .collect::<Vec<_>>()
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_computed_follows_its_inputs_and_what_follows_it() {
    let (_folder, store) = folder_store();
    land_inputs(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let first = computed(&engine, &windy()).await.manifest;
    let twice = Request {
        target: product("twice"),
        to: Some("2000-07".parse().unwrap()),
        ..asked("2 * windy", &["windy"])
    };
    computed(&engine, &twice).await;
    // Nothing has changed: the same versions.
    let follow = |name: &'static str| {
        let engine = engine.clone();
        async move {
            compute::dependents::follow(&engine, &product(name))
                .await
                .unwrap()
        }
    };
    let numbers = |made: &[Manifest]| -> Vec<(String, u64, usize)> {
        made.iter()
            .map(|it| (it.product.to_string(), it.number, it.steps.len()))
            .collect()
    };
    let same = [("windy".to_owned(), 1, 10), ("twice".to_owned(), 1, 6)];
    assert_eq!(numbers(&follow("ice").await), same);
    assert_eq!(follow("twice").await, []);
    let ice = manifests::latest(&store, &product("ice"))
        .await
        .unwrap()
        .unwrap();
    let mut steps = vec![];
    for (index, step) in ice.steps.iter().enumerate() {
        steps.push((step.period, values(&store, &ice, index).await));
    }
    steps[2].1.iter_mut().for_each(|value| *value *= 0.5);
    land(
        &store,
        &product("ice"),
        Quantity::IceFraction,
        FOUR_DEGREES,
        &steps,
    )
    .await;
    let made = follow("ice").await;
    let later = [("windy".to_owned(), 2, 10), ("twice".to_owned(), 2, 6)];
    assert_eq!(numbers(&made), later);
    let differs: Vec<usize> = (0..10)
        .filter(|&index| made[0].steps[index].field != first.steps[index].field)
        .collect();
    assert_eq!(differs, [2]);
    let [windy, twice] = [0, 1].map(|at| values(&store, &made[at], 2));
    let (windy, twice) = (windy.await, twice.await);
    let pairs = windy.iter().zip(&twice).filter(|(one, _)| !one.is_nan());
    assert!(pairs.clone().count() > 500);
    assert!(
        pairs
            .into_iter()
            .all(|(one, two)| (2.0 * one - two).abs() <= f32::EPSILON * two.abs())
    );
}

/// No step holds data, so that the array along time has no chunk at all.
#[tokio::test(flavor = "multi_thread")]
async fn steps_without_data_are_answered_as_such() {
    let (_folder, store) = folder_store();
    land_inputs(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let made = computed(&engine, &asked("wind / 0", &["wind"]))
        .await
        .manifest;
    assert!(made.steps.iter().all(|step| step.valid_cells == 0));
    // Whoever publishes has it made behind.
    cube::compact(&store, "cubes/windy").await.unwrap();
    let values = cube::Values::of(&store, &std::sync::Arc::new(made.clone())).await;
    assert_eq!(values.unwrap().in_fields_count(), 0, "it is along time");
    let place = LonLatDeg::new(5.0, 5.0).unwrap();
    let found = point_series(&engine, &made.product, place).await.unwrap();
    assert_eq!(found.series.len(), made.steps.len());
    assert!(found.series.iter().all(|row| row.value.is_none()));
    let query = StatisticsQuery {
        product: made.product.clone(),
        ..crate::statistics::asked(
            crate::statistics::area("-40,-20,-10,10"),
            "mean,count",
            TimeStep::Native,
        )
    };
    let answer = statistics(&engine, &query).await.unwrap();
    for row in answer.rows {
        assert_eq!((row.values["mean"], row.values["count"]), (None, Some(0.0)));
    }
}
