//! A product as a cube of time, latitude and longitude: Zarr v3 by the CF conventions, in an Icechunk repository whose
//! versions are whole or not there, or as plain Zarr for those who want files.
//!
//! What is written opens in xarray with right values, times and places and nothing else. Values come back bit for bit, or
//! as an error that names the array and the chunk. Left out on purpose: what the values mean (contract), how objects are
//! kept (storage), and what is done with them (the services).

mod arrays;
mod at_hand;
mod axis;
mod background;
#[cfg(test)]
mod banded_field;
mod bands;
mod blocks;
pub mod cf;
pub mod clean_up;
mod clocks;
mod compact;
mod complete;
mod description;
mod edit;
mod encoded_sums;
mod error;
mod field;
mod field_bands;
mod field_windows;
mod follow;
pub mod foreign;
mod group;
mod handing;
mod held_steps;
mod joined;
mod joining;
mod keys;
mod layer;
mod layout;
mod levels;
mod maps;
pub mod migrate;
mod names;
mod object_storage;
mod parts;
mod placing;
mod plain;
mod plan;
mod reader;
mod record;
mod repository;
mod rounding;
mod run_shards;
pub mod scale;
mod series;
mod shards;
mod stacked;
mod staged;
mod state;
mod step_bands;
mod stored_chunks;
mod summing;
mod sums;
mod unreadable;
mod values;
pub mod verify;
pub mod weight_unit;
mod windows;
mod zarr_2;
mod zarr_2_keys;

pub use arrays::{Places, places};
pub use at_hand::{AtHand, RunValues};
pub use axis::Step;
pub use background::compacted;
pub use bands::{Bands, WholeField};
pub use compact::compact;
pub use description::Description;
pub use edit::{Committed, Edit};
pub use encoded_sums::EncodedSums;
pub use error::CubeError;
pub use field_bands::FieldBands;
pub use follow::{
    Followed, Follower, folder, follow, follow_with, keep_up, keep_up_as, keep_up_with,
};
pub use joined::{joined_window, range_of_field};
pub use joining::WHOLLY_COVERED;
pub use keys::Keys;
pub use layout::{BLOCK_CELLS, Layout, RUN_STEPS};
pub use plain::PlainZarr;
pub use reader::{Cube, LevelWindow};
pub use record::{Numbers, Record};
pub use repository::{At, Repository};
pub use stored_chunks::Undecoded;
pub use sums::Basis;
pub use values::{Block, EncodedBlocks, Piece, Values};
pub use windows::CellAt;
pub use zarr_2::ZarrVersion;
