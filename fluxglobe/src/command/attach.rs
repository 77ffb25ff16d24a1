//! `fluxglobe attach`: a store of others in, a product of its values out that are not copied.

use anyhow::{Context as _, Result};
use contract::index::DimensionIndex;
use contract::masked::MaskedCells;
use ingest::attach::{Attached, Request};
use serde::Serialize;

use super::behind::say_what_is_behind;
use crate::cli::{Attach, Settings};
use crate::{deployment, progress};

/// What was attached, for machines.
#[derive(Serialize)]
struct Line {
    version: String,
    is_new: bool,
    store: String,
    kind: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    snapshot: Option<String>,
    steps: usize,
    steps_read: usize,
    stored_bytes: u64,
    masked: MaskedCells,
    assumptions: Vec<String>,
}

pub(crate) async fn run(settings: &Settings, options: &Attach) -> Result<()> {
    let store = deployment::store(settings)?;
    let bar = progress::bar("attach", 0);
    let told = |done: usize, all: usize| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    let attached = if let Some(product) = &options.refresh {
        ingest::attach::refresh(&store, product, &told).await
    } else {
        let address = options.url.clone().context("give the URL of a store")?;
        // A folder is found from wherever the product is read.
        let is_url = address.contains("://");
        let path = std::path::absolute(&address).ok().filter(|_| !is_url);
        let own = |one: &DimensionIndex| (one.dimension.clone(), one.index);
        let request = Request {
            address: match path {
                Some(path) => path.to_str().context("the path is not UTF-8")?.to_owned(),
                None => address,
            },
            variable: options.variable.clone(),
            profile: options.profile.clone(),
            product: options.product.clone(),
            indexes: options.index.iter().map(own).collect(),
            replace: options.replace,
        };
        ingest::attach::attach(&store, &request, &told).await
    };
    let attached = match attached {
        Ok(attached) => attached,
        Err(error) => {
            bar.finish_and_clear();
            return Err(error.into());
        }
    };
    let what = if attached.is_new {
        "attached as"
    } else {
        "is there as"
    };
    progress::done(&bar, &format!("{} steps read", attached.read));
    for assumption in &attached.assumptions {
        progress::say(&format!("assumed: {assumption}"));
    }
    if !attached.masked.is_none() {
        progress::say(&attached.masked.to_string());
    }
    let changed = attached.is_new.then_some(&attached.version.product);
    say_what_is_behind(&store, changed).await?;
    if options.json {
        let text = serde_json::to_string_pretty(&Line::of(&attached))?;
        return progress::result(&text);
    }
    let state = attached.snapshot.as_ref();
    let state = state.map_or_else(String::new, |id| format!(" state {id}"));
    progress::result(&format!(
        "{} ({}{state}) {what} {}: {} steps, {} bytes stored here",
        attached.place, attached.kind, attached.version, attached.steps, attached.stored_bytes
    ))
}

impl Line {
    fn of(attached: &Attached) -> Self {
        Self {
            version: attached.version.to_string(),
            is_new: attached.is_new,
            store: attached.place.clone(),
            kind: attached.kind.to_string(),
            snapshot: attached.snapshot.clone(),
            steps: attached.steps,
            steps_read: attached.read,
            stored_bytes: attached.stored_bytes,
            masked: attached.masked,
            assumptions: attached.assumptions.clone(),
        }
    }
}
