//! Arrays that others wrote: Zarr of version 2 or 3, or an Icechunk repository, in a folder, a bucket or behind HTTP; read
//! only, whole chunks at a time, each with the checks that its codecs have.
//!
//! What a store says is not believed before it is checked: documents and chunks have a largest size before anything is
//! allocated for them, and what cannot be read rightly is an error that says what it is. Left out on purpose: what names
//! and attributes mean (the CF conventions are ingest's).

mod adapter;
mod array;
mod chunks;
mod error;
mod failures;
mod hierarchy;
mod objects;
mod read_only;
mod state;

pub use array::{Absent, ArrayKind, ForeignArray, as_stored};
pub use error::ForeignError;
pub use hierarchy::{Changed, Foreign, Found};
pub use objects::{Objects, StoredObjects};

#[cfg(test)]
mod tests;
