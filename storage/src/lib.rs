//! What lies durable between services: objects, manifests, frames, series, weights and the event log.
//!
//! Every service reads and writes through this crate, so that a layout has one writer and one reader. Left out on
//! purpose: what the values mean (contract) and what is done with them (the services).

pub mod contributed;
pub mod domain;
pub mod error;
pub mod frames;
pub mod log;
pub mod manifests;
mod parquet_table;
pub mod series;
pub mod store;
pub mod weights;

pub use error::StorageError;
pub use store::Store;
