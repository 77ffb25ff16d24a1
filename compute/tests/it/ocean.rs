//! What of a cell is sea: by a landed product's shares, for every way to ask; and what cannot say it.

use std::sync::Arc;

use compute::budget::budget;
use compute::stats::region_series;
use compute::{ComputeError, Engine, ErrorClass};
use contract::budget::BudgetQuery;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::region::Cells;
use contract::series::RegionSeriesQuery;
use contract::time::Period;
use storage::Store;

use crate::fixture::{ask, folder_store, land, parts, product, total};

/// Two chunks side by side; rows 0 and 1 lie in one band of latitude, row 2 in the next.
const GRID: Grid = Grid {
    rows: 3,
    cols: 130,
    north_deg: 15.0,
    west_deg: -180.0,
    dlat_deg: 2.5,
    dlon_deg: 2.5,
};
/// 2⁻³⁰ kg m⁻² s⁻¹: an f32 holds it exactly.
const FLUX: f32 = 1.0 / (1u32 << 30) as f32;
const SECONDS: f64 = 31.0 * 86_400.0;

fn month() -> Period {
    Period::month(2000, 1).unwrap()
}

/// Share of land: quarters by column, row 2 all land.
fn land_share(index: usize) -> f32 {
    match index / 130 {
        2 => 1.0,
        _ => (index % 4) as f32 / 4.0,
    }
}

async fn mask(store: &Store, name: &str, quantity: Quantity, grid: Grid) -> Arc<Manifest> {
    let share = |index| match quantity {
        Quantity::SeaAreaFraction => 1.0 - land_share(index),
        _ => land_share(index),
    };
    let values = (0..grid.cell_count()).map(share).collect();
    Arc::new(land(store, &product(name), quantity, grid, &[(month(), values)]).await)
}

/// A flux everywhere but in column 7.
async fn flux(store: &Store) -> Manifest {
    let value = |index: usize| if index % 130 == 7 { f32::NAN } else { FLUX };
    let values = (0..GRID.cell_count()).map(value).collect();
    let flux = Quantity::CarbonFlux;
    land(store, &product("even"), flux, GRID, &[(month(), values)]).await
}

fn asked(region: &str, cells: Cells, ocean: Option<&Arc<Manifest>>) -> BudgetQuery {
    BudgetQuery {
        cells,
        ocean: ocean.cloned(),
        ..total(&product("even"), region)
    }
}

/// Sum over the cells that a condition on row and column holds for, m², each by its share of sea.
fn sea_m2(is_asked: impl Fn(usize, usize) -> bool) -> f64 {
    (0..GRID.cell_count())
        .filter(|index| is_asked(index / 130, index % 130))
        .map(|index| {
            let share = 1.0 - f64::from(land_share(index));
            share * GRID.cell_area_m2((index / 130) as u32, Earth::Wgs84)
        })
        .sum()
}

