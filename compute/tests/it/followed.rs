//! Statistics of every cell brought up to date when what they are of has a newer version.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use compute::computed::{Request, RequestedInput, compute};
use compute::dependents::{follow, follow_telling, mend, to_mend, why_it_stays};
use compute::derive::{DeriveProgress, derive_statistic, derive_statistics};
use compute::{Engine, derive_accumulated};
use contract::analysis::{BasePeriod, MapStatistic};
use contract::analysis::{CalendarBins, CorrelationStatistic, MapCorrelation, MapOptions};
use contract::computed::{Computation, Matching};
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::region::{AskedRegion, MAX_KEPT_CORNERS, Polygon, Region};
use contract::time::{Period, TimeStep};
use storage::{Store, manifests};

use crate::fixture::{folder_store, land, parts, product};

const GRID: Grid = Grid {
    rows: 9,
    cols: 17,
    north_deg: 40.0,
    west_deg: -30.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// Months from 2001 on: a season, noise, and a rise; land in one column.
fn months(count: u32, seed: u32) -> Vec<(Period, Vec<f32>)> {
    let value = |month: u32, cell: usize| {
        let mut mixed = (month * 613 + cell as u32 * 37 + seed).wrapping_mul(2_654_435_761);
        mixed = (mixed ^ (mixed >> 15)).wrapping_mul(2_246_822_519);
        let noise = (mixed >> 20) as f32 / 4096.0;
        let season = (month % 12) as f32 * 0.5;
        if cell % 17 == 4 {
            f32::NAN
        } else {
            3.0 + season + noise + month as f32 * 0.02
        }
    };
    let step = |month: u32| {
        let period = Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap();
        let cells = 0..GRID.cell_count();
        (period, cells.map(|cell| value(month, cell)).collect())
    };
    (0..count).map(step).collect()
}

async fn landed(store: &Store, name: &str, count: u32, seed: u32) -> Manifest {
    let steps = months(count, seed);
    land(store, &product(name), Quantity::WindSpeed, GRID, &steps).await
}

async fn latest(store: &Store, name: &str) -> Manifest {
    let latest = manifests::latest(store, &product(name)).await;
    latest.unwrap().unwrap()
}

/// What came of following, with the number of each version.
async fn followed(engine: &Engine, name: &str) -> Vec<(String, u64)> {
    let made = follow(engine, &product(name)).await.unwrap();
    let made = made.iter();
    made.map(|it| (it.product.to_string(), it.number)).collect()
}

fn named(name: &str, options: MapOptions) -> MapOptions {
    MapOptions {
        name: Some(product(name)),
        ..options
    }
}

/// Statistics that are asked for in as many ways as there are.
fn asked() -> Vec<MapOptions> {
    let of = MapOptions::new;
    let with = |lag_steps, deseasonalise| MapCorrelation {
        lag_steps,
        deseasonalise,
        ..MapCorrelation::new(product("other"))
    };
    let coefficient = CorrelationStatistic::Coefficient;
    vec![
        named("mean", of(MapStatistic::Mean)),
        named(
            "high",
            MapOptions {
                least_percent: 80,
                from: "2001-03".parse().ok(),
                to: "2009".parse().ok(),
                ..of("p97.5".parse().unwrap())
            },
        ),
        named(
            "trend",
            MapOptions {
                step: TimeStep::Season,
                ..of(MapStatistic::LeastSquaresTrend)
            },
        ),
        named(
            "anomaly",
            MapOptions {
                base: "2001/2002".parse().ok(),
                bins: CalendarBins::Season,
                ..of(MapStatistic::Anomaly)
            },
        ),
        named(
            "here",
            in_region("-27.3,34,-20.1,38", of(MapStatistic::Max)),
        ),
        named(
            "cropped",
            MapOptions {
                crop: true,
                ..in_region("-17,33,-14,38", of(MapStatistic::Max))
            },
        ),
        named(
            "polygon",
            in_region(
                "POLYGON((-29.1 33.3,-15.7 32.9,-20.2 39.6,-29.1 33.3))",
                of(MapStatistic::Spread),
            ),
        ),
        named("together", MapOptions::of_two(coefficient, with(0, false))),
        named(
            "later",
            MapOptions {
                step: TimeStep::Native,
                least_percent: 60,
                // Nothing of a correlation, but part of what was asked for.
                bins: CalendarBins::Season,
                ..in_region(
                    "-27.3,34,-20.1,38",
                    MapOptions::of_two(CorrelationStatistic::PValue, with(-2, true)),
                )
            },
        ),
    ]
}

fn in_region(text: &str, options: MapOptions) -> MapOptions {
    MapOptions {
        region: Some(text.parse().unwrap()),
        ..options
    }
}

async fn all_derived(engine: &Engine, options: &[MapOptions]) -> Vec<Manifest> {
    let mut made = vec![];
    for one in options {
        let derived = derive_statistic(engine, &product("sst"), one, &|_| ()).await;
        made.push(derived.unwrap());
    }
    made
}

/// The same request: what steps are made of names every option, the region, and the fields that were read.
#[tokio::test(flavor = "multi_thread")]
async fn statistics_follow_as_they_were_asked_for() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 72, 1).await;
    landed(&store, "other", 72, 2).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let before = all_derived(&engine, &asked()).await;
    // Nothing has changed.
    assert!(
        followed(&engine, "sst")
            .await
            .iter()
            .all(|(_, number)| *number == 1)
    );
    landed(&store, "sst", 80, 7).await;
    let made = follow(&engine, &product("sst")).await.unwrap();
    assert_eq!(made.len(), before.len());
    // What is derived from the same in a store that never held anything else.
    let (_folder, fresh) = folder_store();
    landed(&fresh, "sst", 80, 7).await;
    landed(&fresh, "other", 72, 2).await;
    let fresh = Engine::in_process(fresh, parts(1));
    let right = all_derived(&fresh, &asked()).await;
    for (right, before) in right.iter().zip(&before) {
        let own = made.iter().find(|it| it.product == right.product).unwrap();
        assert_eq!((own.number, &own.title), (2, &right.title));
        assert_eq!(own.steps, right.steps, "{}", own.product);
        assert_ne!(own.steps, before.steps, "{}", own.product);
        assert_eq!((own.quantity, own.grid), (right.quantity, right.grid));
        // Asked again as it was asked for, it is what it is.
        let asked = asked()
            .into_iter()
            .find(|it| it.name.as_ref() == Some(&own.product));
        let again = derive_statistic(&engine, &product("sst"), &asked.unwrap(), &|_| ()).await;
        assert_eq!(again.unwrap(), *own);
    }
    // Those of two follow the second too, and nothing else does.
    landed(&store, "other", 72, 5).await;
    let made = followed(&engine, "other").await;
    let both = [("later".to_owned(), 3), ("together".to_owned(), 3)];
    assert_eq!(made, both);
}

