//! A cluster of real processes: the same bits as one process, whatever is killed on the way.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use compute::computed::{Request, compute};
use compute::reduce::statistics;
use compute::{Engine, budget, derive_accumulated};
use contract::budget::{BudgetAnswer, BudgetQuery};
use contract::geometry::{AskedGeometry, Sampling};
use contract::grid::LonLatDeg;
use contract::manifest::{Manifest, Step};
use contract::quantity::Quantity;
use contract::region::{Polygon, Region};
use contract::statistics::{StatisticsAnswer, StatisticsQuery};
use contract::time::{Period, TimeStep};
use cube::RUN_STEPS;
use storage::Store;

use crate::computed::{land_inputs, windy};
use crate::fixture::{ONE_DEGREE, ask, folder_store, land, parts, product, total, wavy_year};
use crate::node::{Cluster, LIMIT};
use crate::statistics::{POLYGON, area, asked};
use crate::stored_sums::{GRID, compacted, noise};

/// Parts that queries are cut into, whatever the number of executors.
const PARTS: usize = 8;

async fn wavy_store() -> (tempfile::TempDir, Store) {
    let (folder, store) = folder_store();
    let (id, year) = (product("wavy"), wavy_year(&ONE_DEGREE));
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &year).await;
    (folder, store)
}

fn engine(store: &Store, cluster: &Cluster) -> Engine {
    let url = cluster.address.to_string().parse().unwrap();
    Engine::cluster(store.clone(), url, parts(PARTS))
}

fn monthly(region: &str) -> BudgetQuery {
    BudgetQuery {
        step: TimeStep::Month,
        ..total(&product("wavy"), region)
    }
}

/// A coast of 60,000 corners: far more than one message between client and scheduler may hold, were it sent in one.
fn rugged() -> BudgetQuery {
    let corner = |i: u32| {
        let angle = f64::from(i) / 60_000.0 * std::f64::consts::TAU;
        let radius_deg = 30.0 + 3.0 * (f64::from(i) * 0.7).sin();
        [
            -140.0 + radius_deg * angle.cos(),
            5.0 + radius_deg * angle.sin(),
        ]
    };
    BudgetQuery {
        region: Region::Polygons(vec![Polygon {
            outer: (0..60_000).map(corner).collect(),
            holes: vec![],
        }]),
        region_name: "rugged".to_owned(),
        ..monthly("global")
    }
}

fn questions() -> Vec<BudgetQuery> {
    let regions = ["global", "equatorial-pacific", "170.5,-33.3,-120.1,12.7"];
    let mut all: Vec<_> = regions.into_iter().map(monthly).collect();
    all.push(rugged());
    all
}

/// Percentiles, which take several passes over the values.
fn percentiles() -> StatisticsQuery {
    asked(area(POLYGON), "median,p5,p97.5,mean", TimeStep::Season)
}

/// Percentiles, extremes with their dates, a line, and a place between four cells.
fn of_statistics() -> Vec<StatisticsQuery> {
    let extremes = "min,max,std,count,coverage";
    let line = AskedGeometry::line("170.5,-33.3;-120.1,12.7;-100,85;80,80").unwrap();
    let place = LonLatDeg::new(171.3, -40.2).unwrap();
    let place = AskedGeometry::point(place, Sampling::Bilinear);
    vec![
        percentiles(),
        asked(area("global"), extremes, TimeStep::Month),
        asked(line, "mean,std,p90,min,max,sum", TimeStep::Year),
        asked(place, "mean,median,max,coverage", TimeStep::Native),
    ]
}

async fn answers(engine: &Engine) -> (Vec<BudgetAnswer>, Vec<StatisticsAnswer>) {
    let (mut budgets, mut all) = (vec![], vec![]);
    for question in questions() {
        budgets.push(ask(engine, &question).await);
    }
    for question in of_statistics() {
        all.push(statistics(engine, &question).await.unwrap());
    }
    (budgets, all)
}

#[tokio::test(flavor = "multi_thread")]
async fn one_two_and_seven_executors_give_the_bits_of_one_process() {
    let (folder, store) = wavy_store().await;
    // No plan and no scheduler: the executors' answers are held against those that shared nothing with them but kernels.
    let alone = answers(&Engine::in_process(store.clone(), parts(2))).await;
    assert_eq!(alone.0[3].rows.len(), 12);
    assert!(alone.1[0].rows.iter().all(|row| row.values["p5"].is_some()));
    assert!(alone.1[1].rows.iter().all(|row| row.found_at.len() == 2));
    let mut cluster = Cluster::start(folder.path());
    let mut derived = vec![];
    for executor_count in [1, 2, 7] {
        cluster.add(executor_count - cluster.executors.len(), 0, 0);
        let engine = engine(&store, &cluster);
        engine.ready().await.unwrap();
        let begun = Instant::now();
        assert_eq!(answers(&engine).await, alone, "{executor_count} executors");
        eprintln!(
            "{executor_count} executors: eight questions in {:?}",
            begun.elapsed()
        );

        // Into a store of its own, so that nothing is there already; executors read any folder of this machine.
        let (_own, own_store) = wavy_store().await;
        let engine = self::engine(&own_store, &cluster);
        let manifest = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
        derived.push(manifest.unwrap());
    }
    let alone = Engine::standalone(store, parts(2));
    let manifest = derive_accumulated(&alone, &product("wavy"), None, &|_| ()).await;
    let manifest = manifest.unwrap();
    assert!(derived.iter().all(|other| *other == manifest));
}

