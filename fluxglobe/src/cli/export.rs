//! Words of `fluxglobe export`.

use clap::{Args, ValueEnum};
use contract::manifest::AskedVersion;

/// `fluxglobe export`.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  fluxglobe export takahashi09-flux --to zarr flux.zarr
  fluxglobe export takahashi09-flux@3 --to icechunk s3://BUCKET/takahashi09-flux
  fluxglobe export takahashi09-flux --to zarr2 flux-2.zarr     # for GDAL and QGIS
  fluxglobe export takahashi09-flux --to netcdf flux.nc
  fluxglobe export takahashi09-flux --to geotiff flux-maps/
  fluxglobe export takahashi09-flux --to parquet flux.parquet

Then, in Python:
  import xarray
  xarray.open_zarr(\"flux.zarr\").carbon_flux.sel(time=\"2000-07\").plot()

docs/open-data.md shows more.")]
pub(crate) struct Export {
    /// Product, and which of its versions: NAME, NAME@12 or NAME@12-0a1b2c3d. The newest version if none is given.
    #[arg(value_name = "PRODUCT[@VERSION]")]
    pub(crate) product: AskedVersion,
    /// What to write: plain Zarr version 3 or 2, which is files, or an Icechunk repository, which keeps versions and is never
    /// seen half written; or, on this machine, NetCDF-4, a folder of GeoTIFFs, or a table in Parquet.
    #[arg(long, value_enum)]
    pub(crate) to: ExportFormat,
    /// A folder that is empty or not there yet, or such a place in a bucket: `s3://BUCKET/PREFIX`, `gs://`, `az://`,
    /// `hdfs://HOST:PORT/PATH`. For NetCDF and Parquet a file that is not there yet.
    #[arg(value_name = "DEST")]
    pub(crate) destination: String,
    /// What was written as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What an export is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExportFormat {
    /// Zarr version 3, metadata consolidated.
    Zarr,
    /// Zarr version 2, metadata consolidated, for GDAL, QGIS and others that do not read version 3. Its chunks have no checksums.
    Zarr2,
    /// Icechunk, format 2.
    Icechunk,
    /// One NetCDF-4 file by the CF conventions.
    Netcdf,
    /// A folder with one GeoTIFF a step.
    Geotiff,
    /// One Parquet file with a row for each cell that holds a value.
    Parquet,
}

impl ExportFormat {
    /// The word of the command line.
    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Self::Zarr => "zarr",
            Self::Zarr2 => "zarr2",
            Self::Icechunk => "icechunk",
            Self::Netcdf => "netcdf",
            Self::Geotiff => "geotiff",
            Self::Parquet => "parquet",
        }
    }
}
