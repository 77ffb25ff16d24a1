//! What lies durable between services: objects, manifests, fields, weights and the event log.
//! What is read is checked: a damaged object is an error that names it, never a value.
//!
//! Every service reads and writes through this crate, so that a layout has one writer and one reader. Left out on
//! purpose: what the values mean (contract) and what is done with them (the services).

pub mod attached;
mod attached_mark;
pub mod content;
pub mod contributed;
pub mod document;
pub mod domain;
pub mod error;
mod failure;
pub mod fields;
pub mod gc;
pub mod log;
pub mod manifests;
mod off_thread;
mod parquet_table;
pub mod pins;
pub mod refusal;
pub mod row_check;
pub mod rows;
pub mod sound;
pub mod spool;
pub mod store;
mod values;
pub mod verify;
pub mod weights;

pub use error::StorageError;
pub use store::Store;
pub use values::Encoded;
