//! Parts beside the whole, to the last digit: months and years, regions that fill, overlap and leave out, codes of a mask, rivers.

use std::sync::Arc;

use compute::{Engine, ErrorClass, budget};
use contract::budget::{AskedRiver, BudgetAnswer, BudgetParts, BudgetQuery, StatedRiver};
use contract::grid::Grid;
use contract::quantity::{Quantity, SECONDS_PER_YEAR};
use contract::region::{AskedRegion, Region, named_regions};
use contract::time::{Period, TimeMs, TimeStep};
use storage::Store;

use crate::fixture::{ONE_DEGREE, ask, folder_store, land, months, product, total, wavy_year};

const DAY_MS: i64 = 86_400_000;

/// A decimal text of nine decimals as a whole number.
fn steps(text: &str) -> i128 {
    text.replace('.', "").parse().unwrap()
}

fn square(name: &str, [west, south, east, north]: [f64; 4]) -> String {
    format!(
        r#"{{"type":"Feature","properties":{{"name":"{name}"}},"geometry":{{"type":"Polygon","coordinates":[[[{west},{south}],[{east},{south}],[{east},{north}],[{west},{north}],[{west},{south}]]]}}}}"#
    )
}

fn regions(squares: &[(&str, [f64; 4])]) -> Vec<AskedRegion> {
    let features: Vec<String> = squares.iter().map(|(name, at)| square(name, *at)).collect();
    let features = features.join(",");
    named_regions(&format!(
        r#"{{"type":"FeatureCollection","features":[{features}]}}"#
    ))
    .unwrap()
}

async fn wavy() -> (tempfile::TempDir, Engine) {
    let (folder, store) = folder_store();
    let id = product("wavy");
    land(
        &store,
        &id,
        Quantity::CarbonFlux,
        ONE_DEGREE,
        &wavy_year(&ONE_DEGREE),
    )
    .await;
    (folder, Engine::local(store))
}

#[tokio::test(flavor = "multi_thread")]
async fn weeks_that_months_cut_sum_to_the_year_to_the_last_digit() {
    let (_folder, store) = folder_store();
    let grid = Grid {
        rows: 6,
        cols: 12,
        dlat_deg: 30.0,
        dlon_deg: 30.0,
        ..ONE_DEGREE
    };
    let start = months(2000)[0].start.ms();
    let week = |week: i64| {
        let at = |days: i64| TimeMs::new(start + days * DAY_MS).unwrap();
        let value = |cell: usize| 1.3e-9 * ((cell as f32).sin() + (week as f32 * 0.7).cos());
        let period = Period::new(at(7 * week), at(7 * week + 7)).unwrap();
        (period, (0..grid.cell_count()).map(value).collect())
    };
    let weeks: Vec<_> = (0..60).map(week).collect();
    land(
        &store,
        &product("weeks"),
        Quantity::CarbonFlux,
        grid,
        &weeks,
    )
    .await;
    let engine = Engine::local(store);
    let of = |step| BudgetQuery {
        step,
        ..total(&product("weeks"), "-60,-30,100,60")
    };
    let whole = ask(&engine, &of(TimeStep::Total)).await;
    for (step, rows) in [(TimeStep::Month, 14), (TimeStep::Year, 2)] {
        let answer = ask(&engine, &of(step)).await;
        assert_eq!(answer.rows.len(), rows);
        let sum: i128 = answer.rows.iter().map(|row| steps(&row.budget_kg)).sum();
        assert_eq!(sum, steps(&whole.rows[0].budget_kg));
        let closure = answer.closure.unwrap();
        assert_eq!(closure.rows_kg, closure.total_kg);
        assert_eq!(closure.total_kg, whole.rows[0].budget_kg);
    }
    assert_eq!(whole.closure, None);
}

