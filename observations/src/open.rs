//! Which home of observations a setting means.

use std::sync::Arc;

use storage::Store;

use crate::error::ObservationError;
use crate::files::FileStore;
use crate::postgis::PostgisStore;
use crate::settings::ObservationSettings;
use crate::store::ObservationStore;

/// The home that the settings name: a database, or files in the object store. Nothing is connected to yet.
pub fn open(
    settings: &ObservationSettings,
    store: &Store,
) -> Result<Arc<dyn ObservationStore>, ObservationError> {
    match settings.database()? {
        Some(database) => Ok(Arc::new(PostgisStore::new(&database)?)),
        None => Ok(Arc::new(FileStore::new(store.clone()))),
    }
}