/// Moves what a store's folder holds under some names to another folder, or back.
fn put_aside(from: &Path, to: &Path, names: &[String]) {
    for name in names {
        let aside = to.join(name);
        fs::create_dir_all(aside.parent().unwrap()).unwrap();
        fs::rename(from.join(name), aside).unwrap();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn executors_read_along_time_and_fields_where_a_cube_is_gone_since_it_was_planned_with() {
    let (folder, store) = folder_store();
    let steps = noise(&GRID, 150, 5);
    let manifest = land(&store, &product("p"), Quantity::CarbonFlux, GRID, &steps).await;
    assert!(compacted(&store, &manifest).await > 0);
    let fields = manifest.steps[..RUN_STEPS].iter();
    let fields: Vec<String> = fields.map(|step| step.field.as_str().to_owned()).collect();
    let asked_of = |geometry: AskedGeometry, statistics: &str, step| StatisticsQuery {
        product: product("p"),
        ..asked(geometry, statistics, step)
    };
    let line = || AskedGeometry::line("170.5,-33.3;-120.1,12.7;-100,85").unwrap();
    let first = [
        asked_of(area("global"), "mean,std,coverage", TimeStep::Native),
        asked_of(area(POLYGON), "min,max,mean,median", TimeStep::Month),
        asked_of(line(), "mean,p90", TimeStep::Total),
    ];
    let second = asked_of(area("-40,-50,60,30"), "mean,std,count", TimeStep::Native);
    let sum = BudgetQuery {
        step: TimeStep::Month,
        ..total(&product("p"), "-100,-33.3,-20.1,12.7")
    };
    let alone = Engine::local(store.clone());
    let mut expected = vec![];
    for question in &first {
        expected.push(statistics(&alone, question).await.unwrap());
    }
    let expected_sum = ask(&alone, &sum).await;
    let expected_second = statistics(&alone, &second).await.unwrap();

    let mut cluster = Cluster::start(folder.path());
    cluster.add(2, 0, 0);
    let engine = engine(&store, &cluster);
    let aside = tempfile::tempdir().unwrap();
    put_aside(folder.path(), aside.path(), &fields);
    for (question, expected) in first.iter().zip(&expected) {
        assert_eq!(statistics(&engine, question).await.unwrap(), *expected);
    }
    assert_eq!(ask(&engine, &sum).await, expected_sum);
    put_aside(aside.path(), folder.path(), &fields);

    // Who asks has opened the cube and plans with it; executors that never saw it come too late.
    cluster.executors.clear();
    put_aside(folder.path(), aside.path(), &["cubes".to_owned()]);
    cluster.add(2, 0, 0);
    let found = statistics(&engine, &second).await.unwrap();
    assert_eq!(found, expected_second);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_executor_killed_in_the_middle_is_noticed_and_changes_nothing() {
    let (folder, store) = wavy_store().await;
    let alone = Engine::local(store.clone());
    let expected = ask(&alone, &monthly("global")).await;
    let expected_percentiles = statistics(&alone, &percentiles()).await.unwrap();
    let mut cluster = Cluster::start(folder.path());
    cluster.add(3, 300, 0);
    let engine = engine(&store, &cluster);
    let own = engine.clone();
    let asking = tokio::spawn(async move { budget(&own, &monthly("global")).await });
    let of_percentiles = tokio::spawn(async move { statistics(&engine, &percentiles()).await });
    cluster.busy(0);
    let is_over = asking.is_finished() || of_percentiles.is_finished();
    assert!(!is_over, "a query was over before the kill");
    let heard = cluster.scheduler.line_count();
    cluster.executors[0].kill();
    let killed = Instant::now();
    let (noticed, _, _) = cluster.scheduler.heard("EXECUTORS 2", heard);
    let notice = noticed - killed;
    assert_eq!(asking.await.unwrap().unwrap(), expected);
    let found = of_percentiles.await.unwrap().unwrap();
    assert_eq!(found, expected_percentiles);
    eprintln!(
        "executor lost: noticed after {notice:?}, answered {:?} after the kill",
        killed.elapsed()
    );
    // The engine's own settings need three minutes; a slow machine may need some seconds more than ours.
    assert!(notice < Duration::from_mins(1), "{notice:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scheduler_killed_in_the_middle_is_asked_again_when_it_is_back() {
    let (folder, store) = wavy_store().await;
    let expected = ask(&Engine::local(store.clone()), &monthly("global")).await;
    let mut cluster = Cluster::start(folder.path());
    cluster.add(2, 200, 0);
    let engine = engine(&store, &cluster);
    let asking = tokio::spawn(async move { budget(&engine, &monthly("global")).await });
    cluster.busy(0);
    assert!(!asking.is_finished(), "the query was over before the kill");
    cluster.scheduler.kill();
    let killed = Instant::now();
    cluster.restart_scheduler();
    assert_eq!(asking.await.unwrap().unwrap(), expected);
    cluster.scheduler.heard("EXECUTORS 2", 0);
    eprintln!(
        "scheduler lost: answered {:?} after the kill",
        killed.elapsed()
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cluster_that_never_answers_is_given_up_at_the_limit_with_the_reason() {
    let (folder, store) = wavy_store().await;
    let cluster = Cluster::start(folder.path());
    let limit = Duration::from_secs(2);
    let engine = engine(&store, &cluster).with_query_limit(limit);
    // Nobody to work on it, and then a scheduler that hangs.
    for is_frozen in [false, true] {
        if is_frozen {
            cluster.scheduler.freeze();
        }
        let begun = Instant::now();
        let asked = tokio::time::timeout(LIMIT, budget(&engine, &monthly("global"))).await;
        let error = asked.unwrap().unwrap_err();
        assert!(begun.elapsed() >= limit);
        assert!(error.is_retryable(), "{error}");
        let reason = error.to_string();
        let address = cluster.address.to_string();
        for said in ["within 2 s", "--cluster-limit-s", address.as_str()] {
            assert!(reason.contains(said), "{said}: {reason}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn executors_and_scheduler_may_be_started_in_any_order_and_leave_in_peace() {
    let (folder, store) = wavy_store().await;
    let expected = ask(&Engine::local(store.clone()), &monthly("global")).await;
    // So long that only an executor which says goodbye is gone within the time that tests wait for a line.
    let mut cluster = Cluster::start_with(folder.path(), 60);
    let engine = engine(&store, &cluster);
    // A question before there is anybody to answer it, and executors before there is a scheduler.
    cluster.scheduler.kill();
    let early = engine.clone();
    let asking = tokio::spawn(async move { budget(&early, &monthly("global")).await });
    tokio::time::sleep(Duration::from_millis(300)).await;
    cluster.restart_scheduler();
    cluster.add(2, 0, 0);
    assert_eq!(asking.await.unwrap().unwrap(), expected);
    let heard = cluster.scheduler.line_count();
    let begun = Instant::now();
    cluster.executors[0].stop();
    cluster.scheduler.heard("EXECUTORS 1", heard);
    let left = begun.elapsed();
    eprintln!("an idle executor left after {left:?}");
    assert!(left < Duration::from_secs(50), "{left:?}");
    assert_eq!(ask(&engine, &monthly("global")).await, expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_that_fails_for_a_while_changes_nothing() {
    let (folder, store) = wavy_store().await;
    let expected = ask(&Engine::local(store.clone()), &monthly("global")).await;
    let mut cluster = Cluster::start(folder.path());
    // Longer than one executor tries by itself: the scheduler has the task run again.
    cluster.add(2, 0, 8_000);
    let engine = engine(&store, &cluster);
    let begun = Instant::now();
    assert_eq!(ask(&engine, &monthly("global")).await, expected);
    eprintln!("store away for 8 s: answered after {:?}", begun.elapsed());
    let failed = cluster.executors.iter().any(|node| {
        node.line_count() > 2 // its address, its identity, and failures
    });
    assert!(failed, "the store never failed");
}

/// What a product holds, whatever its name: of every step the digest of its values, and its cells with data.
fn held(manifest: &Manifest) -> Vec<(Period, String, u64)> {
    let digest = |step: &Step| step.field.as_str().rsplit('/').next().unwrap().to_owned();
    let steps = manifest.steps.iter();
    steps
        .map(|step| (step.period, digest(step), step.valid_cells))
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn executors_compute_and_store_a_product_with_the_bits_of_one_process_even_if_one_is_killed()
{
    let (folder, store) = folder_store();
    land_inputs(&store).await;
    let named = |name: &str| Request {
        target: product(name),
        ..windy()
    };
    let alone = compute(&Engine::local(store.clone()), &named("alone"), &|_| ()).await;
    let expected = held(&alone.unwrap().manifest);
    assert_eq!(expected.len(), 10);
    let mut cluster = Cluster::start(folder.path());
    for executor_count in [1, 2, 7] {
        cluster.add(executor_count - cluster.executors.len(), 0, 0);
        let engine = engine(&store, &cluster);
        engine.ready().await.unwrap();
        let name = format!("by-{executor_count}");
        let found = compute(&engine, &named(&name), &|_| ()).await.unwrap();
        assert_eq!(
            held(&found.manifest),
            expected,
            "{executor_count} executors"
        );
    }
    let engine = engine(&store, &cluster);
    let asking = tokio::spawn(async move { compute(&engine, &named("by-six"), &|_| ()).await });
    cluster.executors[0].kill();
    let found = asking.await.unwrap().unwrap();
    assert_eq!(held(&found.manifest), expected);
}
