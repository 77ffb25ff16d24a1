//! `fluxglobe budget`: a product, a region and a period in; a table or JSON of Tg C with its coverage and source out.

mod tables;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, anyhow, bail};
use compute::region::{file, mask};
use contract::ContractError;
use contract::budget::{AsOf, BudgetAnswer, BudgetHistory, BudgetQuery, BudgetRow, BudgetWishes};
use contract::manifest::{AskedVersion, Manifest};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::region::{AskedRegion, MaskCode};
use storage::Store;
use storage::manifests::{self, AtInstant};

use super::statistics::{Form, csv};
use crate::cli::{Budget, Settings};
use crate::figures::million_km2;
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: &Budget) -> Result<()> {
    let store = deployment::store(settings)?;
    let product = version(settings, &store, options).await?;
    let query = query(settings, &store, options).await?;
    let form = Form::of(options.csv, options.json);
    let bar = progress::bar("sum over the region", 1);
    let engine = deployment::region_engine(settings, store)?;
    if options.history {
        let answer = compute::budget::history(&engine, &query).await?;
        bar.finish_and_clear();
        return say_history(form, &answer);
    }
    let answer = compute::budget::budget_of(&engine, &query, &product).await?;
    bar.finish_and_clear();
    match form {
        Form::Json => return progress::result(&serde_json::to_string_pretty(&answer)?),
        Form::Csv => progress::result(&csv(&answer)?)?,
        Form::Table => progress::result(&tables::of(&answer).trim_fmt())?,
    }
    say_what(&answer);
    say_besides(&answer);
    let is_counted = |row: &BudgetRow| row.completeness.is_some();
    if product.quantity == Quantity::AccumulatedCarbon && !answer.rows.iter().all(is_counted) {
        progress::say(
            "how complete its sums are is unknown: an older version accumulated it; `fluxglobe derive accumulated` does it anew",
        );
    }
    progress::say(&answer.source);
    Ok(())
}

/// The version that is asked for.
async fn version(settings: &Settings, store: &Store, options: &Budget) -> Result<Manifest> {
    let asked = &options.product;
    let own = deployment::version(store, asked, &settings.data).await?;
    if asked.number.is_some() && options.history {
        bail!(
            "a history is of all versions: give --product {} alone",
            asked.product
        );
    }
    let product = &asked.product;
    match &options.as_of {
        None => Ok(own),
        Some(_) if asked.number.is_some() => {
            bail!("--product {asked} and --as-of both say which version is meant: give one")
        }
        Some(AsOf::Version(named)) if named.product != *product => {
            bail!("version {named} is none of {product}")
        }
        Some(AsOf::Version(named)) => deployment::version(store, named, &settings.data).await,
        Some(AsOf::Instant(instant)) => match manifests::as_of(store, product, *instant).await? {
            AtInstant::Version(manifest) => Ok(*manifest),
            AtInstant::BeforeFirst(first) => {
                Err(AsOf::before_first(product, *instant, first).into())
            }
            AtInstant::Gone(older) => Err(AsOf::gone(product, *instant, older).into()),
            AtInstant::Nothing => bail!("{product} has no version"),
        },
    }
}

async fn query(settings: &Settings, store: &Store, options: &Budget) -> Result<BudgetQuery> {
    let regions = match &options.regions {
        Some(text) if file::is_file_name(text) => Some(file::text(Path::new(text))?),
        text => text.clone(),
    };
    let besides = options.words(regions.as_deref()).asked();
    let besides = besides.map_err(|error| of_file(options.regions.as_deref(), error))?;
    let mut versions = BTreeMap::new();
    for product in besides.products() {
        let manifest = deployment::manifest(store, &product, &settings.data).await?;
        versions.insert(product, Arc::new(manifest));
    }
    let wishes = BudgetWishes {
        region: Some(stored_region(settings, store, &options.region).await?),
        from: options.from,
        to: options.to,
        step: options.step,
        earth: Some(options.earth),
        cells: Some(options.cells),
        ocean: ocean(settings, store, options.ocean.as_ref()).await?,
    };
    Ok(besides.of(wishes.query(options.product.product.clone()), &versions)?)
}

/// What is wrong with regions of a file is said of the file, and not of its text.
fn of_file(regions: Option<&str>, error: ContractError) -> ContractError {
    let name = regions.filter(|name| file::is_file_name(name));
    match (name, error) {
        (
            Some(name),
            ContractError::Invalid {
                what: what @ "regions",
                reason,
                ..
            },
        ) => ContractError::invalid(what, name, reason),
        (_, error) => error,
    }
}

