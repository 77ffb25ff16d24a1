//! Stored objects as tables: fields under the name that SQL uses, each row checked as it is read.

use std::panic::AssertUnwindSafe;
use std::sync::Arc;

use contract::key::ObjectKey;
use contract::kind::Vouched;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::config::TableParquetOptions;
use datafusion::datasource::file_format::parquet::ParquetFormat;
use datafusion::datasource::listing::{
    ListingOptions, ListingTable, ListingTableConfig, ListingTableUrl,
};
use datafusion::execution::context::SessionContext;
use futures::FutureExt as _;
use storage::{StorageError, Store, fields};

use crate::ComputeError;
use crate::tail_store::TAIL_BYTES;

/// What says which row of a field it is.
const KEYS: &str = "chunk, period_start, period_end";

/// Makes a table of some fields. Values come out of it only where they are what their row's check says.
///
/// Objects of before rows had checks are each compared with their name once, whole, before they are read in parts.
pub(crate) async fn register(
    context: &SessionContext,
    table: &str,
    store: &Store,
    objects: &[&ObjectKey],
) -> Result<(), ComputeError> {
    let engine = || ComputeError::engine("naming stored objects");
    let is_old = |key: &&ObjectKey| matches!(key.vouches(), Vouched::Bytes(_));
    let (old, new): (Vec<&ObjectKey>, Vec<&ObjectKey>) = objects.iter().copied().partition(is_old);
    let mut parts = vec![];
    if !new.is_empty() {
        let stored = format!("{table}_stored");
        list(context, &stored, store, &new, &fields::SCHEMA)?;
        parts.push(format!(
            "SELECT {KEYS}, sound(\"values\", \"check\", {KEYS}) AS \"values\" FROM {stored}"
        ));
    }
    if !old.is_empty() {
        store.check_once(&old).await?;
        let stored = format!("{table}_stored_1");
        list(context, &stored, store, &old, &fields::SCHEMA_1)?;
        parts.push(format!("SELECT {KEYS}, \"values\" FROM {stored}"));
    }
    let checked = context.sql(&parts.join(" UNION ALL ")).await;
    context
        .register_table(table, checked.map_err(engine())?.into_view())
        .map_err(engine())?;
    Ok(())
}

fn list(
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
    options.global.metadata_size_hint = Some(TAIL_BYTES as usize);
    options.global.pushdown_filters = true;
    // A mask over rows would have the pages of all of them fetched and decoded; runs of rows skip whole pages.
    options.global.force_filter_selections = true;
    options.global.bloom_filter_on_read = false;
    options
}

/// A question to the engine. A damaged footer can make the Parquet library panic where it should give an error: that is
/// one.
pub(crate) async fn caught<T>(
    asked: impl Future<Output = Result<T, ComputeError>>,
) -> Result<T, ComputeError> {
    match AssertUnwindSafe(asked).catch_unwind().await {
        Ok(answered) => answered,
        Err(_panic) => {
            let reason = "it gave up on what it read";
            Err(ComputeError::inconsistent("the query engine", reason))
        }
    }
}

/// An answer of the engine that read some objects; where it failed or did not fit because one of them is damaged or gone, the
/// error that names it.
///
/// The engine sees rows and pages, not objects: which one it was is found by reading each of them whole.
pub(crate) async fn or_damaged<T>(
    store: &Store,
    keys: &[&ObjectKey],
    answered: Result<T, ComputeError>,
) -> Result<T, ComputeError> {
    let error = match answered {
        Err(error @ (ComputeError::Engine { .. } | ComputeError::Inconsistent { .. })) => error,
        other => return other,
    };
    for key in keys {
        match storage::verify::sound(store, key).await {
            Err(damaged @ StorageError::Damaged { .. }) => return Err(damaged.into()),
            // The engine passes over what is not there, and answers with fewer rows.
            Err(gone) if gone.is_not_found() => return Err(gone.into()),
            // Of other errors what failed first is told.
            Ok(()) | Err(_) => {}
        }
    }
    Err(error)
}

/// Where SQL finds an object.
pub(crate) fn address(store: &Store, key: &ObjectKey) -> Result<ListingTableUrl, ComputeError> {
    ListingTableUrl::try_new(store.sql_url(key), None)
        .map_err(ComputeError::engine("naming stored objects"))
}
