//! `fluxglobe export`: a version of a product in, a cube or files out that others' programs open.

use std::path::Path;

use anyhow::{Context as _, Result, bail};
use contract::chunk::BAND_CELLS;
use contract::kind::Vouched;
use contract::manifest::{Manifest, Step};
use contract::time::Period;
use cube::{At, Cube, Description, FieldBands, Follower, PlainZarr, Repository, ZarrVersion};
use export::Format;
use indicatif::ProgressBar;
use serde::Serialize;
use storage::{Store, fields};
use tokio::sync::mpsc;

use crate::cli::{Export, ExportFormat, Settings};
use crate::{deployment, instants, progress};

/// What was written.
#[derive(Serialize)]
struct Exported {
    version: String,
    format: &'static str,
    destination: String,
    /// Of the Icechunk repository: the name of the version in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    tag: Option<String>,
    steps: usize,
    rows: u32,
    cols: u32,
}

pub(crate) async fn run(settings: &Settings, options: &Export) -> Result<()> {
    let store = deployment::store(settings)?;
    let manifest = deployment::version(&store, &options.product, &settings.data).await?;
    let bar = progress::bar("export", manifest.steps.len() as u64);
    let (url, tag) = if let Some(format) = file_format(options.to) {
        let path = local(&options.destination)?;
        files(Source::new(&store, &manifest, &bar), format, path).await?;
        (options.destination.clone(), None)
    } else {
        let destination = destination(&options.destination)?;
        let source = Source::new(&store, &manifest, &bar);
        let tag = arrays(source, options.to, &destination).await?;
        (destination.url().to_owned(), tag)
    };
    let exported = Exported {
        version: manifest.id().to_string(),
        format: options.to.as_str(),
        destination: url,
        tag,
        steps: manifest.steps.len(),
        rows: manifest.grid.rows,
        cols: manifest.grid.cols,
    };
    progress::done(&bar, &summary(&exported));
    if options.json {
        progress::result(&serde_json::to_string_pretty(&exported)?)?;
    } else {
        progress::result(&exported.destination)?;
    }
    Ok(())
}

/// Formats that are files on this machine.
fn file_format(to: ExportFormat) -> Option<Format> {
    match to {
        ExportFormat::Zarr | ExportFormat::Zarr2 | ExportFormat::Icechunk => None,
        ExportFormat::Netcdf => Some(Format::NetCdf),
        ExportFormat::Geotiff => Some(Format::GeoTiff),
        ExportFormat::Parquet => Some(Format::Parquet),
    }
}

fn local(text: &str) -> Result<&Path> {
    if text.contains("://") {
        bail!("{text} is an address: give a path on this machine, and copy it there then");
    }
    Ok(Path::new(text))
}

/// What is exported, and who is told how far it is.
#[derive(Clone, Copy)]
struct Source<'a> {
    store: &'a Store,
    manifest: &'a Manifest,
    bar: &'a ProgressBar,
    /// Maps of more cells are read in bands of at most so many.
    band_cells: u64,
}

impl<'a> Source<'a> {
    fn new(store: &'a Store, manifest: &'a Manifest, bar: &'a ProgressBar) -> Self {
        Self {
            store,
            manifest,
            bar,
            band_cells: BAND_CELLS,
        }
    }

    /// Is a map more than one band, and so never held whole?
    fn is_large(&self) -> bool {
        self.manifest.grid.cell_count() as u64 > self.band_cells
    }
}

/// What a writer is given of a step.
enum Arriving {
    /// Values of the next rows.
    Band(Vec<f32>),
    /// They were all, and are what they should be.
    End,
}

/// Writes files on a thread for what blocks, while what comes next is read.
async fn files(source: Source<'_>, format: Format, path: &Path) -> Result<()> {
    let manifest = source.manifest;
    let description = Description::of(source.store, manifest).await?;
    let periods: Vec<Period> = manifest.steps.iter().map(|step| step.period).collect();
    let mut written = export::create(format, path, &description, &periods)?;
    let (sender, mut arriving) = mpsc::channel(1);
    let writing = tokio::task::spawn_blocking(move || {
        for period in periods {
            let mut is_whole = false;
            let mut bands = std::iter::from_fn(|| match arriving.blocking_recv() {
                Some(Arriving::Band(values)) => Some(values),
                Some(Arriving::End) => {
                    is_whole = true;
                    None
                }
                None => None,
            });
            let appended = written.append(period, &mut bands);
            if !is_whole && appended.is_ok() {
                // Whoever reads says why; what was written goes.
                return Ok(());
            }
            appended?;
        }
        written.finish()
    });
    let sent = send(source, sender).await;
    let wrote = writing.await?;
    // Where reading failed, that is why there was too little to write.
    sent?;
    Ok(wrote?)
}

