//! Region files: their budgets against boxes, and real coast lines that nobody on this project drew.

use compute::Engine;
use compute::region::{area, geojson_file, weights};
use contract::earth::Earth;
use contract::quantity::Quantity;

use crate::fixture::{ONE_DEGREE, ask, folder_store, land, parts, product, total, wavy_year};

#[tokio::test(flavor = "multi_thread")]
async fn a_box_drawn_in_a_file_has_the_budget_of_the_box() {
    let (folder, store) = folder_store();
    let id = product("wavy");
    let year = wavy_year(&ONE_DEGREE);
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &year, 12).await;
    // Across the date line, with corners that jump there and edges inside cells.
    let text = r#"{"type":"Feature","properties":{},"geometry":{"type":"Polygon","coordinates":
        [[[170.5,-33.3],[-120.1,-33.3],[-120.1,12.7],[170.5,12.7],[170.5,-33.3]]]}}"#;
    let file = folder.path().join("box.geojson");
    std::fs::write(&file, text).unwrap();
    let drawn = compute::BudgetQuery {
        region: geojson_file::read(&file).unwrap(),
        ..total(&id, "global")
    };
    let engine = Engine::standalone(store, parts(2));
    let drawn = &ask(&engine, &drawn).await.rows[0];
    let boxed = &ask(&engine, &total(&id, "170.5,-33.3,-120.1,12.7"))
        .await
        .rows[0];
    assert!((drawn.budget_tg / boxed.budget_tg - 1.0).abs() < 1e-9);
    assert!((drawn.area_m2 / boxed.area_m2 - 1.0).abs() < 1e-9);
    assert!((drawn.region_area_m2 / boxed.region_area_m2 - 1.0).abs() < 1e-9);
}

#[test]
fn real_land_and_real_ocean_make_the_earth() {
    let Some(folder) = test_data::set("geo_natural_earth_geojson") else {
        return;
    };
    let mut sum_m2 = 0.0;
    for (name, least_m2, most_m2) in [
        ("ne_110m_land.json", 1.45e14, 1.50e14),
        ("ne_110m_ocean.json", 3.60e14, 3.65e14),
    ] {
        let region = geojson_file::read(&folder.join(name)).unwrap();
        let own_m2 = area::region_area_m2(&region, Earth::Wgs84).unwrap();
        assert!((least_m2..most_m2).contains(&own_m2), "{name} {own_m2}");
        let chunks = weights::compute(&ONE_DEGREE, &region, Earth::Wgs84).unwrap();
        let weighted_m2: f64 = chunks.iter().flat_map(|(_, areas)| areas).sum();
        assert!((weighted_m2 / own_m2 - 1.0).abs() < 1e-9, "{name}");
        sum_m2 += weighted_m2;
    }
    let earth_m2 = Earth::Wgs84.cell_area_m2(-90.0, 90.0, 360.0);
    assert!((sum_m2 / earth_m2 - 1.0).abs() < 1e-9, "{sum_m2}");
    let lines = geojson_file::read(&folder.join("ne_110m_coastline.json")).unwrap_err();
    assert!(lines.to_string().contains("a LineString has no area"));
}
