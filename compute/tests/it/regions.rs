//! Region files: their budgets against boxes, and real coast lines that nobody on this project drew.

use std::process::Command;

use compute::Engine;
use compute::region::{extent, file, weights};
use contract::budget::BudgetQuery;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::region::{Cells, Region};
use contract::time::Period;

use crate::fixture::{ONE_DEGREE, ask, folder_store, land, parts, product, total, wavy_year};

#[tokio::test(flavor = "multi_thread")]
async fn a_box_drawn_in_a_file_has_the_budget_of_the_box() {
    let (folder, store) = folder_store();
    let id = product("wavy");
    let year = wavy_year(&ONE_DEGREE);
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &year).await;
    // Across the date line, once with longitudes past 180, with edges inside cells.
    let text = r#"{"type":"Feature","properties":{},"geometry":{"type":"Polygon","coordinates":
        [[[170.5,-33.3],[239.9,-33.3],[239.9,12.7],[170.5,12.7],[170.5,-33.3]]]}}"#;
    let path = folder.path().join("box.geojson");
    std::fs::write(&path, text).unwrap();
    let drawn = BudgetQuery {
        region: file::read(&path).unwrap(),
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
        let region = file::read(&folder.join(name)).unwrap();
        let own_m2 = extent::region_area_m2(&region, Earth::Wgs84).unwrap();
        assert!((least_m2..most_m2).contains(&own_m2), "{name} {own_m2}");
        let chunks = weights::compute(&ONE_DEGREE, &region, Earth::Wgs84).unwrap();
        let weighted_m2: f64 = chunks.iter().flat_map(|(_, areas)| areas).sum();
        assert!((weighted_m2 / own_m2 - 1.0).abs() < 1e-9, "{name}");
        sum_m2 += weighted_m2;
    }
    let earth_m2 = Earth::Wgs84.cell_area_m2(-90.0, 90.0, 360.0);
    assert!((sum_m2 / earth_m2 - 1.0).abs() < 1e-9, "{sum_m2}");
    let lines = file::read(&folder.join("ne_110m_coastline.json")).unwrap_err();
    assert!(lines.to_string().contains("a LineString has no area"));
}

#[derive(serde::Deserialize)]
struct Reference {
    kind: String,
    area_m2: f64,
}

/// Weights of a region on a grid, m² in all.
fn weighed_m2(grid: &Grid, region: &Region) -> f64 {
    let chunks = weights::compute(grid, region, Earth::Wgs84).unwrap();
    chunks.iter().flat_map(|(_, areas)| areas).sum()
}

#[test]
fn areas_of_500_regions_are_those_that_another_program_finds() {
    let folder = tempfile::tempdir().unwrap();
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/reference/region_areas.py"
    );
    let run = Command::new(test_data::python())
        .arg(script)
        .arg(folder.path())
        .output()
        .unwrap();
    let talk = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{script}: {talk}");
    let text = std::fs::read_to_string(folder.path().join("areas.json")).unwrap();
    let references: Vec<Reference> = serde_json::from_str(&text).unwrap();
    assert_eq!(references.len(), 500);
    let mut worst = std::collections::BTreeMap::new();
    for (index, Reference { kind, area_m2 }) in references.iter().enumerate() {
        let of = |ending: &str| {
            let file = folder.path().join(format!("{index:03}.{ending}"));
            file::read(&file).unwrap_or_else(|e| panic!("{kind}: {e}"))
        };
        let region = of("geojson");
        let own_m2 = extent::region_area_m2(&region, Earth::Wgs84).unwrap();
        // Two readers of one decimal number may differ in its last bit.
        let as_text_m2 = extent::region_area_m2(&of("wkt"), Earth::Wgs84).unwrap();
        assert!((as_text_m2 / own_m2 - 1.0).abs() < 1e-9, "{kind} {index}");
        let weighed_m2 = weighed_m2(&ONE_DEGREE, &region);
        for ours_m2 in [own_m2, weighed_m2] {
            let off = (ours_m2 / area_m2 - 1.0).abs();
            let most: &mut f64 = worst.entry(kind.as_str()).or_default();
            *most = most.max(off);
            assert!(
                off < 1e-6,
                "{kind} {index}: {ours_m2} against {area_m2}, off by {off:.1e}"
            );
        }
    }
    eprintln!("farthest off, by kind: {worst:?}");
}