fn say_what(answer: &BudgetAnswer) {
    progress::say(&format!(
        "{} of {}, {} earth, positive out of the sea; {} ({}); cite {}",
        answer.unit,
        answer.region,
        answer.earth,
        answer.cells.title(),
        answer.cells,
        answer.manifest
    ));
    progress::say(&format!(
        "asked for {} 10⁶ km², {} of it sea; what gaps would add, not part of the budget: {}",
        million_km2(answer.region_area_m2),
        million_km2(answer.ocean_area_m2),
        answer.gap_basis
    ));
    progress::say(&format!("what is sea: {}", answer.ocean_source));
    for note in &answer.notes {
        progress::say(&format!("note: {note}"));
    }
    for region in &answer.regions {
        for note in &region.notes {
            progress::say(&format!("note on {}: {note}", region.region));
        }
    }
}

/// What was asked besides: how uncertain it is, rivers, parts.
fn say_besides(answer: &BudgetAnswer) {
    if let Some(own) = &answer.uncertainty {
        let version = own.manifest.as_ref().map(|id| format!(" ({id})"));
        progress::say(&format!(
            "± is one standard error, of {}{}; sum over {}",
            own.error,
            version.unwrap_or_default(),
            own.scheme
        ));
        for assumption in &own.assumptions {
            progress::say(&format!("assumed: {assumption}"));
        }
    }
    if let Some(river) = &answer.river {
        let version = river.manifest.as_ref().map(|id| format!(" ({id})"));
        progress::say(&format!(
            "river flux: {}{}; {}",
            river.source,
            version.unwrap_or_default(),
            river.meaning
        ));
    }
    if let Some(closure) = &answer.closure {
        progress::say(&format!(
            "closure: rows sum to {} kg, their period as one row is {} kg",
            closure.rows_kg, closure.total_kg
        ));
        if let Some(own) = &closure.regions {
            progress::say(&format!(
                "closure: regions {} kg - counted twice {} kg + in none of them {} kg = {} {} kg; {}",
                own.regions_kg,
                own.overlap_kg,
                own.left_out_kg,
                answer.region,
                own.whole_kg,
                own.summary
            ));
        }
    }
}

fn say_history(form: Form, answer: &BudgetHistory) -> Result<()> {
    match form {
        Form::Json => return progress::result(&serde_json::to_string_pretty(answer)?),
        Form::Csv => progress::result(&csv(answer)?)?,
        Form::Table => progress::result(&tables::of_history(answer).trim_fmt())?,
    }
    progress::say(&format!(
        "{} of {}, positive out of the sea, by the {} of {} versions that changed it",
        answer.unit,
        answer.region,
        answer.versions.len(),
        answer.version_count
    ));
    for note in &answer.notes {
        progress::say(&format!("note: {note}"));
    }
    Ok(())
}

/// The newest version of the product that says what is sea.
pub(crate) async fn ocean(
    settings: &Settings,
    store: &Store,
    product: Option<&ProductId>,
) -> Result<Option<Arc<Manifest>>> {
    let Some(product) = product else {
        return Ok(None);
    };
    let manifest = deployment::manifest(store, product, &settings.data).await?;
    Ok(Some(Arc::new(manifest)))
}

/// As [`region`], or the cells of a landed mask that have a code, or what it means: `MASK:CODE`, the mask perhaps in one of its versions.
pub(crate) async fn stored_region(
    settings: &Settings,
    store: &Store,
    text: &str,
) -> Result<AskedRegion> {
    let of_mask = MaskCode::split(text).filter(|_| !file::is_file_name(text));
    let of_mask = of_mask.and_then(|(mask, code)| Some((mask.parse::<AskedVersion>().ok()?, code)));
    let Some((mask, code)) = of_mask else {
        return region(text);
    };
    let mask = deployment::version(store, &mask, &settings.data).await?;
    Ok(mask::region(store, &mask, &code).await?)
}

/// A region file, a named region, a box, GeoJSON text or well-known text.
pub(crate) fn region(text: &str) -> Result<AskedRegion> {
    if file::is_file_name(text) {
        let (region, name) = (file::read(Path::new(text))?, text.to_owned());
        Ok(AskedRegion { region, name })
    } else {
        let parsed: Result<AskedRegion, ContractError> = text.parse();
        // What cannot be meant for a geometry may be a file whose ending is not known, or a name with a slip.
        let is_name = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.' | '/');
        parsed.map_err(|error| {
            if !text.chars().all(is_name) {
                return error.into();
            }
            let endings = file::ENDINGS.join(", .");
            anyhow!("{error}; or the name of a file that ends in .{endings}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_that_are_wrong_are_called_by_their_file() {
        let wrong = || contract::region::named_regions("{\"type\":\"Point\"}").unwrap_err();
        let told = of_file(Some("parts.geojson"), wrong()).to_string();
        assert!(
            told.starts_with("regions \"parts.geojson\" is not valid"),
            "{told}"
        );
        let asked = "{\"type\":\"Point\"}";
        assert_eq!(of_file(Some(asked), wrong()), wrong());
        let other = || ContractError::invalid("river flux", "650", "say where it is from");
        assert_eq!(of_file(Some("parts.geojson"), other()), other());
    }
}
