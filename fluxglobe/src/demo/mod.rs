//! `fluxglobe demo`: real grids through every part of the system, to budgets beside published ones and a web globe.

pub(crate) mod check;
mod land;
mod source;
mod table;
mod verify;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use contract::check::Check;
use contract::product::ProductId;
use storage::Store;

use crate::cli::{Demo, Settings};
use crate::command::{derive, generate, serve};
use crate::demo::source::{FILES_PER_SET, SETS, Set};
use crate::{deployment, progress};

/// What to land where nothing can be fetched. A quarter of the full size along each side is made in seconds.
const SYNTHETIC: Set = Set {
    folder: "",
    product: "china-sea-synthetic",
};
const SYNTHETIC_SCALE: f64 = 0.25;
const SYNTHETIC_SEED: u64 = 1;

/// Products of the demo and the files that are still to be landed.
struct Inputs {
    flux: ProductId,
    files: Vec<PathBuf>,
}

pub(crate) async fn run(settings: &Settings, options: Demo) -> Result<ExitCode> {
    let cache = options.cache.clone().unwrap_or_else(source::default_cache);
    if options.fetch_only {
        let folder = source::fetch(&cache, options.pip.as_deref(), options.offline).await?;
        progress::result(&folder.display().to_string())?;
        return Ok(ExitCode::SUCCESS);
    }
    serve::check_free(options.serve.listen)?;
    let store = deployment::store(settings)?;
    let inputs = inputs(&store, &cache, &options).await?;
    let check = compute(settings, &store, &inputs).await?;
    let flux = deployment::manifest(&store, &inputs.flux, &settings.data).await?;
    match &check {
        Some(check) => progress::result(&table::against_published(check))?,
        None => progress::result(
            &table::synthetic(&deployment::engine(settings, store.clone())?, &flux).await?,
        )?,
    }
    let serving = serve::bind(settings, store.clone(), options.serve, check.clone()).await?;
    if !options.exit_after_check {
        serve::announce(&serving);
        progress::say(&format!("{:>24} Ctrl-C", "stop with"));
        serve::until_asked_to_stop(serving).await?;
        return Ok(ExitCode::SUCCESS);
    }
    let failures = verify::all(settings, &store, serving.server, &flux, check.as_ref()).await?;
    for failure in &failures {
        progress::say(&format!("FAILED: {failure}"));
    }
    Ok(if failures.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// What is to be landed: nothing if it is there, else the real files, else the synthetic product.
async fn inputs(store: &Store, cache: &Path, options: &Demo) -> Result<Inputs> {
    if land::has_landed(store, &SETS).await? {
        return Ok(Inputs {
            flux: SETS[0].product.parse()?,
            files: vec![],
        });
    }
    match source::fetch(cache, options.pip.as_deref(), options.offline).await {
        Ok(folder) => {
            let mut files = Vec::with_capacity(SETS.len() * FILES_PER_SET);
            for set in SETS {
                files.extend(source::files(&folder, set)?);
            }
            Ok(Inputs {
                flux: SETS[0].product.parse()?,
                files,
            })
        }
        Err(error) => {
            progress::say(&format!("the real input files cannot be had: {error:#}"));
            progress::say(
                "going on with the generated China Sea product: SYNTHETIC data, no measurement",
            );
            synthetic_inputs(store, cache).await
        }
    }
}

async fn synthetic_inputs(store: &Store, cache: &Path) -> Result<Inputs> {
    let flux = SYNTHETIC.product.parse()?;
    if land::has_landed(store, &[SYNTHETIC]).await? {
        return Ok(Inputs {
            flux,
            files: vec![],
        });
    }
    std::fs::create_dir_all(cache)?;
    let file = cache.join("china-sea-synthetic.h5");
    if !file.exists() {
        let made = generate::china_sea(
            &file,
            SYNTHETIC_SCALE,
            SYNTHETIC_SEED,
            ingest::GeneratedSteps::Months,
        );
        // Another demo may have made the same meanwhile.
        if !file.exists() {
            made?;
        }
    }
    Ok(Inputs {
        flux,
        files: vec![file],
    })
}

/// Lands, accumulates and compares; what is done already is not done again.
async fn compute(settings: &Settings, store: &Store, inputs: &Inputs) -> Result<Option<Check>> {
    let accumulated = inputs.flux.accumulated()?;
    let flux = storage::manifests::latest(store, &inputs.flux).await?;
    let derived = storage::manifests::latest(store, &accumulated).await?;
    let is_derived = match (&flux, &derived) {
        (Some(flux), Some(derived)) => derived.derived_from == Some(flux.id()),
        _ => false,
    };
    if !inputs.files.is_empty() || !is_derived {
        // The log is held no longer than it is written, so that `fluxglobe ingest` works beside a running demo.
        let log = deployment::embedded_log(settings)?;
        if !inputs.files.is_empty() {
            land::land(store, &log, &inputs.files).await?;
        }
        derive::accumulated(settings, store.clone(), Some(&log), &inputs.flux, None).await?;
    }
    let flux = deployment::manifest(store, &inputs.flux, &settings.data).await?;
    if flux.product.as_str() != SETS[0].product {
        return Ok(None);
    }
    check::compare(settings, store, &flux).await.map(Some)
}
