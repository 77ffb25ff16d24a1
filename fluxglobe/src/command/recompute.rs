//! `fluxglobe recompute`: what of a product is stale or missing in a period; shown, then made, once.
//!
//! In the order in which one follows from the other: files read anew, what is computed from their fields, tiles.

mod damaged;
mod files;
mod tiles;

use std::collections::BTreeSet;

use anyhow::{Result, bail};
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use compute::recompute::{Plan, Reason, Request, What};
use contract::event::Event;
use contract::product::ProductId;
use serde::Serialize;
use storage::Store;
use storage::log::EventLog;

use self::damaged::Damaged;
use super::behind::say_what_is_behind;
use crate::cli::{Recompute, RecomputeWhat, Settings};
use crate::{deployment, progress};

/// What would be made, for machines.
#[derive(Serialize)]
struct Shown<'a> {
    #[serde(flatten)]
    plan: &'a Plan,
    files: Option<&'a ingest::reread::Plan>,
    tiles_missing: usize,
    tiles_there: usize,
    /// With `--verify` and `--dry-run`.
    damaged: &'a [Damaged],
}

pub(crate) async fn run(settings: &Settings, options: Recompute) -> Result<()> {
    let store = deployment::store(settings)?;
    deployment::manifest(&store, &options.product, &settings.data).await?;
    let with_fields = options.what.contains(&RecomputeWhat::Fields);
    let files = if with_fields {
        Some(files::Files::plan(&store, &options).await?)
    } else {
        None
    };
    let plan = plan(settings, &store, &options).await?;
    let with_tiles = options.what.contains(&RecomputeWhat::Tiles);
    let wanted = if with_tiles {
        tiles::plan(&store, &options).await?
    } else {
        tiles::Tiles::default()
    };
    let files_plan = files.as_ref().map(|files| &files.plan);
    let is_verified = with_fields && options.verify;
    if options.dry_run {
        let damaged = if is_verified {
            Damaged::all(&store, &options).await?
        } else {
            vec![]
        };
        show(&plan, files_plan, &wanted, &damaged, options.json)?;
        progress::say("nothing was done: --dry-run");
        say_what_is_behind(&store, [&options.product]).await?;
        return check_before(&store, &options.product, is_verified).await;
    }
    show(&plan, files_plan, &wanted, &[], options.json)?;
    let log = deployment::log(settings, &options.kafka).await?;
    if let Some(files) = &files {
        files.read(&store, log.as_deref()).await?;
    }
    if is_verified {
        computed(settings, &store, (&options.product, log.as_deref())).await?;
    }
    // Planned anew: what was read just now makes stale what follows from it.
    let plan = self::plan(settings, &store, &options).await?;
    if !plan.items.is_empty() {
        let bar = progress::bar("recompute", plan.items.len() as u64);
        let engine = deployment::engine(settings, store.clone())?;
        let outcome =
            compute::recompute::run(&engine, &plan, &|done| bar.set_position(done as u64)).await?;
        if let (Some(log), Some(manifest)) = (log.as_deref(), &outcome.derived)
            && let Some(body) = compute::derive::derived(manifest)
        {
            storage::log::tell_once(log, &Event::new(manifest.id().to_string(), body)).await?;
        }
        progress::done(&bar, &format!("{} made", plan.items.len()));
        if let Some(manifest) = outcome.derived {
            progress::result(&manifest.id().to_string())?;
        }
    }
    // Accumulated carbon follows with the fields, and nothing else that is made of either.
    let accumulated = options.product.accumulated().ok().filter(|_| with_fields);
    say_what_is_behind(&store, accumulated.iter().chain([&options.product])).await?;
    if is_verified {
        cubes(&store, &options.product).await?;
    }
    if with_tiles {
        // Planned anew: what was derived just now gives pictures other names.
        let wanted = tiles::plan(&store, &options).await?;
        let kafka = options.kafka.kafka.is_some();
        let told = log.as_deref().filter(|_| kafka);
        tiles::draw(settings, store.clone(), told, &wanted).await?;
    }
    check_before(&store, &options.product, is_verified).await
}

