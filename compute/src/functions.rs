//! The SQL functions of this crate: thin wrappers that hand Arrow lists to the array kernels.
//!
//! Every session that plans or runs our queries (client, scheduler, executor) gets them from here.

mod accumulate;
mod column_sum;
mod computed;
mod has_data;
mod lists;
mod merge_accumulated;
mod sound;

use std::sync::Arc;

use datafusion::logical_expr::async_udf::AsyncScalarUDF;
use datafusion::logical_expr::{AggregateUDF, ScalarUDF};

pub(crate) use accumulate::NAME as ACCUMULATE;
pub(crate) use computed::{FIELD as COMPUTED_FIELD, SERIES as COMPUTED_EXTENT};

use crate::Objects;
use crate::expression::udf::number_functions;

/// Every scalar function; those that accumulate read values and weights from `objects`, those that compute products store
/// them there.
pub fn scalar_functions(objects: &Objects) -> Vec<Arc<ScalarUDF>> {
    let accumulate = accumulate::Accumulate::new(objects.clone());
    let [fields, series] = computed::both(objects);
    let stored = [
        AsyncScalarUDF::new(Arc::new(fields)).into_scalar_udf(),
        AsyncScalarUDF::new(Arc::new(series)).into_scalar_udf(),
        AsyncScalarUDF::new(Arc::new(accumulate)).into_scalar_udf(),
        ScalarUDF::from(has_data::HasData::new()),
        ScalarUDF::from(sound::Sound::new()),
    ];
    stored
        .into_iter()
        .chain(number_functions())
        .map(Arc::new)
        .collect()
}

/// Every aggregate function.
pub fn aggregate_functions() -> Vec<Arc<AggregateUDF>> {
    vec![
        Arc::new(AggregateUDF::from(column_sum::ColumnSum::new())),
        Arc::new(AggregateUDF::from(
            merge_accumulated::MergeAccumulated::new(),
        )),
    ]
}
