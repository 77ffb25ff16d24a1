//! `fluxglobe export`: a version of a product in, a cube or files out that others' programs open.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use contract::manifest::{Manifest, Step};
use contract::time::Period;
use cube::{At, Cube, Description, Follower, PlainZarr, Repository};
use export::Format;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use indicatif::ProgressBar;
use serde::Serialize;
use storage::Store;

use crate::cli::{Export, ExportFormat, ExportedProduct, Settings};
use crate::{deployment, progress};

/// Fields that are read while one is written.
const FIELDS_AHEAD: usize = 2;

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
    let manifest = version(&store, &options.product, settings).await?;
    let bar = progress::bar("export", manifest.steps.len() as u64);
    let (url, tag) = if let Some(format) = file_format(options.to) {
        let path = local(&options.destination)?;
        files(&store, &manifest, (format, path), &bar).await?;
        (options.destination.clone(), None)
    } else {
        let destination = destination(&options.destination)?;
        let tag = arrays(&store, &manifest, options.to, (&destination, &bar)).await?;
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
        ExportFormat::Zarr | ExportFormat::Icechunk => None,
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

/// Writes files, each step on a thread for what blocks.
async fn files(
    store: &Store,
    manifest: &Manifest,
    (format, path): (Format, &Path),
    bar: &ProgressBar,
) -> Result<()> {
    let description = Description::of(manifest);
    let periods: Vec<Period> = manifest.steps.iter().map(|step| step.period).collect();
    let mut written = export::create(format, path, &description, &periods)?;
    let cube = own_cube(store, manifest).await;
    let mut fields = std::pin::pin!(fields(store, cube.as_ref(), manifest, bar));
    while let Some((period, values)) = fields.try_next().await? {
        let append = tokio::task::spawn_blocking(move || {
            written.append(period, &values)?;
            Ok::<_, export::ExportError>(written)
        });
        written = append.await??;
        bar.inc(1);
    }
    tokio::task::spawn_blocking(move || written.finish()).await??;
    Ok(())
}

/// Writes a cube; of a repository the name of the version in it.
async fn arrays(
    store: &Store,
    manifest: &Manifest,
    to: ExportFormat,
    (destination, bar): (&Store, &ProgressBar),
) -> Result<Option<String>> {
    if to == ExportFormat::Zarr {
        let description = Description::of(manifest);
        let mut zarr = PlainZarr::create(destination, "", &description).await?;
        let cube = own_cube(store, manifest).await;
        let mut fields = std::pin::pin!(fields(store, cube.as_ref(), manifest, bar));
        while let Some((period, values)) = fields.try_next().await? {
            zarr.append(period, values).await?;
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

/// The version that was asked for.
async fn version(store: &Store, asked: &ExportedProduct, settings: &Settings) -> Result<Manifest> {
    let ExportedProduct {
        product,
        number,
        digest,
    } = asked;
    let newest = deployment::manifest(store, product, &settings.data).await?;
    let Some(number) = *number else {
        return Ok(newest);
    };
    let Some(manifest) = storage::manifests::numbered(store, product, number).await? else {
        bail!(
            "{product} has no version {number} (any more); its newest is {}",
            newest.id()
        );
    };
    let id = manifest.id().to_string();
    if let Some(digest) = digest
        && !id.ends_with(&format!("-{digest}"))
    {
        bail!("version {number} of {product} is {id}, not {product}@{number}-{digest}");
    }
    Ok(manifest)
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

/// Values of the steps in the order of time, a few read ahead: from the cube of the version, or from its fields.
fn fields<'a>(
    store: &'a Store,
    cube: Option<&'a Cube>,
    manifest: &'a Manifest,
    bar: &'a ProgressBar,
) -> impl stream::Stream<Item = Result<(Period, Arc<[f32]>)>> + 'a {
    let read = move |place: usize, step: &'a Step| async move {
        bar.set_message(progress::day(step.period.start));
        let values = match cube {
            Some(cube) => cube.field(place).await?,
            None => storage::fields::read(store, &step.field, &manifest.grid).await?,
        };
        Ok((step.period, Arc::from(values)))
    };
    stream::iter(manifest.steps.iter().enumerate())
        .map(move |(place, step)| read(place, step))
        .buffered(FIELDS_AHEAD)
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
}
