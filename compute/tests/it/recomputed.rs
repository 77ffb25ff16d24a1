//! Recomputation and clean-up: plans that say what is stale, runs that mend it, old versions that go in the end.

use std::time::Duration;

use compute::gc::Computed;
use compute::recompute::{Reason, Request, What, plan, run};
use compute::stats::region_series;
use compute::{Engine, derive_accumulated};
use contract::earth::Earth;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::series::RegionSeriesQuery;
use contract::time::{Period, TimeMs};
use storage::gc::{self, Keep, Owner, Versions};
use storage::sound::seal;
use storage::{Store, manifests};

use crate::fixture::{ask, folder_store, land, product, total, wavy_year};

const TEN_DEGREES: Grid = Grid {
    rows: 18,
    cols: 36,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 10.0,
    dlon_deg: 10.0,
};

async fn put(store: &Store, steps: &[(Period, Vec<f32>)]) -> Manifest {
    let id = product("wavy");
    land(store, &id, Quantity::CarbonFlux, TEN_DEGREES, steps).await
}

fn request(what: &[What]) -> Request {
    Request {
        product: product("wavy"),
        from: None,
        to: None,
        what: what.to_vec(),
        is_forced: false,
        is_verified: false,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_plan_names_what_is_missing_and_stale_and_a_run_leaves_nothing_of_it() {
    let mut year = wavy_year(&TEN_DEGREES);
    let (_folder, store) = folder_store();
    put(&store, &year).await;
    let engine = Engine::local(store.clone());
    let all = request(&[What::Budget, What::Fields, What::Statistics]);
    let first = plan(&store, &all).await.unwrap();
    let count = |kind: What| first.items.iter().filter(|item| item.what == kind).count();
    assert_eq!(count(What::Fields), 12);
    assert!(count(What::Budget) >= 8 && count(What::Budget) == count(What::Statistics));
    assert!(
        first
            .items
            .iter()
            .all(|item| item.reason == Reason::Missing)
    );
    let outcome = run(&engine, &first, &|_done| ()).await.unwrap();
    assert_eq!(outcome.derived.unwrap().number, 1);
    let second = plan(&store, &all).await.unwrap();
    assert_eq!(
        (second.items.len(), second.fresh_count),
        (0, first.items.len())
    );

    year[10].1[300] = 4e-9;
    put(&store, &year).await;
    let third = plan(&store, &all).await.unwrap();
    let fields: Vec<_> = third
        .items
        .iter()
        .filter(|item| item.what == What::Fields)
        .collect();
    assert_eq!(fields.len(), 2, "November and what follows from it");
    assert!(third.items.iter().all(|item| item.reason == Reason::Stale));
    run(&engine, &third, &|_done| ()).await.unwrap();
    assert!(plan(&store, &all).await.unwrap().items.is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_field_is_planned_and_made_again_without_a_new_version() {
    let year = wavy_year(&TEN_DEGREES);
    let (folder, store) = folder_store();
    put(&store, &year).await;
    let engine = Engine::local(store.clone());
    let derived = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
    let derived = derived.unwrap();
    let step = &derived.steps[8];
    let counts = &step.contributed.as_ref().unwrap().counts;
    for (lost, count) in [(&step.field, 4), (counts, 4), (&derived.domain, 12)] {
        std::fs::remove_file(folder.path().join(lost.as_str())).unwrap();
        let fields = request(&[What::Fields]);
        let mend = plan(&store, &fields).await.unwrap();
        assert_eq!(mend.items.len(), count, "{lost}");
        assert_eq!(mend.items[0].reason, Reason::Missing);
        let outcome = run(&engine, &mend, &|_done| ()).await.unwrap();
        assert_eq!(outcome.derived.unwrap(), derived);
        assert!(store.exists(lost).await.unwrap());
        // Who derives it again finds what is gone, too.
        std::fs::remove_file(folder.path().join(lost.as_str())).unwrap();
        let again = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
        assert_eq!(again.unwrap(), derived, "{lost}");
        assert!(store.exists(lost).await.unwrap(), "{lost}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn forced_recomputation_compares_with_what_is_stored() {
    let year = wavy_year(&TEN_DEGREES);
    let (folder, store) = folder_store();
    put(&store, &year).await;
    let engine = Engine::local(store.clone());
    let budgets = request(&[What::Budget]);
    let first = plan(&store, &budgets).await.unwrap();
    run(&engine, &first, &|_| ()).await.unwrap();
    let forced = Request {
        is_forced: true,
        ..budgets
    };
    let again = plan(&store, &forced).await.unwrap();
    assert!(!first.items.is_empty() && again.items.len() == first.items.len());
    assert!(again.items.iter().all(|item| item.reason == Reason::Forced));
    run(&engine, &again, &|_| ()).await.unwrap();
    // The planted fault: one digit of one stored sum, sealed as if it were right.
    let tables = folder.path().join("sums/wavy");
    let table = std::fs::read_dir(tables)
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let text = std::fs::read_to_string(&table).unwrap();
    let (unsealed, _seal) = text.rsplit_once(",\"sha256\":\"").unwrap();
    let spoilt = unsealed.replacen("\"mass_steps\":\"", "\"mass_steps\":\"7", 1);
    let spoilt = spoilt.replacen(":\"7-", ":\"-7", 1);
    assert_ne!(spoilt, unsealed);
    let sealed = seal::json(format!("{spoilt}}}").into_bytes());
    std::fs::write(&table, sealed).unwrap();
    let differs = run(&engine, &again, &|_| ()).await.unwrap_err().to_string();
    assert!(differs.contains("exists with other content"), "{differs}");
    // Under a seal that is not its own it is damaged, and made again as it was.
    std::fs::write(&table, text.replacen(unsealed, &spoilt, 1)).unwrap();
    run(&engine, &again, &|_| ()).await.unwrap();
    assert_eq!(std::fs::read_to_string(&table).unwrap(), text);
}

#[tokio::test(flavor = "multi_thread")]
async fn stored_sums_answer_with_the_same_bits_and_without_the_engine() {
    let year = wavy_year(&TEN_DEGREES);
    let (folder, store) = folder_store();
    let manifest = put(&store, &year).await;
    let engine = Engine::local(store.clone());
    let question = total(&product("wavy"), "14n-50n");
    let computed = ask(&engine, &question).await;
    let budgets = plan(&store, &request(&[What::Budget])).await.unwrap();
    run(&engine, &budgets, &|_| ()).await.unwrap();
    // Without fields no engine could answer.
    for step in &manifest.steps {
        std::fs::remove_file(folder.path().join(step.field.as_str())).unwrap();
    }
    assert_eq!(ask(&engine, &question).await, computed);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mean_over_a_region_is_the_mean_by_area() {
    let (_folder, store) = folder_store();
    let mut values = vec![f32::NAN; TEN_DEGREES.cell_count()];
    let (north, equator) = (2 * 36, 8 * 36); // cells 60 to 70 and 0 to 10 degrees north
    values[north] = 280.0;
    values[equator] = 300.0;
    let january = Period::month(2000, 1).unwrap();
    let id = product("sst");
    let sst = Quantity::SeaSurfaceTemperature;
    land(&store, &id, sst, TEN_DEGREES, &[(january, values)]).await;
    let query = RegionSeriesQuery {
        product: id,
        region: "-180,0,-170,90".parse().unwrap(),
        region_name: "strip".to_owned(),
        from: None,
        to: None,
        earth: Earth::Sphere,
        ocean: None,
    };
    let answer = region_series(&Engine::local(store), &query).await.unwrap();
    let strip = |south: f64, north: f64| north.to_radians().sin() - south.to_radians().sin();
    let (a, b) = (strip(60.0, 70.0), strip(0.0, 10.0));
    let display = sst.display();
    let expected = (280.0 * a + 300.0 * b) / (a + b) * display.factor + display.offset;
    let mean = answer.series[0].mean.unwrap();
    assert!((mean / expected - 1.0).abs() < 1e-9, "{mean} {expected}");
    // Of the sea: the northern cell holds a piece of Chukotka, and so does the strip.
    let sea = |region: &str| {
        let region = region.parse().unwrap();
        compute::region::extent::extent(&region, Earth::Sphere)
            .unwrap()
            .ocean_m2
    };
    let held = sea("-180,60,-170,70") + sea("-180,0,-170,10");
    let covered = 100.0 * held / sea("-180,0,-170,90");
    assert!((answer.series[0].coverage_percent / covered - 1.0).abs() < 1e-6);
    assert!(covered > 100.0 * (a + b) / strip(0.0, 90.0) * 0.9);
}

#[tokio::test(flavor = "multi_thread")]
async fn clean_up_takes_what_no_kept_version_names_and_nothing_young() {
    let mut year = wavy_year(&TEN_DEGREES);
    let (_folder, store) = folder_store();
    let engine = Engine::local(store.clone());
    let mut versions = vec![];
    for round in 0..3 {
        year[4].1[300] = 1e-9 * round as f32;
        // Data where the first version had none: other counts.
        year[4].1[301] = if round == 0 { f32::NAN } else { 1e-9 };
        put(&store, &year).await;
        let derived = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
        versions.push(derived.unwrap());
    }
    let stranger = "notes/by-hand.txt".parse().unwrap();
    store.put_new(&stranger, "x".into()).await.unwrap();
    let keep = Keep {
        versions: 1,
        age: Duration::from_hours(24),
    };
    let owners: &[&dyn Owner] = &[&Versions, &Computed];
    let now = now();
    assert!(
        gc::plan(&store, owners, keep, now)
            .await
            .unwrap()
            .garbage
            .is_empty()
    );
    let in_two_days = TimeMs::new(now.ms() + 2 * 86_400_000).unwrap();
    let removal = gc::plan(&store, owners, keep, in_two_days).await.unwrap();
    assert!(removal.size_bytes() > 0);
    let removed = gc::run(&store, owners, &removal, keep, &|_done| ())
        .await
        .unwrap();
    assert_eq!(removed, removal.garbage.len());

    let target = product("wavy-accumulated");
    assert_eq!(
        manifests::latest(&store, &target).await.unwrap().unwrap(),
        versions[2]
    );
    for step in &versions[2].steps {
        assert!(store.exists(&step.field).await.unwrap());
        let counts = &step.contributed.as_ref().unwrap().counts;
        assert!(store.exists(counts).await.unwrap());
    }
    assert!(!store.exists(&versions[0].steps[4].field).await.unwrap());
    let old_counts = &versions[0].steps[4].contributed.as_ref().unwrap().counts;
    assert!(!store.exists(old_counts).await.unwrap());
    assert!(manifests::load(&store, &versions[0].id()).await.is_err());
    assert!(store.exists(&stranger).await.unwrap());
    let nothing = gc::plan(&store, owners, keep, in_two_days).await.unwrap();
    assert!(nothing.garbage.is_empty());
    // What is left is enough to go on from.
    year[11].1[300] = 5e-9;
    put(&store, &year).await;
    let next = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
    assert_eq!(next.unwrap().number, 4);
}

fn now() -> TimeMs {
    let since = std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .unwrap();
    TimeMs::new(since.as_millis() as i64).unwrap()
}
