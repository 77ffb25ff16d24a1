//! Questions of few cells: the same bits from fields, from a cube and from its time-major copy, and fewer bytes read of each.

use std::sync::Arc;

use compute::analysis::hovmoller;
use compute::matchup::{TimeMatch, matchup};
use compute::{Engine, budget};
use contract::analysis::{Along, HovmollerQuery};
use contract::budget::{BudgetQuery, ErrorWords};
use contract::earth::Earth;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::observation::{Observation, PlatformKind, Quality};
use contract::quantity::Quantity;
use contract::statistics::MinCoverage;
use contract::time::{Period, TimeStep};
use serde_json::Value;
use storage::Store;
use storage::store::Traffic;

use crate::fixture::{folder_store, land, parts, product, total};

/// Two chunks side by side, in the open Pacific.
const GRID: Grid = Grid {
    rows: 450,
    cols: 615,
    north_deg: 0.0,
    west_deg: -150.0,
    dlat_deg: 0.05,
    dlon_deg: 0.05,
};
/// As many as compaction makes a run of.
const STEPS: u32 = 16;
/// Inside of the western chunk.
const BOX: &str = "-149,-3,-147.5,-1";

/// Months of values that do not compress, with gaps.
fn steps() -> Vec<(Period, Vec<f32>)> {
    let mut random = 1u64;
    let mut next = move || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let share = (random >> 40) as f32 / (1u32 << 24) as f32;
        if share < 0.2 {
            f32::NAN
        } else {
            (share - 0.6) * 1e-8
        }
    };
    let month = |at: u32| Period::month(2000 + (at / 12) as i32, at % 12 + 1).unwrap();
    let step = |at| (month(at), (0..GRID.cell_count()).map(|_| next()).collect());
    (0..STEPS).map(step).collect()
}

/// A mooring, and a ship that was seen once.
fn observations() -> Vec<Observation> {
    let at = |time: &str, lon_deg, lat_deg| Observation {
        dataset: "ships".parse().unwrap(),
        platform: "s".to_owned(),
        kind: PlatformKind::Ship,
        time: time.parse().unwrap(),
        lon_deg,
        lat_deg,
        depth_m: 0.0,
        property: "flux".to_owned(),
        value: 1e-9,
        unit: "kg m-2 s-1".to_owned(),
        quality: Quality::Good,
    };
    let months = ["2000-02-03", "2000-03-20", "2000-07-09", "2001-02-11"];
    let mooring = months.map(|time| at(time, -148.03, -2.02));
    let mut all = mooring.to_vec();
    all.push(at("2000-05-05", -140.01, -5.02));
    all
}

/// Answers, and the bytes that a match-up and a diagram took.
async fn answers(store: &Store, manifest: &Manifest) -> (Vec<Value>, [u64; 2]) {
    let (store, traffic): (_, Arc<Traffic>) = store.counted();
    let found = matchup(&store, manifest, &observations(), TimeMatch::Linear).await;
    let found = serde_json::to_value(found.unwrap()).unwrap();
    let of_matchup = traffic.counts().read_bytes;
    let query = HovmollerQuery {
        product: manifest.product.clone(),
        along: Along::Lat,
        band_deg: None,
        region: BOX.parse().ok(),
        step: TimeStep::Month,
        from: None,
        to: None,
        earth: Earth::Wgs84,
        min_coverage: MinCoverage::default(),
    };
    let id = manifest.id();
    let reader = Engine::local(store.clone());
    let bands = hovmoller(&reader, (manifest, &id), &query).await.unwrap();
    let of_bands = traffic.counts().read_bytes - of_matchup;
    let words = ErrorWords {
        error: Some("20%"),
        correlation_length_km: Some(50.0),
        correlation_days: Some(20.0),
        ..ErrorWords::default()
    };
    let uncertain = BudgetQuery {
        errors: words.asked().unwrap(),
        ..total(&manifest.product, BOX)
    };
    let engine = Engine::in_process(store, parts(2));
    let uncertain = budget(&engine, &uncertain).await.unwrap();
    assert!(uncertain.rows[0].uncertainty.is_some());
    let all = vec![
        found,
        serde_json::to_value(bands).unwrap(),
        serde_json::to_value(uncertain).unwrap(),
    ];
    (all, [of_matchup, of_bands])
}

#[tokio::test(flavor = "multi_thread")]
async fn few_cells_are_the_same_wherever_they_are_read_and_take_few_bytes() {
    let (_folder, store) = folder_store();
    let flux = Quantity::CarbonFlux;
    let manifest = land(&store, &product("noise"), flux, GRID, &steps()).await;
    let (of_fields, bytes_of_fields) = answers(&store, &manifest).await;
    assert!(of_fields[0]["rows"].as_array().unwrap().len() >= 3);
    cube::follow(&store, &manifest).await.unwrap();
    let (of_maps, bytes_of_maps) = answers(&store, &manifest).await;
    assert_eq!(of_maps, of_fields);
    let folder = cube::folder(&manifest.product);
    assert_eq!(cube::compact(&store, &folder).await.unwrap(), 1);
    let (of_blocks, bytes_of_blocks) = answers(&store, &manifest).await;
    assert_eq!(of_blocks, of_fields);
    for question in 0..2 {
        let bytes = [bytes_of_fields, bytes_of_maps, bytes_of_blocks].map(|it| it[question]);
        // A few cells are read of chunks of fields before they lie along time.
        assert!(bytes[1] <= bytes[0] + bytes[0] / 4, "{question}: {bytes:?}");
        assert!(2 * bytes[2] < bytes[1], "{question}: {bytes:?}");
    }
}
