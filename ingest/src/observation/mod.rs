//! Observation files in, observations out: buoys, ships, stations and profiles in the unit of their property.
//!
//! | file | recognised by | place, time, names from |
//! |---|---|---|
//! | CF discrete-sampling geometry, NetCDF classic or NetCDF-4 | `featureType` | coordinates, ragged or not |
//! | one mooring in NetCDF with EPIC codes | `epic_code`, one latitude, one longitude | axes, `platform_code` |
//! | NDBC standard meteorological text | its first line | columns; place from a table of stations |
//! | SOCAT and PANGAEA tables, tab-separated | a line with latitude, longitude and time | columns |
//!
//! Samples lie at their depth in metres; casts that give the pressure of the water instead at the depth of that
//! (`pressure.rs`). Casts that say neither are refused: all of their levels would be at the surface.
//!
//! NetCDF is read through the sandboxed reader; text is read here, by lines of bounded length. Left out on purpose:
//! fields that a table calls interpolated or climatological (they are no measurements), and tables of gridded values.

mod argo;
mod convert;
mod coordinate;
mod epic;
mod gather;
mod measured;
mod name;
mod ndbc;
mod netcdf;
mod note;
mod points;
mod pressure;
mod property;
mod quality;
mod recognise;
mod sampling;
mod sink;
mod station;
mod table;
mod table_columns;
mod table_time;
mod values;
mod waiting;

use contract::product::ProductId;

use crate::error::{Rejection, Stop};
use crate::inspect::file::description::Description;
use crate::inspect::reader::session::Session;

pub(crate) use gather::{Found, MAX_OBSERVATIONS, OBSERVATION_BYTES};
pub(crate) use note::put as put_note;
pub use note::{FileNote, notes};
pub(crate) use recognise::{TextFormat, recognise, recognise_text};
pub use sink::{ObservationSink, SinkCause, SinkError, Stored};
pub(crate) use values::MAX_VALUES;
pub(crate) use waiting::Waiting;

/// Largest text file of observations, bytes: a ship's year every second has half of it.
pub(crate) const MAX_TEXT_BYTES: u64 = 256 << 20;

/// What is known of a file beside its content.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    /// Last part of its path.
    pub(crate) file_name: &'a str,
    /// The dataset that its sender wants it in; named by the file if absent.
    pub(crate) dataset: Option<&'a ProductId>,
}

/// What a NetCDF file holds that [`recognise`] knows.
pub(crate) async fn read(
    session: &mut Session,
    description: &Description,
    source: Source<'_>,
) -> Result<Found, Stop> {
    netcdf::read(session, description, source).await
}

/// What a text file of at most [`MAX_TEXT_BYTES`] holds that [`recognise_text`] knows.
pub(crate) fn read_text(
    format: TextFormat,
    content: &[u8],
    source: Source<'_>,
) -> Result<Found, Rejection> {
    match format {
        TextFormat::Ndbc => ndbc::read(content, source),
        TextFormat::Table => table::read(content, source),
        TextFormat::UndatedGrid => Err(table::undated()),
    }
}