/// # Errors
/// Something of a version before the newest one, which is not made again, is damaged or gone.
async fn check_before(store: &Store, product: &ProductId, is_verified: bool) -> Result<()> {
    if !is_verified {
        return Ok(());
    }
    let mut broken = BTreeSet::new();
    for product in [Some(product.clone()), product.accumulated().ok()] {
        let Some(product) = product else { continue };
        broken.extend(storage::verify::broken_before(store, &product).await?);
    }
    let Some(first) = broken.first() else {
        return Ok(());
    };
    bail!(
        "{} objects of versions before the newest one are damaged or gone, and are not made again: {first}{}; restore them from a copy of the \
         store, or have `fluxglobe gc` remove these versions",
        broken.len(),
        if broken.len() > 1 { " and others" } else { "" }
    )
}

/// Makes a product that was computed from others again where it is damaged, before anything is made of it.
async fn computed(
    settings: &Settings,
    store: &Store,
    (product, log): (&ProductId, Option<&dyn EventLog>),
) -> Result<()> {
    let engine = deployment::engine(settings, store.clone())?;
    let Some(made) = compute::dependents::mend(&engine, product).await? else {
        return Ok(());
    };
    let id = made.id();
    progress::say(&format!(
        "{id}: what was damaged or gone of it is made again"
    ));
    if let (Some(log), Some(body)) = (log, compute::derive::derived(&made)) {
        storage::log::tell_once(log, &Event::new(id.to_string(), body)).await?;
    }
    Ok(())
}

/// Brings the cubes of a product and of what is derived from it to their newest versions, made again if they are damaged.
async fn cubes(store: &Store, product: &ProductId) -> Result<()> {
    for product in [Some(product.clone()), product.accumulated().ok()] {
        let Some(product) = product else { continue };
        if cube::verify::mend(store, &product).await? {
            progress::say(&format!("{product}: its cube was made again"));
        }
    }
    Ok(())
}

/// What is to be computed. Only carbon fluxes accumulate and have budgets, and no extremes of them: fields of all else are those of their files
/// alone, and a budget is refused where nothing else is asked for.
async fn plan(settings: &Settings, store: &Store, options: &Recompute) -> Result<Plan> {
    let manifest = deployment::manifest(store, &options.product, &settings.data).await?;
    let is_of_flux = |what: &What| matches!(what, What::Fields | What::Budget);
    let computed = options.what.iter().filter_map(|what| what.computed());
    let is_flux = computed.clone().any(|what| is_of_flux(&what))
        && compute::has_budget(store, &manifest).await?;
    let is_asked_alone = options.what.len() == 1;
    let request = Request {
        product: options.product.clone(),
        from: options.from,
        to: options.to,
        what: computed
            .filter(|what| match what {
                What::Fields => is_flux,
                What::Budget => is_flux || is_asked_alone,
                What::Statistics => true,
            })
            .collect(),
        is_forced: options.force,
        is_verified: options.verify,
    };
    Ok(compute::recompute::plan(store, &request).await?)
}

fn show(
    plan: &Plan,
    files: Option<&ingest::reread::Plan>,
    tiles: &tiles::Tiles,
    damaged: &[Damaged],
    json: bool,
) -> Result<()> {
    if json {
        let shown = Shown {
            plan,
            files,
            tiles_missing: tiles.missing.len(),
            tiles_there: tiles.there,
            damaged,
        };
        return progress::result(&serde_json::to_string_pretty(&shown)?);
    }
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(["what", "missing", "stale", "forced"]);
    if let Some(files) = files {
        table.add_row(files::row(files));
    }
    for (name, what) in [
        ("frames", What::Fields),
        ("statistics", What::Statistics),
        ("budget", What::Budget),
    ] {
        let count = |reason| {
            let of = plan
                .items
                .iter()
                .filter(|item| item.what == what && item.reason == reason);
            of.count().to_string()
        };
        table.add_row([
            name.to_owned(),
            count(Reason::Missing),
            count(Reason::Stale),
            count(Reason::Forced),
        ]);
    }
    table.add_row([
        "tiles".to_owned(),
        tiles.missing.len().to_string(),
        "0".to_owned(),
        "0".to_owned(),
    ]);
    progress::result(&table.trim_fmt())?;
    for line in damaged.iter().flat_map(Damaged::lines) {
        progress::result(&line)?;
    }
    progress::say(&format!(
        "for {}; {} are right as they are",
        plan.manifest,
        plan.fresh_count + tiles.there + files.map_or(0, |files| files.fresh_count)
    ));
    if let Some(files) = files.filter(|files| !files.items.is_empty()) {
        progress::say(&format!(
            "{} files are read anew ({} of them have been, and wait for the others); what follows from their fields is \
             planned after that",
            files.items.len(),
            files.items.len() - files.unread_count()
        ));
    }
    Ok(())
}
