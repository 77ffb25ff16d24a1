//! Tables that say what there is: products, and the functions of the field with their papers.

use std::sync::Arc;

use contract::manifest::Manifest;
use contract::product::ProductId;
use datafusion::arrow::array::{
    ArrayRef, BooleanArray, Float64Array, RecordBatch, StringArray, TimestampMillisecondArray,
    UInt32Array, UInt64Array,
};
use datafusion::catalog::{MemTable, TableProvider};
use futures::{StreamExt as _, TryStreamExt as _, stream};

use super::named::Named;
use super::pinned::Pinned;
use super::{analysis, budget, mean_weighted, statistics};
use crate::ComputeError;
use crate::expression::function::{ALL, Function};

pub(super) const PRODUCTS: &str = "products";
pub(super) const FUNCTIONS: &str = "functions";

/// Manifests that are read at a time.
const AT_ONCE: usize = 8;

/// A row a product, as the question reads it.
pub(super) async fn products(
    pinned: &Pinned,
    products: &[ProductId],
) -> Result<Arc<dyn TableProvider>, ComputeError> {
    let read =
        move |product: ProductId| async move { pinned.version(&Named::newest(product)).await };
    let found = stream::iter(products.to_vec()).map(read).buffered(AT_ONCE);
    let found: Vec<Option<Arc<Manifest>>> = found.try_collect().await?;
    let all: Vec<Arc<Manifest>> = found.into_iter().flatten().collect();
    let instants = |at: fn(&Manifest) -> Option<i64>| -> ArrayRef {
        let own = all.iter().map(|it| at(it));
        Arc::new(
            own.collect::<TimestampMillisecondArray>()
                .with_timezone("UTC"),
        )
    };
    let edge = |number: usize| numbers(&all, move |it| it.grid.shown_bounds_deg()[number]);
    let sides = |side: fn(&Manifest) -> u32| -> ArrayRef {
        Arc::new(UInt32Array::from_iter_values(all.iter().map(|it| side(it))))
    };
    let counts = |count: fn(&Manifest) -> u64| -> ArrayRef {
        Arc::new(UInt64Array::from_iter_values(
            all.iter().map(|it| count(it)),
        ))
    };
    let synthetic: BooleanArray = all.iter().map(|it| Some(it.synthetic)).collect();
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("name", texts(&all, |it| it.product.to_string())),
        ("version", counts(|it| it.number)),
        ("id", texts(&all, |it| it.id().to_string())),
        ("title", texts(&all, |it| it.title.clone())),
        ("quantity", texts(&all, |it| it.quantity.word().to_owned())),
        ("unit", texts(&all, |it| it.quantity.unit().to_owned())),
        (
            "shown_unit",
            texts(&all, |it| it.quantity.display().unit.to_owned()),
        ),
        (
            "shown_factor",
            numbers(&all, |it| it.quantity.display().factor),
        ),
        (
            "shown_offset",
            numbers(&all, |it| it.quantity.display().offset),
        ),
        ("steps", counts(|it| it.steps.len() as u64)),
        (
            "first",
            instants(|it| it.extent().map(|period| period.start.ms())),
        ),
        (
            "last",
            instants(|it| it.extent().map(|period| period.end.ms())),
        ),
        ("rows", sides(|it| it.grid.rows)),
        ("cols", sides(|it| it.grid.cols)),
        ("west", edge(0)),
        ("south", edge(1)),
        ("east", edge(2)),
        ("north", edge(3)),
        ("synthetic", Arc::new(synthetic)),
        ("source", texts(&all, |it| it.source.clone())),
    ];
    table(columns)
}

/// A row a function that no other SQL has.
pub(super) fn functions() -> Result<Arc<dyn TableProvider>, ComputeError> {
    let others = [
        mean_weighted::ABOUT,
        statistics::ABOUT,
        budget::ABOUT,
        analysis::ABOUT,
    ];
    let row = |it: &Function| {
        [
            it.name.to_owned(),
            it.signature(),
            it.what.to_owned(),
            it.source.to_owned(),
        ]
    };
    let others = others.map(|row| row.map(str::to_owned));
    let rows: Vec<[String; 4]> = ALL.iter().map(row).chain(others).collect();
    let column = |number: usize| texts(&rows, move |row| row[number].clone());
    table(vec![
        ("name", column(0)),
        ("signature", column(1)),
        ("what", column(2)),
        ("source", column(3)),
    ])
}

fn texts<T>(of: &[T], text: impl Fn(&T) -> String) -> ArrayRef {
    Arc::new(StringArray::from_iter_values(of.iter().map(text)))
}

fn numbers<T>(of: &[T], number: impl Fn(&T) -> f64) -> ArrayRef {
    Arc::new(Float64Array::from_iter_values(of.iter().map(number)))
}

fn table(columns: Vec<(&str, ArrayRef)>) -> Result<Arc<dyn TableProvider>, ComputeError> {
    let failed = |e| ComputeError::engine("listing what there is")(e);
    let batch = RecordBatch::try_from_iter(columns).map_err(|e| failed(e.into()))?;
    let table = MemTable::try_new(batch.schema(), vec![vec![batch]]).map_err(failed)?;
    Ok(Arc::new(table))
}
