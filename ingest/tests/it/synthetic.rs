//! Generated products land, say that they are synthetic, and keep their gaps.

use contract::quantity::Quantity;
use ingest::Outcome;

use crate::fixture::Place;

#[tokio::test]
async fn the_generated_file_lands_as_synthetic() {
    let place = Place::new();
    let path = place.path("china-sea.nc");
    let months = ingest::GeneratedSteps::Months;
    ingest::generate_china_sea(&path, 0.05, 1, months, &|_, _| {}).unwrap();
    let outcomes = place.land(&[path]).await;
    assert!(
        matches!(&outcomes[0], Outcome::Landed { periods, .. } if periods.len() == 12),
        "{}",
        outcomes[0]
    );
    let manifest = place.newest("china-sea-synthetic").await;
    assert!(manifest.synthetic && manifest.title.contains("SYNTHETIC"));
    assert_eq!(manifest.quantity, Quantity::CarbonFlux);
    let grid = manifest.grid;
    assert_eq!(
        (grid.rows, grid.cols, grid.north_deg, grid.west_deg),
        (123, 90, 41.0, 100.0)
    );
    assert_eq!(manifest.steps[1].period.seconds(), 28.0 * 86_400.0);
    let values = place.values(&manifest, 0).await;
    let at = |lon, lat| {
        let (row, col) = grid
            .cell_at(contract::grid::LonLatDeg { lon, lat })
            .unwrap();
        values[(row * grid.cols + col) as usize]
    };
    assert!(at(110.0, 38.0).is_nan(), "inland China is land");
    let valid = manifest.steps[0].valid_cells as f64 / grid.cell_count() as f64;
    assert!(
        (0.25..0.65).contains(&valid),
        "{valid} of the cells are sea without cloud"
    );
}

#[tokio::test]
async fn the_generated_globe_lands_as_synthetic_with_land_where_land_is() {
    let place = Place::new();
    let path = place.path("globe.nc");
    let days = ingest::GeneratedSteps::Days(2);
    ingest::generate_globe(&path, 1.0, 1, days, &|_, _| {}).unwrap();
    let outcomes = place.land(&[path]).await;
    assert!(
        matches!(&outcomes[0], Outcome::Landed { periods, .. } if periods.len() == 2),
        "{}",
        outcomes[0]
    );
    let manifest = place.newest("globe-synthetic").await;
    assert!(manifest.synthetic && manifest.title.contains("SYNTHETIC"));
    assert_eq!(manifest.quantity, Quantity::CarbonFlux);
    let grid = manifest.grid;
    assert_eq!(
        (grid.rows, grid.cols, grid.north_deg, grid.west_deg),
        (180, 360, 90.0, -180.0)
    );
    assert_eq!(manifest.steps[1].period.seconds(), 86_400.0);
    let values = place.values(&manifest, 0).await;
    let share_with_data = |west: i32, south: i32| {
        let cells = (0..100).filter(|i| {
            let [lon, lat] = [west + i % 10, south + i / 10].map(|at| f64::from(at) + 0.5);
            let (row, col) = grid
                .cell_at(contract::grid::LonLatDeg { lon, lat })
                .unwrap();
            !values[(row * grid.cols + col) as usize].is_nan()
        });
        cells.count()
    };
    assert_eq!(share_with_data(15, 15), 0, "the Sahara is land");
    let at_sea = [(-150, -10), (-40, 20), (70, -30), (175, 40)];
    let with_data: usize = at_sea.iter().map(|(w, s)| share_with_data(*w, *s)).sum();
    assert!((200..400).contains(&with_data), "{with_data} of 400");
}
