//! `fluxglobe derive`: products in, a product computed from them out.

use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use compute::DeriveProgress;
use compute::computed::co2_flux::Source;
use compute::computed::{Request, RequestedInput};
use contract::computed::{Computation, Matching};
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::TimeMs;
use kafka_log::KafkaSettings;
use storage::Store;
use storage::log::EventLog;

use super::budget::stored_region;
use super::follow::{onwards, tell};
use crate::cli::{
    Derive, DeriveCo2Flux, DeriveStatistic, DeriveWhat, Expression, Regrid, Settings,
};
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: Derive) -> Result<()> {
    match options.what {
        None => expression(settings, options.expression).await,
        Some(DeriveWhat::Co2Flux(options)) => co2_flux(settings, *options).await,
        Some(DeriveWhat::Regrid(options)) => regrid(settings, options).await,
        Some(DeriveWhat::Functions) => functions(),
        Some(DeriveWhat::Statistic(options)) => statistic(settings, &options).await,
        Some(DeriveWhat::Accumulated {
            product,
            start,
            follow,
            kafka,
        }) => {
            let store = deployment::store(settings)?;
            deployment::manifest(&store, &product, &settings.data).await?;
            let log = listening(settings, &kafka).await?;
            let log = log.as_deref();
            let manifest = accumulated(settings, store.clone(), log, &product, start).await?;
            progress::result(&manifest.id().to_string())?;
            onwards(settings, (&store, log), &[&manifest.product], follow.follow).await
        }
    }
}

/// The log that is told of what was derived.
async fn listening(
    settings: &Settings,
    kafka: &KafkaSettings,
) -> Result<Option<Arc<dyn EventLog>>> {
    let log = deployment::log(settings, kafka).await?;
    if log.is_none() {
        progress::say("nobody is told of it: give --kafka to tell the services of this store");
    }
    Ok(log)
}

async fn expression(settings: &Settings, options: Expression) -> Result<()> {
    let (Some(expression), Some(target), Some(quantity)) =
        (options.expr, options.name, options.quantity)
    else {
        bail!("give --expr, --name and --quantity, or what to derive: see fluxglobe derive --help");
    };
    let request = Request {
        target,
        title: options.about.title,
        quantity: Some(quantity),
        how: Computation::Expression { expression },
        grid: None,
        inputs: options.inputs,
        from: options.about.from,
        to: options.about.to,
    };
    let (kafka, follow) = (&options.about.kafka, options.about.follow.follow);
    computed(settings, kafka, &request, follow).await
}

async fn co2_flux(settings: &Settings, options: DeriveCo2Flux) -> Result<()> {
    let flux = options.flux();
    let expression = flux.expression()?;
    progress::say(&expression);
    let input = |(name, (product, matching)): (&str, Source)| RequestedInput {
        name: name.to_owned(),
        product,
        matching,
    };
    let request = Request {
        target: options.name,
        title: options.about.title,
        quantity: Some(Quantity::CarbonFlux),
        how: Computation::Expression { expression },
        grid: None,
        inputs: flux.sources.into_iter().map(input).collect(),
        from: options.about.from,
        to: options.about.to,
    };
    let (kafka, follow) = (&options.about.kafka, options.about.follow.follow);
    computed(settings, kafka, &request, follow).await
}

async fn regrid(settings: &Settings, options: Regrid) -> Result<()> {
    let store = deployment::store(settings)?;
    let like = deployment::manifest(&store, &options.like, &settings.data).await?;
    let target = match options.name {
        Some(name) => name,
        None => format!("{}-on-{}", options.product, options.like)
            .parse()
            .context("give the result a shorter --name")?,
    };
    let request = Request {
        target,
        title: options.about.title,
        quantity: None,
        how: Computation::Regrid {
            method: options.method,
            min_coverage: options.min_coverage,
        },
        grid: Some(like.grid),
        inputs: vec![RequestedInput {
            name: "source".to_owned(),
            product: options.product,
            matching: Matching::SamePeriod,
        }],
        from: options.about.from,
        to: options.about.to,
    };
    let (kafka, follow) = (&options.about.kafka, options.about.follow.follow);
    computed(settings, kafka, &request, follow).await
}

/// Computes a product with a progress bar, tells of it, and says how far it is to be trusted.
async fn computed(
    settings: &Settings,
    kafka: &KafkaSettings,
    request: &Request,
    is_followed: bool,
) -> Result<()> {
    let store = deployment::store(settings)?;
    let log = listening(settings, kafka).await?;
    let bar = progress::bar("compute on Ballista", 0);
    let engine = deployment::engine(settings, store)?;
    let on_step = |progress: DeriveProgress| {
        bar.set_length(progress.all_steps as u64);
        bar.set_position(progress.done_steps as u64);
    };
    let outcome = compute::computed::compute(&engine, request, &on_step).await?;
    let manifest = &outcome.manifest;
    tell(log.as_deref(), manifest).await?;
    let (count, product) = (manifest.steps.len(), &manifest.product);
    let kept = outcome.kept_count;
    progress::done(
        &bar,
        &format!("{count} steps of {product}, {kept} of them there before"),
    );
    if outcome.left_out > 0 {
        progress::say(&format!(
            "{} steps are left out: another input has nothing for their period",
            outcome.left_out
        ));
    }
    let (masked, _) = manifest.masked();
    if masked.implausible > 0 {
        progress::say(&format!(
            "{} values are no numbers, or none that {} can have, and were masked",
            masked.implausible,
            manifest.quantity.word()
        ));
    }
    if let Some(line) = without_data(manifest) {
        progress::say(&line);
    }
    for (name, count) in &outcome.outside {
        progress::say(&format!(
            "{name} was called {count} times outside the range that its paper gives"
        ));
    }
    progress::result(&manifest.id().to_string())?;
    let told = (engine.store(), log.as_deref());
    onwards(settings, told, &[&manifest.product], is_followed).await
}

