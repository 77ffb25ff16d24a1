//! Series at places: values, units, edges and places that are not on the grid.

use compute::{Engine, ErrorClass, point_series};
use contract::grid::{Grid, LonLatDeg};
use contract::quantity::Quantity;
use contract::time::Period;

use crate::fixture::{folder_store, land, months, product};

/// A grid with blocks that are cut at its edges, across the date line.
const GRID: Grid = Grid {
    rows: 13,
    cols: 21,
    north_deg: 6.5,
    west_deg: 170.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// Kelvin: 280 + month + row / 100 + col / 10,000; no data in March.
fn year() -> Vec<(Period, Vec<f32>)> {
    let month = |(month, period): (usize, Period)| {
        let value =
            |i: usize| 280.0 + month as f32 + (i / 21) as f32 / 100.0 + (i % 21) as f32 / 10_000.0;
        let values = (0..GRID.cell_count()).map(|i| if month == 2 { f32::NAN } else { value(i) });
        (period, values.collect())
    };
    months(2010).into_iter().enumerate().map(month).collect()
}

#[tokio::test]
async fn a_place_has_the_series_of_its_cell_in_the_unit_people_read() {
    let (_folder, store) = folder_store();
    let manifest = land(
        &store,
        &product("sst"),
        Quantity::SeaSurfaceTemperature,
        GRID,
        &year(),
    )
    .await;
    let engine = Engine::local(store);
    for (lon, lat, row, col) in [
        (170.5, 6.0, 0, 0),
        (-169.5, -6.0, 12, 20),
        (179.99, 0.49, 6, 9),
        (-180.0, 0.0, 6, 10),
    ] {
        let answer = point_series(&engine, &product("sst"), LonLatDeg::new(lon, lat).unwrap())
            .await
            .unwrap();
        assert_eq!((answer.cell.row, answer.cell.col), (row, col));
        assert_eq!(answer.cited.unit, "°C");
        assert_eq!(answer.cited.manifest, manifest.id());
        assert_eq!(answer.series.len(), 12);
        for (month, point) in answer.series.iter().enumerate() {
            if month == 2 {
                assert_eq!(point.value, None);
                continue;
            }
            let kelvin = 280.0 + month as f64 + f64::from(row) / 100.0 + f64::from(col) / 10_000.0;
            assert!(
                (point.value.unwrap() - (kelvin - 273.15)).abs() < 1e-4,
                "{point:?}"
            );
            assert_eq!(
                point.mid,
                Period::month(2010, month as u32 + 1).unwrap().mid()
            );
        }
    }
}

#[tokio::test]
async fn a_place_outside_the_grid_is_refused_with_its_bounds() {
    let (_folder, store) = folder_store();
    land(
        &store,
        &product("sst"),
        Quantity::SeaSurfaceTemperature,
        GRID,
        &year()[..1],
    )
    .await;
    let engine = Engine::local(store);
    let outside = LonLatDeg::new(0.0, 0.0).unwrap();
    let error = point_series(&engine, &product("sst"), outside)
        .await
        .unwrap_err();
    assert_eq!(error.class(), ErrorClass::BadRequest);
    assert!(
        error.to_string().contains("170 to 191 degrees east"),
        "{error}"
    );
    let unknown = point_series(&engine, &product("nothing"), outside)
        .await
        .unwrap_err();
    assert_eq!(unknown.class(), ErrorClass::NotFound);
}
