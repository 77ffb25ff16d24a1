use std::sync::Arc;

use contract::computed::Matching;
use contract::grid::Grid;
use contract::time::Period;
use datafusion::arrow::array::{AsArray as _, StringArray};
use datafusion::arrow::datatypes::DataType;
use datafusion::error::DataFusionError;
use datafusion::logical_expr::{ColumnarValue, ScalarUDF, Volatility, create_udf};
use serde_json::json;
use storage::{Store, fields};

use super::*;

const GRID: Grid = Grid {
    rows: 2,
    cols: 4,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 90.0,
    dlon_deg: 90.0,
};

/// Lands a wind of one month.
async fn land_wind(store: &Store) {
    let product = "wind".parse().unwrap();
    let period = Period::month(2000, 1).unwrap();
    let values: Vec<f32> = (0..8u8).map(f32::from).collect();
    let field = fields::write(store, &product, &GRID, &values, period).await;
    let domain = domain::write(store, &product, &[true; 8]).await;
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        product,
        number: 1,
        title: "Wind".to_owned(),
        quantity: Quantity::WindSpeed,
        synthetic: true,
        source: "made by a test".to_owned(),
        grid: GRID,
        steps: vec![Step {
            masked: None,
            period,
            field: field.unwrap(),
            raw_sha256: Digest::of(b"wind"),
            origin: "wind.nc".to_owned(),
            valid_cells: 8,
            contributed: None,
        }],
        domain: domain.unwrap(),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
    };
    manifests::commit(store, &manifest).await.unwrap();
}

fn doubled() -> Request {
    Request {
        target: "doubled".parse().unwrap(),
        title: None,
        quantity: Some(Quantity::WindSpeed),
        how: Computation::Expression {
            expression: "2 * wind".to_owned(),
        },
        grid: None,
        inputs: vec![RequestedInput {
            name: "wind".to_owned(),
            product: "wind".parse().unwrap(),
            matching: Matching::SamePeriod,
        }],
        from: None,
        to: None,
    }
}

/// An executor's function that tells another method, or none as those of before did.
fn of_method(told: Option<u32>) -> ScalarUDF {
    let answer = move |args: &[ColumnarValue]| -> Result<ColumnarValue, DataFusionError> {
        let args = ColumnarValue::values_to_arrays(args)?;
        let made = |task: Option<&str>| {
            let task: FieldTask = serde_json::from_str(task.unwrap()).unwrap();
            let (index, field) = (task.index, &task.fields[0]);
            let mut made = json!({ "index": index, "field": field, "valid_cells": 8, "implausible": 0, "outside": {} });
            if let Some(method) = told {
                made["method"] = method.into();
            }
            Some(made.to_string())
        };
        let made: StringArray = args[1].as_string::<i32>().iter().map(made).collect();
        Ok(ColumnarValue::Array(Arc::new(made)))
    };
    let texts = vec![DataType::Utf8; 2];
    let volatile = Volatility::Volatile;
    create_udf(
        COMPUTED_FIELD,
        texts,
        DataType::Utf8,
        volatile,
        Arc::new(answer),
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn what_an_executor_made_by_another_method_is_refused_and_does_not_land() {
    let store = Store::memory();
    land_wind(&store).await;
    let engine = Engine::local(store.clone());
    for (told, expected) in [(None, 1), (Some(METHOD + 1), METHOD + 1)] {
        let other = engine.with_function(of_method(told)).await;
        let refused = compute(&other, &doubled(), &|_| ()).await.unwrap_err();
        let ComputeError::OtherMethod { theirs, own, .. } = &refused else {
            panic!("{refused}");
        };
        assert_eq!((*theirs, *own), (expected, METHOD));
        let text = refused.to_string();
        assert!(text.contains("doubled was computed by an executor of another version"));
        assert!(refused.is_retryable(), "{text}");
        let landed = manifests::latest(&store, &doubled().target).await;
        assert_eq!(landed.unwrap(), None, "{told:?}");
    }
    let own = compute(&engine, &doubled(), &|_| ()).await.unwrap();
    assert_eq!((own.manifest.number, own.manifest.steps.len()), (1, 1));
}
