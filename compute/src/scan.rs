//! Stored objects as tables: frames, weights and series under the names that SQL uses.

use std::sync::Arc;

use contract::key::ObjectKey;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::config::TableParquetOptions;
use datafusion::datasource::file_format::parquet::ParquetFormat;
use datafusion::datasource::listing::{
    ListingOptions, ListingTable, ListingTableConfig, ListingTableUrl,
};
use datafusion::execution::context::SessionContext;
use storage::Store;

use crate::ComputeError;

/// What is read of a file's end at once: the footer of a frame of up to 16 groups of chunks.
const FOOTER_BYTES: usize = 16 << 10;

/// Makes a table of some objects of one layout.
pub(crate) fn register(
    context: &SessionContext,
    table: &str,
    store: &Store,
    keys: &[&ObjectKey],
    schema: &SchemaRef,
) -> Result<(), ComputeError> {
    let engine = || ComputeError::engine("naming stored objects");
    let urls = keys
        .iter()
        .map(|key| address(store, key))
        .collect::<Result<Vec<_>, _>>()?;
    let options = ListingOptions::new(Arc::new(ParquetFormat::default().with_options(reading())));
    let config = ListingTableConfig::new_with_multi_paths(urls)
        .with_listing_options(options.with_file_extension(".parquet"))
        .with_schema(Arc::clone(schema));
    let listing = ListingTable::try_new(config).map_err(engine())?;
    context
        .register_table(table, Arc::new(listing))
        .map_err(engine())?;
    Ok(())
}

/// How files of few and large rows are read.
fn reading() -> TableParquetOptions {
    let mut options = TableParquetOptions::default();
    options.global.metadata_size_hint = Some(FOOTER_BYTES);
    options.global.pushdown_filters = true;
    // A mask over rows would have the pages of all of them fetched and decoded; runs of rows skip whole pages.
    options.global.force_filter_selections = true;
    options.global.bloom_filter_on_read = false;
    options
}

/// Where SQL finds an object.
pub(crate) fn address(store: &Store, key: &ObjectKey) -> Result<ListingTableUrl, ComputeError> {
    ListingTableUrl::try_new(store.sql_url(key), None)
        .map_err(ComputeError::engine("naming stored objects"))
}
