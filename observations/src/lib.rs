//! Observations of buoys, ships, stations and profiles: kept and queried in PostGIS or in GeoParquet files.
//!
//! ```text
//! observation events, observation files -> upsert -> [PostGIS | GeoParquet] -> query, platforms, tracks
//! ```
//! One trait, [`ObservationStore`], and one suite of tests for both homes: the same calls give the same answers, byte for
//! byte as JSON. Left out on purpose: reading files (ingest) and comparing with grids (compute).

mod area;
mod batch;
mod error;
mod files;
mod filter;
mod gc;
mod key;
mod open;
mod platform;
mod postgis;
mod service;
mod settings;
mod store;
mod track;

pub use contract::observation::{
    Filter, MAX_LIMIT, Page, Platform, PlatformList, TrackPoint, TrackQuery,
};
pub use error::{ErrorClass, ObservationError};
pub use files::FileStore;
pub use gc::Datasets;
pub use open::open;
pub use postgis::PostgisStore;
pub use service::ObservationService;
pub use settings::{DatabaseSettings, ObservationSettings};
pub use store::{Counts, ObservationStore};