#[test]
fn a_rectangle_is_the_same_region_as_text_geojson_and_well_known_text() {
    for [west, south, east, north] in [[-100.0, -20.0, 100.0, 35.5], [170.0, -10.0, 190.0, 10.0]] {
        let corners = [
            [west, south],
            [east, south],
            [east, north],
            [west, north],
            [west, south],
        ];
        let boxed: Region = format!("{west},{south},{east},{north}").parse().unwrap();
        let geojson = serde_json::json!({"type": "Polygon", "coordinates": [corners]}).to_string();
        let places = corners.map(|[lon, lat]| format!("{lon} {lat}")).join(", ");
        for text in [
            geojson,
            format!("POLYGON(({places}))"),
            format!("MULTIPOLYGON((({places})))"),
        ] {
            let drawn: Region = text.parse().unwrap();
            let (own, expected) = (
                extent::region_area_m2(&drawn, Earth::Wgs84).unwrap(),
                extent::region_area_m2(&boxed, Earth::Wgs84).unwrap(),
            );
            assert!(
                (own / expected - 1.0).abs() < 1e-12,
                "{text}: {own} {expected}"
            );
            let (own, expected) = (
                weighed_m2(&ONE_DEGREE, &drawn),
                weighed_m2(&ONE_DEGREE, &boxed),
            );
            assert!(
                (own / expected - 1.0).abs() < 1e-12,
                "{text}: {own} {expected}"
            );
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn coverage_is_of_the_sea_and_gaps_are_estimated_apart() {
    /// 2⁻³⁰ kg m⁻² s⁻¹: an f32 holds it exactly.
    const FLUX: f32 = 1.0 / (1u32 << 30) as f32;
    let (_folder, store) = folder_store();
    let month = Period::month(2000, 1).unwrap();
    // Values everywhere, on land too; the second product lacks every second column between 30 and 40 degrees south.
    let full = vec![FLUX; ONE_DEGREE.cell_count()];
    let mut holed = full.clone();
    for (index, value) in holed.iter_mut().enumerate() {
        if (120..130).contains(&(index / 360)) && (index % 360).is_multiple_of(2) {
            *value = f32::NAN;
        }
    }
    for (name, values) in [("full", full), ("holed", holed)] {
        let steps = [(month, values)];
        land(
            &store,
            &product(name),
            Quantity::CarbonFlux,
            ONE_DEGREE,
            &steps,
        )
        .await;
    }
    let engine = Engine::standalone(store, parts(2));
    let of = |name: &str, region: &str, cells| {
        let query = BudgetQuery {
            cells,
            ..total(&product(name), region)
        };
        let engine = &engine;
        async move { ask(engine, &query).await }
    };
    let kg_per_m2 = f64::from(FLUX) * 31.0 * 86_400.0;
    let close = |a: f64, b: f64, by: f64| assert!((a / b - 1.0).abs() < by, "{a} {b}");

    let globe = of("full", "global", Cells::Whole).await;
    let earth_m2 = Earth::Wgs84.cell_area_m2(-90.0, 90.0, 360.0);
    close(globe.region_area_m2, earth_m2, 1e-12);
    close(globe.ocean_area_m2, 362.9e12, 1e-3);
    close(globe.rows[0].budget_tg, kg_per_m2 * earth_m2 / 1e9, 1e-9);
    close(globe.rows[0].ocean_with_data_m2, globe.ocean_area_m2, 1e-8);
    close(globe.rows[0].coverage_percent, 100.0, 1e-8);
    assert_eq!(
        (globe.rows[0].gap_tg, globe.cells),
        (Some(0.0), Cells::Whole)
    );
    assert!(globe.notes.is_empty() && globe.gap_basis.contains("5 degrees"));
    let share = of("full", "global", Cells::OceanShare).await;
    close(
        share.rows[0].budget_tg,
        kg_per_m2 * globe.ocean_area_m2 / 1e9,
        1e-8,
    );
    close(share.rows[0].area_m2, globe.ocean_area_m2, 1e-8);

    // South of Africa: what is there and what the gaps would be make the whole again.
    for cells in [Cells::Whole, Cells::OceanShare] {
        let full = of("full", "0,-45,40,-30", cells).await;
        let holed = of("holed", "0,-45,40,-30", cells).await;
        let row = &holed.rows[0];
        assert!(row.budget_tg < 0.8 * full.rows[0].budget_tg, "{row:?}");
        assert!((50.0..80.0).contains(&row.coverage_percent), "{row:?}");
        let missing_m2 = holed.ocean_area_m2 - row.ocean_with_data_m2;
        close(row.gap_area_m2, missing_m2, 1e-6);
        close(row.gap_tg.unwrap(), kg_per_m2 * missing_m2 / 1e9, 1e-6);
    }
    let inland = of("full", "5,20,10,25", Cells::Whole).await;
    assert_eq!(
        (inland.ocean_area_m2, inland.rows[0].coverage_percent),
        (0.0, 0.0)
    );
    assert!(inland.rows[0].budget_tg > 0.0 && inland.notes[0].contains("no sea"));
}
