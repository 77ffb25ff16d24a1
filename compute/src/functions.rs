//! The SQL functions of this crate: thin wrappers that hand Arrow lists to the array kernels.
//!
//! Every session that plans or runs our queries (client, scheduler, executor) gets them from here.

mod accumulate;
mod band_sums;
mod column_sum;
mod has_data;
mod lists;
mod merge_accumulated;
mod region_sums;
mod sound;

use std::sync::Arc;

use datafusion::logical_expr::async_udf::AsyncScalarUDF;
use datafusion::logical_expr::{AggregateUDF, ScalarUDF};

use crate::Objects;

/// Every scalar function; those that sum over a region read its weights from `objects`.
pub fn scalar_functions(objects: &Objects) -> Vec<Arc<ScalarUDF>> {
    let region_sums = region_sums::RegionSums::new(objects.clone());
    let band_sums = band_sums::BandSums::new(objects.clone());
    let accumulate = accumulate::Accumulate::new(objects.clone());
    [
        AsyncScalarUDF::new(Arc::new(region_sums)).into_scalar_udf(),
        AsyncScalarUDF::new(Arc::new(band_sums)).into_scalar_udf(),
        AsyncScalarUDF::new(Arc::new(accumulate)).into_scalar_udf(),
        ScalarUDF::from(has_data::HasData::new()),
        ScalarUDF::from(sound::Sound::new()),
    ]
    .map(Arc::new)
    .to_vec()
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