/// What is said of steps of which no cell holds data; none if there is no such one.
fn without_data(manifest: &Manifest) -> Option<String> {
    let mut empty = manifest.steps.iter().filter(|step| step.valid_cells == 0);
    let (first, all) = (empty.next()?, manifest.steps.len());
    Some(format!(
        "no cell holds data in {} of {all} steps; the first is {}",
        1 + empty.count(),
        first.period
    ))
}

fn functions() -> Result<()> {
    let mut text = String::new();
    for function in compute::expression::function::ALL {
        text.push_str(&function.signature());
        let what = format!("\n    {}; {}\n", function.what, function.source);
        text.push_str(&what);
        for argument in function.arguments {
            if let Some([low, high]) = argument.range {
                let (name, unit) = (argument.name, argument.unit);
                let range = format!("    {name} from {low} to {high} {unit}\n");
                text.push_str(&range);
            }
        }
    }
    progress::result(&text)
}

/// Computes statistics of each cell with a progress bar; at once those that are there already.
async fn statistic(settings: &Settings, options: &DeriveStatistic) -> Result<()> {
    let store = deployment::store(settings)?;
    for product in std::iter::once(&options.product).chain(&options.with) {
        deployment::manifest(&store, product, &settings.data).await?;
    }
    let log = listening(settings, &options.kafka).await?;
    let region = match &options.region {
        Some(text) => Some(stored_region(settings, &store, text).await?),
        None => None,
    };
    let asked = options.asked(region.as_ref())?;
    let bar = progress::bar("statistics of each cell", 0);
    // A block of cells is read by one query, which a scheduler would only delay.
    let engine = deployment::region_engine(settings, store)?;
    let on_cells = |progress: DeriveProgress| {
        bar.set_length(progress.all_steps as u64);
        bar.set_position(progress.done_steps as u64);
    };
    let derived = compute::derive::derive_statistics(&engine, &options.product, &asked, &on_cells);
    let made = derived.await?;
    let outcome =
        |manifest: &Manifest| format!("{} fields of {}", manifest.steps.len(), manifest.product);
    let outcomes: Vec<String> = made.iter().map(outcome).collect();
    progress::done(&bar, &outcomes.join(", "));
    for manifest in &made {
        tell(log.as_deref(), manifest).await?;
        if let Some(line) = compute::dependents::why_it_stays(manifest) {
            progress::say(&line);
        }
        progress::result(&manifest.id().to_string())?;
    }
    let products: Vec<&ProductId> = made.iter().map(|made| &made.product).collect();
    let told = (engine.store(), log.as_deref());
    onwards(settings, told, &products, options.follow.follow).await
}

/// Computes accumulated carbon with a progress bar; at once if it is there already.
pub(crate) async fn accumulated(
    settings: &Settings,
    store: Store,
    log: Option<&dyn EventLog>,
    product: &ProductId,
    start: Option<TimeMs>,
) -> Result<Manifest> {
    let bar = progress::bar("accumulate on Ballista", 0);
    let engine = deployment::engine(settings, store)?;
    let on_step = |progress: DeriveProgress| {
        bar.set_length(progress.all_steps as u64);
        bar.set_position(progress.done_steps as u64);
    };
    let manifest = compute::derive_accumulated(&engine, product, start, &on_step).await?;
    tell(log, &manifest).await?;
    progress::done(
        &bar,
        &format!("{} fields of {}", manifest.steps.len(), manifest.product),
    );
    Ok(manifest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::digest::Digest;
    use contract::grid::Grid;
    use contract::manifest::{MANIFEST_SCHEMA, Step};
    use contract::time::Period;

    /// A version with as many cells with data in the months of 2001.
    fn computed(valid_cells: &[u64]) -> Manifest {
        let step = |(month, valid_cells): (u32, &u64)| Step {
            masked: None,
            period: Period::month(2001, month).unwrap(),
            field: "frames/p/a".parse().unwrap(),
            raw_sha256: Digest::of(b"a job"),
            origin: "made by a test".to_owned(),
            valid_cells: *valid_cells,
            contributed: None,
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            product: "p".parse().unwrap(),
            number: 1,
            title: "P".to_owned(),
            quantity: Quantity::SeaSurfaceTemperature,
            synthetic: true,
            source: "made by a test".to_owned(),
            grid: Grid {
                rows: 2,
                cols: 3,
                north_deg: 1.0,
                west_deg: 0.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            steps: (1..).zip(valid_cells).map(step).collect(),
            domain: "domain/p/a".parse().unwrap(),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
        }
    }

    #[test]
    fn steps_of_which_no_cell_holds_data_are_told() {
        assert_eq!(without_data(&computed(&[1, 6])), None);
        let told = without_data(&computed(&[1, 0, 6, 0])).unwrap();
        assert_eq!(
            told,
            "no cell holds data in 2 of 4 steps; the first is 2001-02-01T00:00:00Z/2001-03-01T00:00:00Z"
        );
    }
}