/// Each part, the whole and the union asked by themselves.
async fn check(engine: &Engine, query: &BudgetQuery, parts: &[AskedRegion], answer: &BudgetAnswer) {
    let alone = |asked: AskedRegion| BudgetQuery {
        region: asked.region,
        region_name: asked.name,
        parts: None,
        ..query.clone()
    };
    let sum = |answer: &BudgetAnswer| -> i128 {
        answer.rows.iter().map(|row| steps(&row.budget_kg)).sum()
    };
    let mut of_parts = 0;
    for (part, own) in parts.iter().zip(&answer.regions) {
        let asked = ask(engine, &alone(part.clone())).await;
        assert_eq!((&asked.region, &asked.rows), (&own.region, &own.rows));
        of_parts += sum(&asked);
    }
    let polygons = parts.iter().flat_map(|part| match &part.region {
        Region::Polygons(polygons) => polygons.clone(),
        other => panic!("{other:?}"),
    });
    let union = AskedRegion {
        region: Region::Polygons(polygons.collect()),
        name: "union".to_owned(),
    };
    let union = sum(&ask(engine, &alone(union)).await);
    let whole = sum(answer);
    let closure = answer.closure.as_ref().unwrap();
    let own = closure.regions.as_ref().unwrap();
    assert_eq!(steps(&own.regions_kg), of_parts);
    assert_eq!(steps(&own.whole_kg), whole);
    assert_eq!(steps(&own.overlap_kg), of_parts - union);
    assert_eq!(steps(&own.left_out_kg), whole - union);
    assert_eq!(
        of_parts - steps(&own.overlap_kg) + steps(&own.left_out_kg),
        whole
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn regions_sum_to_the_whole_with_what_they_share_and_leave_out() {
    let (_folder, engine) = wavy().await;
    let filling = [
        ("west", [10.0, -20.0, 30.0, 15.0]),
        ("east", [30.0, -20.0, 50.0, 15.0]),
    ];
    let crossing = [
        ("west", [10.0, -20.0, 33.3, 15.0]),
        ("east", [30.0, -20.0, 50.0, 15.0]),
    ];
    let leaving = [
        ("west", [10.0, -20.0, 30.0, 15.0]),
        ("north", [30.5, 0.25, 50.0, 15.0]),
    ];
    for (squares, overlaps, leaves) in [
        (filling, false, false),
        (crossing, true, false),
        (leaving, false, true),
    ] {
        let parts = regions(&squares);
        let query = BudgetQuery {
            step: TimeStep::Year,
            parts: Some(BudgetParts::Regions(parts.clone())),
            ..total(&product("wavy"), "10,-20,50,15")
        };
        let answer = ask(&engine, &query).await;
        check(&engine, &query, &parts, &answer).await;
        let own = answer.closure.unwrap().regions.unwrap();
        assert_eq!(
            (own.overlap_m2 > 0.0, own.left_out_m2 > 0.0),
            (overlaps, leaves)
        );
        assert_eq!(
            own.summary.contains("overlap by"),
            overlaps,
            "{}",
            own.summary
        );
        assert_eq!(own.summary.contains("whole out"), leaves, "{}", own.summary);
        if !overlaps && !leaves {
            // What is left is rounding of areas, far below a part in 10^12 of what lies there.
            for kg in [&own.overlap_kg, &own.left_out_kg] {
                assert!(kg.parse::<f64>().unwrap().abs() < 1e-2, "{kg}");
            }
        }
    }
}

/// Corners of regions that are added up are rounded by some millimetres, which along a wide box is more than a part in 10^9 of it.
#[tokio::test(flavor = "multi_thread")]
async fn rounded_corners_neither_reach_beyond_a_box_nor_leave_any_of_it_out() {
    let (_folder, engine) = wavy().await;
    let whole = "-142.4,16.4,-73.8,23";
    let of = |squares: &[(&str, [f64; 4])]| BudgetQuery {
        parts: Some(BudgetParts::Regions(regions(squares))),
        ..total(&product("wavy"), whole)
    };
    let west = ("west", [-142.4, 16.4, -100.1, 23.0]);
    let filling = [west, ("east", [-100.1, 16.4, -73.8, 23.0])];
    let answer = ask(&engine, &of(&filling)).await;
    let own = answer.closure.unwrap().regions.unwrap();
    let wanted = "the regions fill the whole and do not overlap";
    assert_eq!(own.summary, wanted);
    let inside = ask(&engine, &of(&[west])).await;
    let own = inside.closure.unwrap().regions.unwrap();
    assert!(own.overlap_m2 <= 0.0 && own.left_out_m2 > 1e12);
    // By 1e-4 degrees: 7.7 km2.
    let beyond = [("beyond", [-100.1, 16.4, -73.7999, 23.0])];
    let refused = budget(&engine, &of(&beyond)).await.unwrap_err();
    assert!(refused.to_string().contains("reach 7."), "{refused}");
    let gap = [west, ("east", [-100.0999, 16.4, -73.8, 23.0])];
    let own = ask(&engine, &of(&gap)).await.closure.unwrap();
    let own = own.regions.unwrap();
    assert!((7e6..9e6).contains(&own.left_out_m2), "{}", own.summary);
    assert!(own.summary.contains("leave 7."), "{}", own.summary);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_code_of_a_mask_is_a_region() {
    let (_folder, store) = folder_store();
    let id = product("wavy");
    land(
        &store,
        &id,
        Quantity::CarbonFlux,
        ONE_DEGREE,
        &wavy_year(&ONE_DEGREE),
    )
    .await;
    // Between 10 and 50 degrees east: 15 north to the equator, to 10 south in two parts, and nothing to 20 south.
    let code = |cell: usize| match (cell / 360, cell % 360) {
        (75..90, 190..230) => 1.0,
        (90..100, 190..200) => 2.0,
        (90..100, 200..230) => 3.0,
        _ => f32::NAN,
    };
    let codes: Vec<f32> = (0..ONE_DEGREE.cell_count()).map(code).collect();
    let quantity = Quantity::open("basin", "1", "Basins").unwrap();
    let steps = [(Period::year(2000).unwrap(), codes)];
    let mask = Arc::new(land(&store, &product("basins"), quantity, ONE_DEGREE, &steps).await);
    let engine = Engine::local(store);
    let query = BudgetQuery {
        parts: Some(BudgetParts::Mask(Arc::clone(&mask))),
        ..total(&id, "10,-20,50,15")
    };
    let answer = ask(&engine, &query).await;
    let names: Vec<_> = answer
        .regions
        .iter()
        .map(|one| one.region.clone())
        .collect();
    assert_eq!(names, [1, 2, 3].map(|code| format!("{}:{code}", mask.id())));
    let own = answer.closure.unwrap().regions.unwrap();
    assert!(
        own.overlap_m2 <= 0.0 && own.left_out_m2 > 0.0,
        "{}",
        own.summary
    );
    let south = ask(&engine, &total(&id, "10,-20,50,-10")).await;
    let (left, south) = (
        own.left_out_kg.parse::<f64>().unwrap(),
        &south.rows[0].budget_kg,
    );
    let south: f64 = south.parse().unwrap();
    assert!((left / south - 1.0).abs() < 1e-9, "{left} {south}");
}

#[tokio::test(flavor = "multi_thread")]
async fn regions_that_are_no_parts_are_refused() {
    let (_folder, engine) = wavy().await;
    let refused = async |region: &str, squares: &[(&str, [f64; 4])]| {
        let query = BudgetQuery {
            parts: Some(BudgetParts::Regions(regions(squares))),
            ..total(&product("wavy"), region)
        };
        let refused = budget(&engine, &query).await.unwrap_err();
        assert_eq!(refused.class(), ErrorClass::BadRequest);
        refused.to_string()
    };
    let beyond = refused("0,0,10,10", &[("far", [5.0, 5.0, 15.0, 10.0])]).await;
    assert!(beyond.contains("beyond 0,0,10,10"), "{beyond}");
    let flat = refused("global", &[("flat", [5.0, 5.0, 15.0, 5.0])]).await;
    assert!(flat.contains("flat"), "{flat}");
}

fn river(flux: &str, source: Option<&str>) -> AskedRiver {
    AskedRiver::asked(Some(flux), source).unwrap().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_river_flux_is_taken_off_by_the_length_of_rows() {
    let (_folder, store) = folder_store();
    let id = product("wavy");
    land(
        &store,
        &id,
        Quantity::CarbonFlux,
        ONE_DEGREE,
        &wavy_year(&ONE_DEGREE),
    )
    .await;
    let half: Vec<_> = wavy_year(&ONE_DEGREE).into_iter().take(6).collect();
    let rivers = land(
        &store,
        &product("rivers"),
        Quantity::CarbonFlux,
        ONE_DEGREE,
        &half,
    )
    .await;
    let engine = Engine::local(store);
    let of = |river: AskedRiver, to: Option<&str>| BudgetQuery {
        step: TimeStep::Month,
        to: to.map(|to| to.parse().unwrap()),
        river: Some(river),
        ..total(&id, "14n-50n")
    };
    let stated = of(river("650+-300", Some("Regnier et al. (2022)")), None);
    let answer = ask(&engine, &stated).await;
    for row in &answer.rows {
        let years = (row.end.ms() - row.start.ms()) as f64 / 1000.0 / SECONDS_PER_YEAR;
        let own = row.river.unwrap();
        assert!((own.river_tg / (650.0 * years) - 1.0).abs() < 1e-12);
        assert!((own.anthropogenic_tg - (row.budget_tg - own.river_tg)).abs() < 1e-9);
        assert_eq!(own.sigma_tg, None);
    }
    let basis = answer.river.unwrap();
    assert_eq!(basis.source, "Regnier et al. (2022)");
    assert_eq!(
        (basis.tg_per_year, basis.sigma_tg_per_year),
        (Some(650.0), Some(300.0))
    );

    // A product of the same values leaves nothing, and one that ends early is refused.
    let stored = AskedRiver {
        of_product: Some(Arc::new(rivers.clone())),
        ..river("rivers", None)
    };
    assert!(matches!(stored.stated, StatedRiver::Product(_)));
    let answer = ask(&engine, &of(stored.clone(), Some("2000-07"))).await;
    assert_eq!(answer.river.as_ref().unwrap().manifest, Some(rivers.id()));
    assert!(
        answer
            .rows
            .iter()
            .all(|row| row.river.unwrap().anthropogenic_tg.abs() < 1e-12)
    );
    let refused = budget(&engine, &of(stored, None)).await.unwrap_err();
    let wanted = "river flux \"rivers\" is not valid: it does not cover all of 2000-07-01";
    assert!(refused.to_string().starts_with(wanted), "{refused}");
}

/// Cells of 30 degrees.
const COARSE: Grid = Grid {
    rows: 6,
    cols: 12,
    dlat_deg: 30.0,
    dlon_deg: 30.0,
    ..ONE_DEGREE
};

/// A year's river flux as one step, of the cells that a rule of their columns takes.
async fn yearly_rivers(store: &Store, has_data: impl Fn(usize) -> bool) -> AskedRiver {
    let value = |cell: usize| if has_data(cell % 12) { 1e-10 } else { f32::NAN };
    let values: Vec<f32> = (0..COARSE.cell_count()).map(value).collect();
    let steps = [(Period::year(2000).unwrap(), values)];
    let (id, flux) = (product("rivers"), Quantity::CarbonFlux);
    let manifest = land(store, &id, flux, COARSE, &steps).await;
    AskedRiver {
        of_product: Some(Arc::new(manifest)),
        ..river("rivers", None)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn rivers_of_a_year_are_shared_out_to_the_steps_of_the_budget() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("wavy"), Quantity::CarbonFlux);
    land(&store, &id, flux, COARSE, &wavy_year(&COARSE)).await;
    let rivers = yearly_rivers(&store, |_| true).await;
    let engine = Engine::local(store);
    let query = BudgetQuery {
        step: TimeStep::Native,
        river: Some(rivers),
        ..total(&id, "-60,-60,0,60")
    };
    let answer = ask(&engine, &query).await;
    assert_eq!(answer.rows.len(), 12);
    let year = ask(&engine, &total(&product("rivers"), "-60,-60,0,60")).await;
    let year_tg = year.rows[0].budget_tg;
    let river_tg = |at: usize| answer.rows[at].river.unwrap().river_tg;
    let sum_tg: f64 = (0..12).map(river_tg).sum();
    assert!((sum_tg / year_tg - 1.0).abs() < 1e-12, "{sum_tg} {year_tg}");
    let january_tg = year_tg * 31.0 / 366.0;
    assert!((river_tg(0) / january_tg - 1.0).abs() < 1e-9);
    // Rivers that cover all of the sea are taken off without a word.
    assert!(!answer.notes.iter().any(|note| note.contains("river flux")));
}

#[tokio::test(flavor = "multi_thread")]
async fn rivers_of_a_part_of_the_sea_are_told_to_be_of_that_part() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("wavy"), Quantity::CarbonFlux);
    land(&store, &id, flux, COARSE, &wavy_year(&COARSE)).await;
    // East of 30 degrees west alone.
    let rivers = yearly_rivers(&store, |col| col >= 5).await;
    let engine = Engine::local(store);
    let query = BudgetQuery {
        river: Some(rivers),
        ..total(&id, "-60,-60,0,60")
    };
    let answer = ask(&engine, &query).await;
    let of_rivers = ask(&engine, &total(&product("rivers"), "-60,-60,0,60")).await;
    let percent = of_rivers.rows[0].coverage_percent;
    assert!((20.0..80.0).contains(&percent), "{percent}");
    let wanted = format!("river flux rivers: its data cover {percent:.1} % of the region's sea");
    let told = |note: &&String| note.starts_with(&wanted);
    assert_eq!(
        answer.notes.iter().filter(told).count(),
        1,
        "{:?}",
        answer.notes
    );
    let (river_tg, of_part_tg) = (
        answer.rows[0].river.unwrap().river_tg,
        of_rivers.rows[0].budget_tg,
    );
    assert!((river_tg / of_part_tg - 1.0).abs() < 1e-12);
}
