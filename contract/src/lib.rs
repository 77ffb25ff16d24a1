//! What two Fluxglobe processes must agree on: names, grids, times, units, object keys, events, jobs and tile maths.
//!
//! A type enters if two processes exchange it as bytes; a function enters if both sides must get the same answer
//! from it. Left out on purpose: input and output, async, GPU, SQL.
#![warn(missing_docs, clippy::missing_errors_doc)]

pub mod analysis;
pub mod annotation;
pub mod base_map;
pub mod budget;
pub mod camera;
pub mod check;
pub mod chunk;
pub mod cited;
pub mod colour;
pub mod computed;
pub mod context;
pub mod digest;
pub mod earth;
pub mod encoding;
pub mod error;
pub mod event;
mod exact;
pub mod flow;
pub mod geometry;
pub mod geometry_text;
pub mod grid;
pub mod heights;
pub mod index;
pub mod isolines;
pub mod job;
pub mod key;
pub mod kind;
pub mod land;
pub mod level;
pub mod listing;
pub mod look_at;
pub mod manifest;
pub mod masked;
pub mod notice;
pub mod observation;
pub mod picture;
pub mod product;
pub mod quantity;
pub mod region;
pub mod rows;
pub mod series;
mod sky;
pub mod statistics;
pub mod sun;
pub mod tile;
pub mod time;
pub mod time_sample;
pub mod topic;
pub mod trails;

pub use error::ContractError;