/// Sends the values of all steps in the order of time, as long as somebody takes them.
async fn send(source: Source<'_>, sender: mpsc::Sender<Arriving>) -> Result<()> {
    let (store, manifest) = (source.store, source.manifest);
    let cube = own_cube(store, manifest).await;
    for (place, step) in manifest.steps.iter().enumerate() {
        source.bar.set_message(instants::shown(step.period.start));
        if let Some(cube) = cube.as_ref().filter(|_| !source.is_large()) {
            let values = Arriving::Band(cube.field(place).await?);
            if sender.send(values).await.is_err() {
                return Ok(());
            }
        } else {
            let band_cells = source.band_cells;
            let mut bands = fields::bands(store, &step.field, &manifest.grid, band_cells).await?;
            while let Some((_rows, values)) = bands.next().await? {
                if sender.send(Arriving::Band(values)).await.is_err() {
                    return Ok(());
                }
            }
        }
        if sender.send(Arriving::End).await.is_err() {
            return Ok(());
        }
        source.bar.inc(1);
    }
    Ok(())
}

/// Writes a cube; of a repository the name of the version in it.
async fn arrays(
    source: Source<'_>,
    to: ExportFormat,
    destination: &Store,
) -> Result<Option<String>> {
    let (store, manifest, bar) = (source.store, source.manifest, source.bar);
    let zarr = match to {
        ExportFormat::Zarr => Some(ZarrVersion::Three),
        ExportFormat::Zarr2 => Some(ZarrVersion::Two),
        _ => None,
    };
    if let Some(version) = zarr {
        let description = Description::of(store, manifest).await?;
        let mut zarr = PlainZarr::create(destination, "", &description, version).await?;
        let cube = own_cube(store, manifest).await;
        for (place, step) in manifest.steps.iter().enumerate() {
            bar.set_message(instants::shown(step.period.start));
            match cube.as_ref().filter(|_| !source.is_large()) {
                Some(cube) => {
                    let values = cube.field(place).await?;
                    zarr.append(step.period, values.into()).await?;
                }
                None => append_field(source, step, &mut zarr).await?,
            }
            bar.inc(1);
        }
        zarr.finish().await?;
        return Ok(None);
    }
    if !destination.list("").await?.is_empty() {
        bail!("{} is not empty: give another place", destination.url());
    }
    // A cube of one version, made as the store's own is.
    let follower = Follower {
        store: destination,
        folder: "",
        fields: store,
        told: &|_period| bar.inc(1),
    };
    follower.run(manifest).await?;
    Ok(Some(manifest.number.to_string()))
}

/// Writes a step from its field, of which rows are read as they are needed.
async fn append_field(source: Source<'_>, step: &Step, zarr: &mut PlainZarr) -> Result<()> {
    let mut bands = FieldBands::new(source.store, &step.field, &source.manifest.grid);
    let digest = zarr.append_bands(step.period, &mut bands).await?;
    let digest = digest.values_sha256;
    if let Vouched::Values(name) = step.field.vouches()
        && name != digest
    {
        bail!(
            "{} is damaged: its values have the digest {digest}",
            step.field
        );
    }
    Ok(())
}

fn summary(exported: &Exported) -> String {
    format!(
        "{}: {} steps of {} x {} cells as {} in {}",
        exported.version,
        exported.steps,
        exported.rows,
        exported.cols,
        exported.format,
        exported.destination
    )
}

/// Opens the place to write to, and makes sure that it is empty.
fn destination(text: &str) -> Result<Store> {
    let is_url = text.contains("://");
    if !is_url
        && let Ok(mut there) = std::fs::read_dir(text)
        && there.next().is_some()
    {
        bail!("{text} is not empty: give another folder, or remove it");
    }
    if !is_url && std::path::Path::new(text).is_file() {
        bail!("{text} is a file: give a folder");
    }
    Store::open(text).with_context(|| format!("cannot write to {text}"))
}

