//! The homes that tests keep observations in: a folder, and a schema of its own in the running PostGIS.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use observations::{FileStore, ObservationSettings, ObservationStore, PostgisStore};
use storage::Store;

/// A home that is gone with its value, or with [`Home::close`].
pub(crate) enum Home {
    Files {
        store: FileStore,
        _folder: tempfile::TempDir,
    },
    Postgis {
        store: PostgisStore,
        settings: ObservationSettings,
    },
}

impl Home {
    pub(crate) fn files() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path().to_str().unwrap()).unwrap();
        Self::Files {
            store: FileStore::new(store),
            _folder: folder,
        }
    }

    pub(crate) fn postgis() -> Self {
        let settings = settings();
        Self::Postgis {
            store: PostgisStore::new(&settings.database().unwrap().unwrap()).unwrap(),
            settings,
        }
    }

    pub(crate) fn store(&self) -> &dyn ObservationStore {
        match self {
            Self::Files { store, .. } => store,
            Self::Postgis { store, .. } => store,
        }
    }

    /// Another handle on the same home.
    pub(crate) fn shared(&self) -> Box<dyn ObservationStore> {
        match self {
            Self::Files { store, .. } => Box::new(store.clone()),
            Self::Postgis { settings, .. } => {
                Box::new(PostgisStore::new(&settings.database().unwrap().unwrap()).unwrap())
            }
        }
    }

    /// Removes what the test left in a server.
    pub(crate) async fn close(self) {
        if let Self::Postgis { settings, .. } = self {
            drop_schema(&settings).await;
        }
    }
}

/// Settings with a schema of their own in the running PostGIS.
pub(crate) fn settings() -> ObservationSettings {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let text = |name: &str| std::env::var_os(name).and_then(|value| value.into_string().ok());
    let url = text("FLUXGLOBE_POSTGIS");
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    ObservationSettings {
        postgis: Some(url.expect(
            "these tests need a running PostGIS in FLUXGLOBE_POSTGIS: deploy/services/services.sh starts one and says where, make test does both",
        )),
        postgis_password_file: text("FLUXGLOBE_POSTGIS_PASSWORD_FILE").map(PathBuf::from),
        postgis_schema: format!("test_{}_{number}", std::process::id()),
        ..ObservationSettings::files()
    }
}

/// A connection of the test's own.
pub(crate) async fn connect(settings: &ObservationSettings) -> tokio_postgres::Client {
    let mut config: tokio_postgres::Config = settings.postgis.as_ref().unwrap().parse().unwrap();
    if let Some(file) = &settings.postgis_password_file {
        config.password(std::fs::read_to_string(file).unwrap().trim());
    }
    config.ssl_mode(tokio_postgres::config::SslMode::Disable);
    let (client, connection) = config.connect(tokio_postgres::NoTls).await.unwrap();
    tokio::spawn(connection);
    client
}

pub(crate) async fn drop_schema(settings: &ObservationSettings) {
    let client = connect(settings).await;
    let statement = format!("DROP SCHEMA IF EXISTS {} CASCADE", settings.postgis_schema);
    client.batch_execute(&statement).await.unwrap();
}
