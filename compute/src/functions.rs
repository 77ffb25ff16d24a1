//! The SQL functions of this crate: thin wrappers that hand Arrow lists to the array kernels.
//!
//! Every session that plans or runs our queries (client, scheduler, executor) gets them from here.

mod cell_mass;
mod column_sum;
mod lists;
mod region_area;
mod series_at;

use std::sync::Arc;

use datafusion::logical_expr::{AggregateUDF, ScalarUDF};

/// Every scalar function.
pub fn scalar_functions() -> Vec<Arc<ScalarUDF>> {
    [
        ScalarUDF::from(cell_mass::CellMass::new()),
        ScalarUDF::from(region_area::ValidArea::new()),
        ScalarUDF::from(region_area::TotalArea::new()),
        ScalarUDF::from(series_at::SeriesAt::new()),
    ]
    .map(Arc::new)
    .to_vec()
}

/// Every aggregate function.
pub fn aggregate_functions() -> Vec<Arc<AggregateUDF>> {
    vec![Arc::new(AggregateUDF::from(column_sum::ColumnSum::new()))]
}
