//! A version of a product as files that others' programs open: NetCDF-4, GeoTIFF, Parquet. Values are those that are stored,
//! bit for bit; what is written is whole or not there, and never takes the place of anything. So are answers of SQL ([`answer`]).
//!
//! Zarr and Icechunk are the crate `cube`'s. Left out on purpose: where steps come from.

pub mod answer;
mod cells;
mod error;
mod geotiff;
mod netcdf;
mod parquet;

use std::path::Path;

use contract::time::Period;
use cube::Description;
use tempfile::NamedTempFile;

pub use error::ExportError;
pub use geotiff::GeoTiffs;
pub use netcdf::NetCdf;
pub use parquet::Table;

/// Values of a step, `[row, col]`, row 0 north, NaN for no data: some rows after the other, in parts of any size.
pub type Values<'a> = &'a mut dyn Iterator<Item = Vec<f32>>;

/// What becomes of the steps of a product, given in the order of time.
pub trait Written: Send {
    /// Writes one step, of which no more is held than some rows.
    ///
    /// # Errors
    /// The file cannot be written; `Shape` if the step does not fill its grid.
    fn append(&mut self, period: Period, values: Values<'_>) -> Result<(), ExportError>;

    /// Makes it whole, under its name.
    ///
    /// # Errors
    /// The file cannot be written, or something has come to be there.
    fn finish(self: Box<Self>) -> Result<(), ExportError>;
}

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// One file by the CF conventions, compressed.
    NetCdf,
    /// A folder with one file a step.
    GeoTiff,
    /// One file with a row for each cell that holds a value.
    Parquet,
}

/// Begins an export at a path where nothing is; `periods` are those of all steps that will be given.
///
/// # Errors
/// `Exists`, or it cannot be written there.
pub fn create(
    format: Format,
    path: &Path,
    description: &Description,
    periods: &[Period],
) -> Result<Box<dyn Written>, ExportError> {
    let is_empty_folder = || std::fs::read_dir(path).is_ok_and(|mut there| there.next().is_none());
    if path.exists() && !(format == Format::GeoTiff && is_empty_folder()) {
        return Err(ExportError::Exists {
            path: path.display().to_string(),
        });
    }
    Ok(match format {
        Format::NetCdf => Box::new(NetCdf::create(path, description, periods)?),
        Format::GeoTiff => Box::new(GeoTiffs::create(path, description)?),
        Format::Parquet => Box::new(Table::create(path, description)?),
    })
}

/// An unfinished file beside what it will be, which goes if it is never finished.
fn part_of(path: &Path) -> Result<NamedTempFile, ExportError> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".export-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // Like any other file, as far as the user's mask lets it.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder
        .tempfile_in(folder_of(path))
        .map_err(ExportError::io(path))
}

/// The folder that a path lies in.
fn folder_of(path: &Path) -> &Path {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}
