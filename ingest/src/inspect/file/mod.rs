//! Data files as the sandboxed reader sees them: what is in a file (no values), then values of one variable.
//!
//! Two formats: NetCDF classic (read by [`netcdf3`]) and HDF5, which NetCDF-4 is a use of ([`hdf5_file`]). The format
//! comes from the first bytes, never from the name. Text is read for names only, cut to a length. Left out on purpose:
//! groups below the root, compound types, virtual and external storage.

pub(crate) mod description;
mod format;
mod hdf5_attribute;
mod hdf5_file;
mod hdf5_text;
mod netcdf3;
mod netcdf3_header;

use std::path::Path;

use contract::event::RejectReason;

use crate::error::Rejection;
use description::{Description, Part};
use format::Format;

/// An open data file.
pub(crate) enum DataFile {
    NetCdf3(netcdf3::NetCdf3File),
    Hdf5(hdf5_file::Hdf5File),
}

impl DataFile {
    /// Opens a file and reads its header.
    pub(crate) fn open(path: &Path) -> Result<Self, Rejection> {
        match format::detect(path)? {
            Format::NetCdf3(version) => {
                netcdf3::NetCdf3File::open(path, version).map(Self::NetCdf3)
            }
            Format::Hdf5 => hdf5_file::Hdf5File::open(path).map(Self::Hdf5),
        }
    }

    /// What is in the file.
    pub(crate) fn description(&self) -> &Description {
        match self {
            Self::NetCdf3(file) => file.description(),
            Self::Hdf5(file) => file.description(),
        }
    }

    /// Values of a part of a variable as stored (still packed), in the order of its dimensions.
    ///
    /// At most two dimensions are taken whole; of the others one index each.
    pub(crate) fn read(&mut self, variable: &str, part: &[Part]) -> Result<Vec<f64>, Rejection> {
        match self {
            Self::NetCdf3(file) => file.read(variable, part),
            Self::Hdf5(file) => file.read(variable, part),
        }
    }
}

/// A refusal for a file that ends early or contradicts itself.
pub(crate) fn corrupt(object: impl AsRef<str>, detail: impl AsRef<str>) -> Rejection {
    Rejection::new(RejectReason::Corrupt, object, detail)
}