fn close(a: f64, b: f64) {
    assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_product_says_what_of_a_cell_is_sea_as_land_or_as_sea() {
    let (_folder, store) = folder_store();
    flux(&store).await;
    let land = mask(&store, "land", Quantity::LandAreaFraction, GRID).await;
    let sea = mask(&store, "sea", Quantity::SeaAreaFraction, GRID).await;
    let engine = Engine::standalone(store, parts(2));
    for (ocean, said) in [
        (&land, "1 less land_area_fraction"),
        (&sea, "sea_area_fraction"),
    ] {
        let share = ask(&engine, &asked("global", Cells::OceanShare, Some(ocean))).await;
        let (row, held_m2) = (&share.rows[0], sea_m2(|_, col| col != 7));
        close(row.budget_tg * 1e9, f64::from(FLUX) * SECONDS * held_m2);
        close(row.area_m2, held_m2);
        close(share.ocean_area_m2, sea_m2(|_, _| true));
        close(row.coverage_percent, 100.0 * held_m2 / sea_m2(|_, _| true));
        // The gap is column 7, whose share of sea is a quarter; nothing of row 2 is.
        close(row.gap_area_m2, sea_m2(|_, col| col == 7));
        assert!(
            share.ocean_source.starts_with(&ocean.id().to_string())
                && share.ocean_source.contains(said),
            "{}",
            share.ocean_source
        );
        // The grid is a part of the globe, and nobody says what lies beyond it.
        let note = share.notes.iter().find(|note| note.contains("on the grid"));
        assert!(note.is_some(), "{:?}", share.notes);
        // Whole cells stay whole, whoever says what is sea.
        let whole = ask(&engine, &asked("global", Cells::Whole, Some(ocean))).await;
        let coast = ask(&engine, &asked("global", Cells::Whole, None)).await;
        assert_eq!(whole.rows[0].budget_kg, coast.rows[0].budget_kg);
        assert!(coast.ocean_source.contains("Natural Earth"));
        assert_ne!(coast.ocean_area_m2.to_bits(), whole.ocean_area_m2.to_bits());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_region_inside_of_the_grid_has_the_sea_of_its_part_of_every_cell() {
    let (_folder, store) = folder_store();
    flux(&store).await;
    let land = mask(&store, "land", Quantity::LandAreaFraction, GRID).await;
    let engine = Engine::local(store);
    // Columns 1 to 3 and half of column 4, all of rows 0 and 1.
    let region = "-177.5,10,-168.75,15";
    let answer = ask(&engine, &asked(region, Cells::OceanShare, Some(&land))).await;
    let columns_m2 = sea_m2(|row, col| row < 2 && (1..4).contains(&col));
    let half_m2 = 0.5 * sea_m2(|row, col| row < 2 && col == 4);
    close(answer.ocean_area_m2, columns_m2 + half_m2);
    close(answer.rows[0].coverage_percent, 100.0);
    assert!(answer.notes.is_empty(), "{:?}", answer.notes);
    let inland = ask(
        &engine,
        &asked("-177.5,7.5,-170,10", Cells::OceanShare, Some(&land)),
    )
    .await;
    assert_eq!(
        (inland.ocean_area_m2, inland.rows[0].coverage_percent),
        (0.0, 0.0)
    );
    assert!(inland.notes[0].contains("no sea"), "{:?}", inland.notes);
    let series = RegionSeriesQuery {
        product: product("even"),
        region: region.parse().unwrap(),
        region_name: region.to_owned(),
        from: None,
        to: None,
        earth: Earth::Wgs84,
        ocean: Some(Arc::clone(&land)),
    };
    let series = region_series(&engine, &series).await.unwrap();
    close(series.ocean_area_m2, answer.ocean_area_m2);
    close(series.series[0].coverage_percent, 100.0);
    assert!(
        series.ocean_source.contains("land@1"),
        "{}",
        series.ocean_source
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_say_what_is_sea_is_refused_with_both_named() {
    let (_folder, store) = folder_store();
    flux(&store).await;
    let engine = Engine::local(store.clone());
    let refused = async |ocean: &Arc<Manifest>, region: &str| {
        let query = asked(region, Cells::OceanShare, Some(ocean));
        let error = budget(&engine, &query).await.unwrap_err();
        assert!(matches!(error, ComputeError::OceanShares { .. }), "{error}");
        assert_eq!(error.class(), ErrorClass::BadRequest);
        error.to_string()
    };
    let shifted = Grid {
        west_deg: -178.75,
        ..GRID
    };
    let other = mask(&store, "other", Quantity::LandAreaFraction, shifted).await;
    let said = refused(&other, "global").await;
    let names = ["other cannot say", "that of even is", "-178.75", "3 x 130"];
    assert!(names.iter().all(|name| said.contains(name)), "{said}");

    let ice = mask(&store, "ice", Quantity::IceFraction, GRID).await;
    let said = refused(&ice, "global").await;
    assert!(said.contains("sea_area_fraction"), "{said}");
    // What it holds is told by its name.
    let basins = Quantity::open("basin_code", "1", "Basins").unwrap();
    let basins = mask(&store, "basins", basins, GRID).await;
    let said = refused(&basins, "global").await;
    assert!(said.contains("it holds basin_code; land"), "{said}");

    let values = vec![0.5; GRID.cell_count()];
    let steps = [1, 2].map(|m| (Period::month(2000, m).unwrap(), values.clone()));
    let sea = Quantity::SeaAreaFraction;
    let twice = land(&store, &product("twice"), sea, GRID, &steps).await;
    let said = refused(&Arc::new(twice), "global").await;
    assert!(said.contains("2 steps"), "{said}");

    let mut holed = values;
    holed[3] = f32::NAN;
    let holed = land(&store, &product("holed"), sea, GRID, &[(month(), holed)]).await;
    let holed = Arc::new(holed);
    let said = refused(&holed, "global").await;
    assert!(
        said.contains("1 cells") && said.contains("frames/holed/"),
        "{said}"
    );
    // Where the region does not touch it, it does not matter.
    let query = asked("-160,10,-150,15", Cells::OceanShare, Some(&holed));
    assert!(budget(&engine, &query).await.is_ok());
}
