//! `fluxglobe observations`: which platforms there are, what they measured, and how a product compares with it.

use std::collections::BTreeSet;

use anyhow::{Context as _, Result, bail};
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use compute::matchup::{self, TimeMatch};
use contract::masked::MaskedCells;
use contract::observation::{Filter, MAX_LIMIT, Observation};
use observations::ObservationStore;

use crate::cli::{MatchTime, Matchup, Observations, ObservationsAsked, Settings};
use crate::command::budget;
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, command: Observations) -> Result<()> {
    match command {
        Observations::List(asked) => list(settings, &asked).await,
        Observations::Query(asked) => query(settings, &asked).await,
        Observations::Matchup(options) => matchup(settings, &options).await,
    }
}

fn filter(asked: &ObservationsAsked) -> Result<Filter> {
    Ok(Filter {
        region: budget::region(&asked.region)?.region,
        from: asked.from,
        to: asked.to,
        properties: asked.property.clone().into_iter().collect(),
        datasets: asked.dataset.clone().into_iter().collect(),
        platforms: asked.platform.clone().into_iter().collect(),
        kinds: asked.kind.into_iter().collect(),
        limit: asked.limit.min(MAX_LIMIT),
        ..Filter::default()
    })
}

async fn list(settings: &Settings, asked: &ObservationsAsked) -> Result<()> {
    let objects = deployment::store(settings)?;
    let store = observations::open(&asked.store, &objects)?;
    let platforms = store.platforms(&filter(asked)?).await?;
    if platforms.is_empty() {
        check_dataset(store.as_ref(), asked).await?;
    }
    let warnings = masked(&objects, asked).await?;
    let warn = || warnings.iter().for_each(|line| progress::say(line));
    if asked.json {
        for platform in &platforms {
            progress::result(&serde_json::to_string(platform)?)?;
        }
        warn();
        return Ok(());
    }
    if platforms.is_empty() {
        progress::say("no observations; land files of them with `fluxglobe ingest`");
        return Ok(());
    }
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header([
        "dataset",
        "platform",
        "kind",
        "from",
        "to",
        "last place",
        "values",
        "properties",
    ]);
    for p in platforms {
        table.add_row([
            p.dataset.to_string(),
            p.platform,
            p.kind.to_string(),
            progress::day(p.first),
            progress::day(p.last),
            format!("{:.3}, {:.3}", p.lon_deg, p.lat_deg),
            p.count.to_string(),
            p.properties.join(" "),
        ]);
    }
    progress::result(&table.to_string())?;
    warn();
    Ok(())
}

/// # Errors
/// There are no observations of the dataset that is asked for; those that there are.
async fn check_dataset(store: &dyn ObservationStore, asked: &ObservationsAsked) -> Result<()> {
    let Some(dataset) = &asked.dataset else {
        return Ok(());
    };
    let of = |datasets| Filter {
        datasets,
        limit: MAX_LIMIT,
        ..Filter::default()
    };
    if !store
        .platforms(&of(vec![dataset.clone()]))
        .await?
        .is_empty()
    {
        return Ok(());
    }
    let platforms = store.platforms(&of(vec![])).await?;
    let known: BTreeSet<String> = platforms
        .iter()
        .map(|own| own.dataset.to_string())
        .collect();
    if known.is_empty() {
        bail!(
            "there is no dataset {dataset}, nor any other; land files of observations with `fluxglobe ingest`"
        );
    }
    let known: Vec<String> = known.into_iter().collect();
    bail!(
        "there is no dataset {dataset}; there are {}",
        known.join(", ")
    )
}

/// Of each dataset that was asked for, what files gave a value for and what is no observation.
async fn masked(store: &storage::Store, asked: &ObservationsAsked) -> Result<Vec<String>> {
    let mut lines = vec![];
    for (dataset, notes) in ingest::observation::notes(store).await? {
        let all: MaskedCells = notes.iter().map(|note| note.masked).sum();
        let is_asked = asked.dataset.as_ref().is_none_or(|asked| *asked == dataset);
        let Some(most) = notes.iter().max_by_key(|note| note.masked.total()) else {
            continue;
        };
        if is_asked && !all.is_none() {
            let files = notes.iter().filter(|note| !note.masked.is_none()).count();
            lines.push(format!(
                "{dataset}: {all} in {files} of {} files; most in {}, {} beside {} observations",
                notes.len(),
                most.file,
                most.masked.total(),
                most.observations
            ));
        }
    }
    Ok(lines)
}

async fn query(settings: &Settings, asked: &ObservationsAsked) -> Result<()> {
    let store = observations::open(&asked.store, &deployment::store(settings)?)?;
    let rows = all(store.as_ref(), asked).await?;
    if rows.is_empty() {
        check_dataset(store.as_ref(), asked).await?;
    }
    if asked.json {
        for row in &rows {
            progress::result(&serde_json::to_string(row)?)?;
        }
        return Ok(());
    }
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header([
        "time", "dataset", "platform", "place", "depth m", "property", "value", "unit", "flag",
    ]);
    for o in rows {
        table.add_row([
            o.time.to_string(),
            o.dataset.to_string(),
            o.platform,
            format!("{:.3}, {:.3}", o.lon_deg, o.lat_deg),
            format!("{}", o.depth_m),
            o.property,
            format!("{}", o.value),
            o.unit,
            o.quality.flag().to_string(),
        ]);
    }
    progress::result(&table.to_string())
}

/// Up to the limit, page by page.
async fn all(store: &dyn ObservationStore, asked: &ObservationsAsked) -> Result<Vec<Observation>> {
    let (mut filter, mut rows) = (filter(asked)?, vec![]);
    loop {
        filter.limit = (asked.limit - rows.len() as u32).min(MAX_LIMIT);
        let page = store.query(&filter).await?;
        rows.extend(page.observations);
        if page.next.is_none() || rows.len() >= asked.limit as usize {
            return Ok(rows);
        }
        filter.after = page.next;
    }
}

async fn matchup(settings: &Settings, options: &Matchup) -> Result<()> {
    if options.asked.property.is_none() {
        bail!("say what is held against the product: --property, such as sea_surface_temperature");
    }
    let store = deployment::store(settings)?;
    let manifest = deployment::manifest(&store, &options.product, &settings.data).await?;
    let found = observations::open(&options.asked.store, &store)?;
    let rows = all(found.as_ref(), &options.asked).await?;
    if rows.is_empty() {
        check_dataset(found.as_ref(), &options.asked).await?;
    }
    let time = match options.time {
        MatchTime::Nearest => TimeMatch::Nearest,
        MatchTime::Linear => TimeMatch::Linear,
    };
    let matched = matchup::matchup(&store, &manifest, &rows, time).await?;
    if let Some(file) = &options.plot {
        let svg = matchup::scatter_svg(&matched)?;
        std::fs::write(file, svg).with_context(|| format!("cannot write {}", file.display()))?;
        progress::say(&format!("plot in {}", file.display()));
    }
    if options.asked.json {
        return progress::result(&serde_json::to_string_pretty(&matched)?);
    }
    progress::result(&format!("{:#?}", matched.statistics))?;
    progress::say(&format!(
        "{} of {} observations{}; left out: {:?}; against {}",
        matched.rows.len(),
        rows.len(),
        if matched.unit.is_empty() {
            String::new()
        } else {
            format!(" in {}", matched.unit)
        },
        matched.left_out,
        manifest.id()
    ));
    Ok(())
}
