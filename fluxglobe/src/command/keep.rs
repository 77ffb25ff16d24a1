//! `fluxglobe keep`: a version that is cited in, a pin in the store out, which `fluxglobe gc` heeds; the list of all pins; one released.

use std::path::Path;

use anyhow::{Result, bail};
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use contract::manifest::{AskedVersion, ManifestId};
use contract::time::TimeMs;
use serde::Serialize;
use storage::Store;
use storage::pins::{self, Pinned};

use crate::cli::{Keep, Settings};
use crate::command::notice;
use crate::{deployment, progress};

/// A pin, and what has become of its version.
#[derive(Serialize)]
struct Listed {
    version: ManifestId,
    since: TimeMs,
    because: Option<String>,
    /// What the version lacks to be read; nothing where it is whole.
    lacking: Option<String>,
}

pub(crate) async fn run(settings: &Settings, options: &Keep) -> Result<()> {
    let store = deployment::store(settings)?;
    if options.list {
        return list(&store, options.json).await;
    }
    match (&options.asked, &options.release) {
        (Some(asked), _) => pin(&store, asked, options.because.as_deref(), &settings.data).await,
        (None, Some(asked)) => release(&store, asked).await,
        (None, None) => bail!("give a version to pin, --release with one, or --list"),
    }
}

async fn pin(
    store: &Store,
    asked: &AskedVersion,
    because: Option<&str>,
    data: &Path,
) -> Result<()> {
    let manifest = deployment::version(store, asked, data).await?;
    let id = manifest.id();
    if asked.number.is_none() {
        bail!("say which version of {asked} is to be pinned, as it is cited: its newest is {id}");
    }
    let pinned = pins::pin(store, &manifest, because.map(str::to_owned), notice::now()?).await?;
    match pinned {
        Pinned::Now => progress::result(&format!("{id} is pinned")),
        Pinned::Not(lacking) => bail!("{id} is not pinned: {lacking}"),
        Pinned::Before(before) => {
            let says_another = because.is_some() && because != before.because.as_deref();
            if before.version != id || says_another {
                bail!(
                    "{} is pinned since {}{}: for another pin release it first (fluxglobe keep --release {}@{})",
                    before.version,
                    before.since,
                    before
                        .because
                        .map_or(String::new(), |text| format!(", because: {text}")),
                    id.product,
                    id.number
                );
            }
            progress::result(&format!("{id} is pinned, since {}", before.since))
        }
    }
}

async fn release(store: &Store, asked: &AskedVersion) -> Result<()> {
    let product = &asked.product;
    let Some(number) = asked.number else {
        bail!(
            "say which version of {product} is to be released: `fluxglobe keep --list` names those that are pinned"
        );
    };
    // By its number alone a damaged pin is released, too.
    if asked.digest.is_some()
        && let Some(pin) = pins::of_number(store, product, number).await?
        && pin.version.to_string() != asked.to_string()
    {
        bail!(
            "version {number} of {product} is pinned as {}, not {asked}",
            pin.version
        );
    }
    if !pins::release(store, product, number).await? {
        bail!("{asked} is not pinned: `fluxglobe keep --list` names what is");
    }
    progress::result(&format!("{product}@{number} is released"))
}

async fn list(store: &Store, is_json: bool) -> Result<()> {
    let mut all = vec![];
    for pin in pins::all(store).await? {
        all.push(Listed {
            lacking: pins::lacking(store, &pin.version).await?,
            version: pin.version,
            since: pin.since,
            because: pin.because,
        });
    }
    if is_json {
        return progress::result(&serde_json::to_string_pretty(&all)?);
    }
    if all.is_empty() {
        progress::say("nothing is pinned; `fluxglobe keep PRODUCT@NUMBER` pins a version");
        return Ok(());
    }
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(["version", "since", "because"]);
    for pin in &all {
        let because = pin.because.clone().unwrap_or_default();
        table.add_row([pin.version.to_string(), pin.since.to_string(), because]);
    }
    progress::result(&table.trim_fmt())?;
    for pin in &all {
        if let Some(lacking) = &pin.lacking {
            progress::say(&format!(
                "{} is pinned and cannot be read: {lacking}",
                pin.version
            ));
        }
    }
    Ok(())
}
