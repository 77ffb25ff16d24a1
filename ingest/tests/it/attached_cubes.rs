//! Cubes of this program that are attached: what is told of those whose values or steps are not all that they seem.

use std::sync::Arc;

use contract::analysis::MapStatistic;
use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::time::Period;
use cube::{Description, Edit, Repository};
use ingest::attach::{Attached, Request};
use storage::Store;

use crate::attached::{Own, request};

const GRID: Grid = Grid {
    rows: 2,
    cols: 3,
    north_deg: 1.0,
    west_deg: 10.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// Attaches the cube of a temperature in months of 2000, the same in all cells.
async fn attach(own: &Own, statistic: Option<MapStatistic>, months: &[f32]) -> Attached {
    let store = Store::open(own.path().to_str().unwrap()).unwrap();
    let description = Description {
        product: "theirs".parse().unwrap(),
        title: "Theirs, monthly climatology 1991/2020".to_owned(),
        quantity: Quantity::SeaSurfaceTemperature,
        synthetic: false,
        source: "a test".to_owned(),
        grid: GRID,
        version: None,
        statistic,
    };
    let repository = Repository::create(&store, "cube", &description).await;
    let repository = repository.unwrap();
    for (month, value) in (1..).zip(months) {
        let mut edit = Edit::begin(&repository).await.unwrap();
        let period = Period::month(2000, month).unwrap();
        edit.put(period, Arc::from([*value; 6])).await.unwrap();
        edit.commit("a step").await.unwrap();
    }
    let folder = own.path().join("cube");
    let request = Request {
        product: Some("sst".parse().unwrap()),
        ..request(folder.to_str().unwrap(), "sea_surface_temperature")
    };
    own.ask(&request).await.unwrap()
}

#[tokio::test]
async fn steps_without_any_value_are_told() {
    let own = Own::new();
    let attached = attach(&own, None, &[f32::NAN, 281.0, f32::NAN, 282.0]).await;
    assert_eq!((attached.steps, attached.read), (2, 4));
    let told = "sea_surface_temperature: holds no value in 2 of 4 steps, which are left out; the first is 2000-01-01T00:00:00Z/2000-02-01T00:00:00Z";
    assert!(
        attached.assumptions.iter().any(|own| own == told),
        "{:?}",
        attached.assumptions
    );
}

#[tokio::test]
async fn a_climatology_is_told_from_months_of_a_year() {
    for (statistic, is_told) in [(Some(MapStatistic::Climatology), true), (None, false)] {
        let own = Own::new();
        let attached = attach(&own, statistic, &[281.0, 282.0]).await;
        assert_eq!(attached.steps, 2);
        let told =
            "sea_surface_temperature: holds a climatology (Theirs, monthly climatology 1991/2020)";
        let mut all = attached.assumptions.iter();
        assert_eq!(
            all.any(|own| own.starts_with(told)),
            is_told,
            "{:?}",
            attached.assumptions
        );
    }
}