/// The version as the store's own cube has it; none if it does not, of which the fields are read then.
async fn own_cube(store: &Store, manifest: &Manifest) -> Option<Cube> {
    let opened = async {
        let folder = cube::folder(&manifest.product);
        let repository = Repository::open(store, &folder).await?;
        let version = At::Version(manifest.number.to_string());
        repository.at(&version).await
    };
    match opened.await {
        Ok(cube) if cube.description().version == Some(manifest.id()) => Some(cube),
        Ok(_other) => None,
        Err(error) => {
            tracing::debug!(%error, "fields are read, for there is no cube of the version");
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_destination_that_holds_something_is_refused_and_an_empty_one_taken() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new");
        let text = path.to_str().unwrap();
        destination(text).unwrap();
        destination(text).unwrap();
        std::fs::write(path.join("a"), "x").unwrap();
        let refused = destination(text).unwrap_err().to_string();
        assert!(refused.contains("not empty"), "{refused}");
        let file = path.join("a");
        let refused = destination(file.to_str().unwrap()).unwrap_err().to_string();
        assert!(refused.contains("is a file"), "{refused}");
    }

    /// A version of two steps in a folder, of three rows of chunks and without a cube.
    async fn landed(folder: &Path) -> (Store, Manifest) {
        let store = Store::open(folder.join("store").to_str().unwrap()).unwrap();
        let grid = contract::grid::Grid {
            rows: 150,
            cols: 250,
            north_deg: 75.0,
            west_deg: -125.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        };
        let product: contract::product::ProductId = "p".parse().unwrap();
        let mut steps = vec![];
        for month in [1, 2] {
            let value = |cell: usize| match cell % 17 {
                0 => f32::NAN,
                _ => (cell % 1009 * month as usize) as f32 * 1e-10,
            };
            let values: Vec<f32> = (0..grid.cell_count()).map(value).collect();
            let period = Period::month(2001, month).unwrap();
            let field = fields::write(&store, &product, &grid, &values, period);
            steps.push(Step {
                masked: None,
                period,
                field: field.await.unwrap(),
                raw_sha256: contract::digest::Digest::of(&[month as u8]),
                origin: "made by a test".to_owned(),
                valid_cells: 0,
                contributed: None,
            });
        }
        let cells = vec![true; grid.cell_count()];
        let manifest = Manifest {
            schema: contract::manifest::MANIFEST_SCHEMA,
            number: 1,
            title: "Fluxes".to_owned(),
            quantity: contract::quantity::Quantity::CarbonFlux,
            synthetic: true,
            source: "made by a test".to_owned(),
            grid,
            steps,
            domain: storage::domain::write(&store, &product, &cells)
                .await
                .unwrap(),
            product,
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
        };
        (store, manifest)
    }

    /// Relative paths and bytes of all files below a folder.
    fn all(folder: &Path) -> Vec<(String, Vec<u8>)> {
        let mut found = vec![];
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                let below = all(&path).into_iter();
                found.extend(below.map(|(own, bytes)| (format!("{name}/{own}"), bytes)));
            } else {
                found.push((name, std::fs::read(&path).unwrap()));
            }
        }
        found.sort();
        found
    }

    #[tokio::test]
    async fn maps_in_bands_are_exported_as_whole_ones_are() {
        let folder = tempfile::tempdir().unwrap();
        let (store, manifest) = landed(folder.path()).await;
        let bar = ProgressBar::hidden();
        let whole = Source::new(&store, &manifest, &bar);
        let banded = Source {
            band_cells: 1,
            ..whole
        };
        assert!(banded.is_large() && !whole.is_large());
        for format in [Format::NetCdf, Format::GeoTiff, Format::Parquet] {
            for (name, source) in [("whole", whole), ("banded", banded)] {
                let path = folder.path().join(name).join(format!("{format:?}"));
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                files(source, format, &path).await.unwrap();
            }
        }
        for (name, source) in [("whole", whole), ("banded", banded)] {
            let path = folder.path().join(name).join("zarr");
            let destination = destination(path.to_str().unwrap()).unwrap();
            arrays(source, ExportFormat::Zarr, &destination)
                .await
                .unwrap();
        }
        let expected = all(&folder.path().join("whole"));
        assert!(expected.len() > 10, "{}", expected.len());
        assert!(all(&folder.path().join("banded")) == expected);
    }

    #[tokio::test]
    async fn a_field_of_other_values_than_its_name_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let (store, manifest) = landed(folder.path()).await;
        // Of the last step, whose every row is sound: only all of them together tell.
        let last = manifest.steps.last().unwrap();
        let values = vec![1e-9; manifest.grid.cell_count()];
        let other = fields::encode(&manifest.grid, &values, last.period).unwrap();
        store.put_over(&last.field, other.content).await.unwrap();
        let bar = ProgressBar::hidden();
        let source = Source {
            band_cells: 1,
            ..Source::new(&store, &manifest, &bar)
        };
        let out = folder.path().join("out");
        std::fs::create_dir(&out).unwrap();
        for format in [Format::NetCdf, Format::GeoTiff, Format::Parquet] {
            let failed = files(source, format, &out.join("a")).await.unwrap_err();
            let text = format!("{failed:#}");
            assert!(text.contains(last.field.as_str()), "{text}");
            assert_eq!(all(&out), [], "{format:?}");
        }
        let zarr = destination(folder.path().join("zarr").to_str().unwrap()).unwrap();
        let failed = arrays(source, ExportFormat::Zarr, &zarr).await.unwrap_err();
        assert!(format!("{failed:#}").contains(last.field.as_str()));
        assert!(!folder.path().join("zarr/zarr.json").exists());
    }
}