fn expression(target: &str, expression: &str, inputs: &[&str]) -> Request {
    let input = |name: &&str| RequestedInput {
        name: (*name).to_owned(),
        product: product(name),
        matching: Matching::SamePeriod,
    };
    Request {
        target: product(target),
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

async fn computed(engine: &Engine, request: &Request) -> Manifest {
    let outcome = compute(engine, request, &|_| ()).await;
    outcome.unwrap().manifest
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_of_what_follows_is_made_once_and_of_its_newest_version() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 60, 1).await;
    landed(&store, "other", 60, 2).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    computed(&engine, &expression("twice", "2 * sst", &["sst"])).await;
    // By their names the statistics would come before what they are of, and the sum before what it is the sum of.
    computed(
        &engine,
        &expression("sum", "sst + twice", &["sst", "twice"]),
    )
    .await;
    let both = named(
        "both",
        MapOptions::of_two(
            CorrelationStatistic::Coefficient,
            MapCorrelation::new(product("sum")),
        ),
    );
    derive_statistic(&engine, &product("sst"), &both, &|_| ())
        .await
        .unwrap();
    let anomaly = named("anomaly", MapOptions::new(MapStatistic::Anomaly));
    derive_statistic(&engine, &product("sum"), &anomaly, &|_| ())
        .await
        .unwrap();
    let spread = named("all-spread", MapOptions::new(MapStatistic::Spread));
    derive_statistic(&engine, &product("anomaly"), &spread, &|_| ())
        .await
        .unwrap();
    let sst = landed(&store, "sst", 66, 3).await;
    let made = follow(&engine, &product("sst")).await.unwrap();
    let names: Vec<_> = made
        .iter()
        .map(|it| (it.product.as_str(), it.number))
        .collect();
    let expected = [
        ("twice", 2),
        ("sum", 2),
        ("anomaly", 2),
        ("all-spread", 2),
        ("both", 2),
    ];
    assert_eq!(names, expected);
    let of = |manifest: &Manifest| -> Vec<_> {
        let inputs = manifest.computed.iter().flat_map(|it| &it.inputs);
        inputs.map(|it| it.manifest.clone()).collect()
    };
    assert_eq!(of(&made[1]), [sst.id(), made[0].id()]);
    assert_eq!(of(&made[4]), [sst.id(), made[1].id()]);
    assert_eq!(of(&made[3]), [made[2].id()]);
    // What follows a product in the middle is what is of that alone.
    let middle: Vec<_> = followed(&engine, "anomaly").await;
    assert_eq!(middle, [("all-spread".to_owned(), 2)]);
}

#[tokio::test(flavor = "multi_thread")]
async fn of_several_statistics_none_is_made_where_one_cannot_be() {
    let (_folder, store) = folder_store();
    // No cell holds data all the time.
    let mut steps = months(24, 1);
    steps.remove(7);
    land(&store, &product("sst"), Quantity::WindSpeed, GRID, &steps).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let all_the_time = MapOptions {
        least_percent: 100,
        ..MapOptions::new(MapStatistic::Mean)
    };
    let asked = [
        named("count", MapOptions::new(MapStatistic::Count)),
        named("mean", all_the_time),
    ];
    let refused = derive_statistics(&engine, &product("sst"), &asked, &|_| ()).await;
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("no cell holds data"), "{refused}");
    let count = manifests::latest(&store, &product("count")).await;
    assert_eq!(count.unwrap(), None);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_damaged_or_gone_of_what_was_computed_is_made_again_under_its_name() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 12, 1).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let request = expression("twice", "2 * sst", &["sst"]);
    let twice = computed(&engine, &request).await;
    let options = named("mean", MapOptions::new(MapStatistic::Mean));
    let mean = all_derived(&engine, std::slice::from_ref(&options)).await;
    for made in [&twice, &mean[0]] {
        for key in [&made.steps[0].field, &made.domain] {
            let whole = store.get(key).await.unwrap();
            let mut flipped = whole.to_vec();
            flipped[whole.len() / 2] ^= 2;
            store.put_over(key, flipped.into()).await.unwrap();
            let found = to_mend(&store, &made.product).await.unwrap();
            assert!(found.iter().eq([key]), "{found:?}");
            let mended = mend(&engine, &made.product).await.unwrap();
            assert_eq!(mended.as_ref(), Some(made), "{key}");
            assert_eq!(store.get(key).await.unwrap(), whole);
            // Who asks for it again finds what is gone, too.
            store.remove(key).await.unwrap();
            let again = if made.product == twice.product {
                computed(&engine, &request).await
            } else {
                let mut again = all_derived(&engine, std::slice::from_ref(&options)).await;
                again.remove(0)
            };
            assert_eq!(again, *made, "{key}");
            assert_eq!(store.get(key).await.unwrap(), whole);
        }
        assert_eq!(mend(&engine, &made.product).await.unwrap(), None);
    }
    // What cannot be made again stays as it is.
    let flux = land(
        &store,
        &product("old"),
        Quantity::WindSpeed,
        GRID,
        &months(1, 1),
    )
    .await;
    let old = Manifest {
        number: flux.number + 1,
        derived_from: Some(twice.id()),
        ..flux
    };
    manifests::commit(&store, &old).await.unwrap();
    let field = &old.steps[0].field;
    let mut flipped = store.get(field).await.unwrap().to_vec();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 2;
    store.put_over(field, flipped.into()).await.unwrap();
    let refused = mend(&engine, &old.product).await.unwrap_err().to_string();
    assert!(refused.contains("how it was made is not kept"), "{refused}");
    let found = to_mend(&store, &old.product).await.unwrap_err();
    assert_eq!(found.to_string(), refused);
    assert!(store.exists(field).await.unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flux_has_its_carbon_accumulated_and_statistics_of_that_follow() {
    let (_folder, store) = folder_store();
    let flux = |count: u32, seed| {
        let small = |(period, values): (Period, Vec<f32>)| {
            (period, values.iter().map(|value| value * 1e-9).collect())
        };
        months(count, seed)
            .into_iter()
            .map(small)
            .collect::<Vec<(Period, Vec<f32>)>>()
    };
    land(
        &store,
        &product("flux"),
        Quantity::CarbonFlux,
        GRID,
        &flux(12, 1),
    )
    .await;
    let engine = Engine::in_process(store.clone(), parts(2));
    derive_accumulated(&engine, &product("flux"), None, &|_| ())
        .await
        .unwrap();
    let most = named("most", MapOptions::new(MapStatistic::Max));
    derive_statistic(&engine, &product("flux-accumulated"), &most, &|_| ())
        .await
        .unwrap();
    // A mean flux is a flux too, but nothing is added up of it.
    let mean = named("mean", MapOptions::new(MapStatistic::Mean));
    let mean = derive_statistic(&engine, &product("flux"), &mean, &|_| ())
        .await
        .unwrap();
    assert_eq!(mean.quantity, Quantity::CarbonFlux);
    land(
        &store,
        &product("flux"),
        Quantity::CarbonFlux,
        GRID,
        &flux(14, 1),
    )
    .await;
    let made = followed(&engine, "flux").await;
    let expected = [("flux-accumulated", 2), ("mean", 2), ("most", 2)];
    assert_eq!(
        made,
        expected.map(|(name, number)| (name.to_owned(), number))
    );
}

/// As when files are read anew whose axes were taken for half a cell off.
#[tokio::test(flavor = "multi_thread")]
async fn an_expression_goes_where_its_inputs_went_and_stays_while_they_have_parted() {
    let (_folder, store) = folder_store();
    for name in ["sst", "other"] {
        landed(&store, name, 12, 1).await;
    }
    let engine = Engine::in_process(store.clone(), parts(2));
    computed(&engine, &expression("twice", "2 * sst", &["sst"])).await;
    let sum = expression("sum", "sst + other", &["sst", "other"]);
    computed(&engine, &sum).await;
    let moved = Grid {
        north_deg: GRID.north_deg - 0.5,
        west_deg: GRID.west_deg + 0.5,
        ..GRID
    };
    let land_moved = async |name: &str| {
        let (name, steps) = (product(name), months(12, 1));
        land(&store, &name, Quantity::WindSpeed, moved, &steps).await
    };
    let made = |name: &str| [(name.to_owned(), 2)];
    land_moved("sst").await;
    assert_eq!(followed(&engine, "sst").await, made("twice"));
    assert_eq!(latest(&store, "twice").await.grid, moved);
    let left = latest(&store, "sum").await;
    assert_eq!((left.number, left.grid), (1, GRID));
    land_moved("other").await;
    assert_eq!(followed(&engine, "other").await, made("sum"));
    assert_eq!(latest(&store, "sum").await.grid, moved);
    // Whoever asks for it gets the same; something else under its name is refused where grids differ.
    assert_eq!(computed(&engine, &sum).await.number, 2);
    landed(&store, "sst", 12, 1).await;
    let other = expression("twice", "3 * sst", &["sst"]);
    let refused = compute(&engine, &other, &|_| ()).await.unwrap_err();
    let refused = refused.to_string();
    assert!(refused.contains("on another grid"), "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_newer_version_of_the_same_steps_is_said_and_not_computed() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 60, 1).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let base: BasePeriod = "2001/2003".parse().unwrap();
    let options = [MapOptions {
        base: Some(base),
        ..MapOptions::new(MapStatistic::Climatology)
    }];
    let sst = product("sst");
    let first = derive_statistics(&engine, &sst, &options, &|_| ())
        .await
        .unwrap();
    let newer = landed(&store, "sst", 66, 1).await;
    let second = derive_statistics(&engine, &sst, &options, &|_| panic!("cells are computed"));
    let second = second.await.unwrap();
    assert_eq!((second[0].number, &second[0].steps), (2, &first[0].steps));
    assert_eq!(second[0].derived_from, Some(newer.id()));
    assert_eq!(second[0].domain, first[0].domain);
    assert_eq!(
        second[0].computed.as_ref().unwrap().inputs[0].manifest,
        newer.id()
    );
    assert_eq!(
        followed(&engine, "sst").await,
        [("sst-climatology".to_owned(), 2)]
    );
}

/// Brings up to date what is made of a product, while somebody asks for something as soon as its making has begun.
async fn followed_while<F: Future<Output = ()> + Send + 'static>(
    engine: &Engine,
    name: &str,
    asking: impl Fn() -> F + Send + Sync + 'static,
) -> Vec<(String, u64)> {
    let (has_begun, asking) = (AtomicBool::new(false), Arc::new(asking));
    let on_progress = |_: DeriveProgress| {
        if has_begun.swap(true, Ordering::Relaxed) {
            return;
        }
        let asking = Arc::clone(&asking);
        let other = std::thread::spawn(move || {
            let runtime = tokio::runtime::Runtime::new().unwrap();
            runtime.block_on(asking());
        });
        other.join().unwrap();
    };
    let made = follow_telling(engine, &product(name), &on_progress).await;
    assert!(has_begun.load(Ordering::Relaxed), "nothing was made");
    let made = made.unwrap().into_iter();
    made.map(|it| (it.product.to_string(), it.number)).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn what_somebody_asks_for_while_it_is_made_again_is_not_replaced() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 60, 1).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let mean = named("mean", MapOptions::new(MapStatistic::Mean));
    let max = named("max", MapOptions::new(MapStatistic::Max));
    all_derived(&engine, &[mean.clone(), max]).await;
    landed(&store, "sst", 66, 1).await;
    let later = MapOptions {
        from: "2003".parse().ok(),
        ..mean
    };
    let (asker, asked) = (engine.clone(), later.clone());
    let ask = move || {
        let (engine, options) = (asker.clone(), asked.clone());
        async move {
            derive_statistic(&engine, &product("sst"), &options, &|_| ())
                .await
                .unwrap();
        }
    };
    let mut made = followed_while(&engine, "sst", ask).await;
    made.sort();
    let expected = [("max", 2), ("mean", 2)];
    assert_eq!(made, expected.map(|(name, at)| (name.to_owned(), at)));
    let mean = latest(&store, "mean").await;
    assert_eq!(mean.computed.as_ref().unwrap().from, later.from);
    assert_eq!(mean.number, 2);

    // A map that is to stay stays, though its making again had begun.
    landed(&store, "sst", 72, 1).await;
    let once = MapOptions {
        once: true,
        ..later
    };
    let asker = engine.clone();
    let ask = move || {
        let (engine, options) = (asker.clone(), once.clone());
        async move {
            derive_statistic(&engine, &product("sst"), &options, &|_| ())
                .await
                .unwrap();
        }
    };
    let made = followed_while(&engine, "sst", ask).await;
    assert_eq!(made, [("max".to_owned(), 3)]);
    let mean = latest(&store, "mean").await;
    assert!(mean.computed.unwrap().map.unwrap().once);
    assert_eq!(mean.number, 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn carbon_is_accumulated_from_the_start_that_somebody_chooses_while_it_is_brought_up() {
    let (_folder, store) = folder_store();
    let flux = |count| {
        let steps = months(count, 1).into_iter();
        let small = |(period, values): (Period, Vec<f32>)| {
            let values = values.iter().map(|value| value * 1e-10).collect();
            (period, values)
        };
        steps.map(small).collect::<Vec<(Period, Vec<f32>)>>()
    };
    let name = product("flux");
    land(&store, &name, Quantity::CarbonFlux, GRID, &flux(12)).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    derive_accumulated(&engine, &name, None, &|_| ())
        .await
        .unwrap();
    land(&store, &name, Quantity::CarbonFlux, GRID, &flux(14)).await;
    let start = "2001-06".parse().ok();
    let asker = engine.clone();
    let ask = move || {
        let engine = asker.clone();
        async move {
            let of = product("flux");
            derive_accumulated(&engine, &of, start, &|_| ())
                .await
                .unwrap();
        }
    };
    let made = followed_while(&engine, "flux", ask).await;
    assert_eq!(made, [("flux-accumulated".to_owned(), 2)]);
    let newest = latest(&store, "flux-accumulated").await;
    assert_eq!(Some(newest.steps[0].period.start), start);
    assert_eq!(newest.steps.len(), 9);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_somebody_asks_for_is_made_of_what_came_meanwhile() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 60, 1).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let mean = named("mean", MapOptions::new(MapStatistic::Mean));
    all_derived(&engine, std::slice::from_ref(&mean)).await;
    let later = MapOptions {
        from: "2003".parse().ok(),
        ..mean
    };
    // While it is computed more lands, and what was asked for before is brought up.
    let has_begun = AtomicBool::new(false);
    let other = (engine.clone(), store.clone());
    let on_progress = |_: DeriveProgress| {
        if has_begun.swap(true, Ordering::Relaxed) {
            return;
        }
        let (engine, store) = other.clone();
        let landing = std::thread::spawn(move || {
            let runtime = tokio::runtime::Runtime::new().unwrap();
            runtime.block_on(async {
                landed(&store, "sst", 66, 1).await;
                let made = followed(&engine, "sst").await;
                assert_eq!(made, [("mean".to_owned(), 2)]);
            });
        });
        landing.join().unwrap();
    };
    let made = derive_statistic(&engine, &product("sst"), &later, &on_progress).await;
    let made = made.unwrap();
    assert_eq!(made, latest(&store, "mean").await);
    assert_eq!(made.computed.as_ref().unwrap().from, later.from);
    assert_eq!(made.derived_from, Some(latest(&store, "sst").await.id()));
    assert_eq!(made.number, 3);
}

/// Computes a product, while as soon as that has begun more lands and what is made of it is brought up.
async fn computed_while_more_lands(engine: &Engine, store: &Store, request: &Request) -> Manifest {
    let has_begun = AtomicBool::new(false);
    let (other, target) = ((engine.clone(), store.clone()), request.target.clone());
    let on_progress = |_: DeriveProgress| {
        if has_begun.swap(true, Ordering::Relaxed) {
            return;
        }
        let ((engine, store), target) = (other.clone(), target.to_string());
        let landing = std::thread::spawn(move || {
            let runtime = tokio::runtime::Runtime::new().unwrap();
            runtime.block_on(async {
                landed(&store, "sst", 14, 1).await;
                assert_eq!(followed(&engine, "sst").await, [(target, 2)]);
            });
        });
        landing.join().unwrap();
    };
    let outcome = compute(engine, request, &on_progress).await;
    assert!(has_begun.load(Ordering::Relaxed), "nothing was made");
    outcome.unwrap().manifest
}

/// As [`what_somebody_asks_for_is_made_of_what_came_meanwhile`], step by step.
#[tokio::test(flavor = "multi_thread")]
async fn an_expression_is_computed_of_what_came_meanwhile() {
    // Asked for otherwise it is made again; asked for as it is there, it is there.
    for (text, title, number) in [
        ("3 * sst", None, 3),
        ("2 * sst", Some("Of two"), 3),
        ("2 * sst", None, 2),
    ] {
        let (_folder, store) = folder_store();
        landed(&store, "sst", 12, 1).await;
        let engine = Engine::in_process(store.clone(), parts(2));
        computed(&engine, &expression("twice", "2 * sst", &["sst"])).await;
        landed(&store, "sst", 13, 1).await;
        let request = Request {
            title: title.map(str::to_owned),
            ..expression("twice", text, &["sst"])
        };
        let made = computed_while_more_lands(&engine, &store, &request).await;
        assert_eq!(made, latest(&store, "twice").await);
        assert_eq!((made.number, made.steps.len()), (number, 14), "{text}");
        assert!(title.is_none_or(|title| made.title == title));
        let computed = made.computed.unwrap();
        let sst = latest(&store, "sst").await.id();
        assert_eq!(computed.inputs[0].manifest, sst);
        assert_eq!(
            computed.how,
            Computation::Expression {
                expression: text.to_owned()
            }
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_expression_that_somebody_changes_while_it_is_computed_again_stays_changed() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 12, 1).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    computed(&engine, &expression("twice", "2 * sst", &["sst"])).await;
    landed(&store, "sst", 14, 1).await;
    let asker = engine.clone();
    let ask = move || {
        let engine = asker.clone();
        async move { _ = computed(&engine, &expression("twice", "3 * sst", &["sst"])).await }
    };
    let made = followed_while(&engine, "sst", ask).await;
    assert_eq!(made, [("twice".to_owned(), 2)]);
    let twice = latest(&store, "twice").await;
    let how = twice.computed.unwrap().how;
    assert!(
        matches!(&how, Computation::Expression { expression } if expression == "3 * sst"),
        "{how:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_of_another_product_that_cannot_be_read_stops_nothing() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 24, 1).await;
    let other = landed(&store, "other", 2, 1).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let mean = MapOptions::new(MapStatistic::Mean);
    derive_statistic(&engine, &product("sst"), &mean, &|_| ())
        .await
        .unwrap();
    let key = ObjectKey::manifest(&other.product, other.number);
    store.put_over(&key, "no manifest".into()).await.unwrap();
    landed(&store, "sst", 30, 1).await;
    let expected = [("sst-mean".to_owned(), 2)];
    assert_eq!(followed(&engine, "sst").await, expected);
}

/// A version as programs wrote it that did not keep how it was asked for.
async fn forget(store: &Store, name: &str) -> Manifest {
    let latest = latest(store, name).await;
    let mut old = Manifest {
        number: latest.number + 1,
        ..latest
    };
    let computed = old.computed.take();
    // Of correlations the versions and how were kept, and not the rest.
    old.computed = computed.filter(|it| it.inputs.len() > 1);
    if let Some(computed) = &mut old.computed {
        computed.map = None;
    }
    manifests::commit(store, &old).await.unwrap();
    old
}

#[tokio::test(flavor = "multi_thread")]
async fn what_does_not_follow_is_left_and_says_why() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 60, 1).await;
    landed(&store, "other", 60, 2).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let all = asked();
    let of = |name: &str| {
        let found = all.iter().find(|it| it.name == Some(product(name)));
        found.unwrap().clone()
    };
    let outer = (0..=MAX_KEPT_CORNERS).map(|corner| {
        let angle = std::f64::consts::TAU * corner as f64 / MAX_KEPT_CORNERS as f64;
        [-22.0 + 5.0 * angle.cos(), 36.0 + 3.0 * angle.sin()]
    });
    let round = AskedRegion {
        region: Region::Polygons(vec![Polygon {
            outer: outer.collect(),
            holes: vec![],
        }]),
        name: "round.geojson".to_owned(),
    };
    let large = MapOptions {
        region: Some(round),
        ..named("round", MapOptions::new(MapStatistic::Mean))
    };
    let once = MapOptions {
        once: true,
        ..named("once", MapOptions::new(MapStatistic::Mean))
    };
    let options = [of("mean"), of("trend"), of("together"), large, once];
    let mut made = all_derived(&engine, &options).await;
    assert_eq!(why_it_stays(&made[0]), None);
    made[0] = forget(&store, "mean").await;
    made[2] = forget(&store, "together").await;
    landed(&store, "sst", 66, 3).await;
    // One alone.
    assert_eq!(followed(&engine, "sst").await, [("trend".to_owned(), 2)]);
    for (manifest, why) in made.iter().zip([
        Some("was not kept"),
        None,
        Some("was not kept"),
        Some("too many corners"),
        None,
    ]) {
        let said = why_it_stays(manifest);
        let fits = match (&said, why) {
            (Some(said), Some(why)) => said.contains(why) && said.contains("sst"),
            (said, why) => said.is_none() && why.is_none(),
        };
        assert!(fits, "{}: {said:?}", manifest.product);
    }
    // Asked again, what was forgotten is kept, and follows; what was asked once no longer stays.
    all_derived(
        &engine,
        &[
            of("mean"),
            named("once", MapOptions::new(MapStatistic::Mean)),
        ],
    )
    .await;
    landed(&store, "sst", 67, 3).await;
    let names = [("mean", 4), ("once", 3), ("trend", 3)];
    let names = names.map(|(name, number)| (name.to_owned(), number));
    assert_eq!(followed(&engine, "sst").await, names);
}

/// One that cannot be made of what there is now holds up none of the others.
#[tokio::test(flavor = "multi_thread")]
async fn one_that_cannot_be_made_any_more_is_left_and_the_rest_made() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 72, 1).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let of = |name: &str, statistic| named(name, MapOptions::new(statistic));
    let options = [
        of("a-spread", MapStatistic::Spread),
        of("b-trend", MapStatistic::Trend),
        of("c-mean", MapStatistic::Mean),
    ];
    all_derived(&engine, &options).await;
    let of_trend = of("of-trend", MapStatistic::Mean);
    derive_statistic(&engine, &product("b-trend"), &of_trend, &|_| ())
        .await
        .unwrap();
    // A trend needs five years, a spread two steps.
    landed(&store, "sst", 1, 1).await;
    assert_eq!(followed(&engine, "sst").await, [("c-mean".to_owned(), 2)]);
    assert_eq!(latest(&store, "b-trend").await.number, 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_computed_of_what_was_made_of_it() {
    let (_folder, store) = folder_store();
    landed(&store, "sst", 60, 1).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    computed(&engine, &expression("twice", "2 * sst", &["sst"])).await;
    let normals = named("normals", MapOptions::new(MapStatistic::Climatology));
    derive_statistic(&engine, &product("twice"), &normals, &|_| ())
        .await
        .unwrap();
    let average = named("average", MapOptions::new(MapStatistic::Mean));
    derive_statistic(&engine, &product("normals"), &average, &|_| ())
        .await
        .unwrap();
    for of in ["normals", "average"] {
        let circle = expression("twice", &format!("2 * {of}"), &[of]);
        let refused = compute(&engine, &circle, &|_| ()).await.unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains("normals was made of it"), "{refused}");
    }
    let average: ProductId = product("average");
    let statistic = named("twice", MapOptions::new(MapStatistic::Mean));
    let refused = derive_statistic(&engine, &average, &statistic, &|_| ()).await;
    assert!(refused.unwrap_err().to_string().contains("no statistic"));
    // What it was computed from may be another one.
    computed(&engine, &expression("twice", "3 * sst", &["sst"])).await;
}
