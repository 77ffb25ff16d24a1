//! `fluxglobe migrate`: a store of before in, a cube for every product and kept version out, and what was compared.

use std::process::ExitCode;

use anyhow::Result;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use contract::product::ProductId;
use cube::CubeError;
use cube::migrate::{Migrated, Stage, migrate};
use indicatif::ProgressBar;
use serde::Serialize;
use storage::{Store, manifests};

use crate::cli::{Migrate, Settings};
use crate::instants::shown;
use crate::{deployment, progress};

/// What became of a product.
#[derive(Serialize)]
struct Outcome {
    product: ProductId,
    #[serde(flatten)]
    migrated: Option<Migrated>,
    /// Why it was not brought over.
    refused: Option<String>,
}

impl Outcome {
    fn is_whole(&self) -> bool {
        let migrated = self.migrated.as_ref();
        self.refused.is_none() && migrated.is_some_and(|it| it.findings.is_empty())
    }
}

pub(crate) async fn run(settings: &Settings, options: &Migrate) -> Result<ExitCode> {
    let store = deployment::store(settings)?;
    let products = if let Some(product) = &options.product {
        deployment::manifest(&store, product, &settings.data).await?;
        vec![product.clone()]
    } else {
        manifests::products(&store).await?
    };
    let products = without_attached(&store, products).await?;
    let mut version_count = 0;
    for product in &products {
        version_count += manifests::numbers(&store, product).await?.len();
    }
    let bar = progress::bar("migrate", version_count as u64);
    let mut outcomes = vec![];
    for product in products {
        let told = |stage| tell(&bar, &product, stage);
        let outcome = match Box::pin(migrate(&store, &product, &told)).await {
            Ok(migrated) => (Some(migrated), None),
            // It says nothing of this product alone.
            Err(error @ (CubeError::Storage(_) | CubeError::Away { .. }))
                if error.is_retryable() =>
            {
                return Err(error.into());
            }
            Err(error) => (None, Some(error.to_string())),
        };
        let (migrated, refused) = outcome;
        outcomes.push(Outcome {
            product,
            migrated,
            refused,
        });
    }
    let refused_count = outcomes.iter().filter(|it| !it.is_whole()).count();
    progress::done(&bar, &summary(&outcomes, refused_count));
    show(&outcomes, options.json)?;
    Ok(if refused_count == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Products whose values are here: of others there is nothing to bring over.
async fn without_attached(store: &Store, all: Vec<ProductId>) -> Result<Vec<ProductId>> {
    let mut here = vec![];
    for product in all {
        let newest = manifests::latest(store, &product).await?;
        let attached = match &newest {
            Some(newest) => store.attached_to(newest).await?,
            None => None,
        };
        match attached {
            Some(attachment) => progress::say(&format!(
                "{product} is attached to {}: its values stay there, and there is nothing to bring over (a copy: fluxglobe export {product} --to \
                 icechunk PLACE)",
                attachment.place()
            )),
            None => here.push(product),
        }
    }
    Ok(here)
}

/// Brings the bar to what is being done.
fn tell(bar: &ProgressBar, product: &ProductId, stage: Stage) {
    match stage {
        Stage::Version(number, _steps) => {
            bar.inc(1);
            bar.set_message(format!("{product}@{number}"));
        }
        Stage::Put(period) => bar.set_message(format!("{product}: put {}", shown(period.start))),
        Stage::Compared(period) => {
            bar.set_message(format!("{product}: compared {}", shown(period.start)));
        }
        Stage::Compacting => bar.set_message(format!("{product}: runs along time")),
        Stage::Verifying => bar.set_message(format!("{product}: objects and runs")),
    }
}

fn summary(outcomes: &[Outcome], refused_count: usize) -> String {
    let of = |count: fn(&cube::migrate::Version) -> usize| -> usize {
        let migrated = outcomes.iter().filter_map(|it| it.migrated.as_ref());
        migrated.flat_map(|it| &it.versions).map(count).sum()
    };
    let refused = match refused_count {
        0 => String::new(),
        count => format!("; {count} of them are not brought over"),
    };
    format!(
        "{} products, {} versions: {} steps put, {} compared with their fields{refused}",
        outcomes.len(),
        of(|_version| 1),
        of(|version| version.put_count),
        of(|version| version.compared_count)
    )
}

/// A line a version, and what is wrong.
fn show(outcomes: &[Outcome], json: bool) -> Result<()> {
    if json {
        return progress::result(&serde_json::to_string_pretty(outcomes)?);
    }
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(["version", "steps", "put", "compared"]);
    for version in outcomes
        .iter()
        .filter_map(|it| it.migrated.as_ref())
        .flat_map(|it| &it.versions)
    {
        table.add_row([
            version.version.to_string(),
            version.steps.to_string(),
            version.put_count.to_string(),
            version.compared_count.to_string(),
        ]);
    }
    progress::result(&table.trim_fmt())?;
    for outcome in outcomes {
        if let Some(reason) = &outcome.refused {
            progress::say(&format!("{}: {reason}", outcome.product));
        }
        for finding in outcome.migrated.iter().flat_map(|it| &it.findings) {
            progress::say(&format!(
                "{}: {} is not sound: {}; `fluxglobe recompute --product {} --verify` makes the cube again",
                outcome.product, finding.key, finding.reason, outcome.product
            ));
        }
    }
    Ok(())
}
