//! Cubes as their users meet them: written, read, changed by two, damaged.

#![expect(clippy::unwrap_used, reason = "a test ends where it cannot go on")]

mod at_hand;
mod compacting;
mod damage;
mod follow;
mod frozen;
mod kept;
mod landing_reads;
mod levels;
mod migrate;
mod plain;
mod product;
mod rivals;
mod round_trip;
mod series;
mod shard_gaps;
mod watched;
mod windows;
mod zarr_2;
