//! The generated China Sea product lands, says that it is synthetic, and keeps its gaps.

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
