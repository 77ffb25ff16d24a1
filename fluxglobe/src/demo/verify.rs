//! What `--exit-after-check` checks: budgets, conservation of mass, and tiles fetched over HTTP. Failures out, as text.

use std::time::Duration;

use anyhow::{Context as _, Result};
use contract::budget::BudgetQuery;
use contract::check::Check;
use contract::earth::Earth;
use contract::manifest::Manifest;
use storage::Store;
use tile_server::Server;

use crate::cli::Settings;
use crate::{deployment, progress};

/// Largest relative difference between the accumulated fields' sum and the printed budget.
const MASS_TOLERANCE: f64 = 1e-6;
/// Characters of a refusal that are shown.
const SHOWN_CHARS: usize = 300;
/// Paths that must answer 200.
const PAGES: [&str; 5] = ["/", "/healthz", "/readyz", "/metrics", "/api/products"];

pub(crate) async fn all(
    settings: &Settings,
    store: &Store,
    server: Server,
    flux: &Manifest,
    check: Option<&Check>,
) -> Result<Vec<String>> {
    let mut failures = vec![];
    for row in check
        .iter()
        .flat_map(|check| &check.rows)
        .filter(|row| !row.agrees)
    {
        failures.push(format!(
            "{} {}: {} {}, an independent integration of the same grid gives {}",
            row.what, row.period, row.ours, row.unit, row.independent
        ));
    }
    failures.extend(mass(settings, store, flux).await?);
    let base = format!("http://{}", server.address());
    let paths = paths(flux);
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let serving = tokio::spawn(server.run(async move {
        // Either way of ending means that the checks are over.
        drop(stopped.await);
    }));
    let bar = progress::bar("fetch over HTTP", paths.len() as u64);
    let fetched = tokio::task::spawn_blocking({
        let bar = bar.clone();
        move || {
            let mut failures = vec![];
            for path in paths {
                bar.set_message(path.clone());
                failures.extend(
                    fetch(&base, &path)
                        .err()
                        .map(|error| format!("{path}: {error:#}")),
                );
                bar.inc(1);
            }
            failures
        }
    });
    failures.extend(fetched.await?);
    progress::done(
        &bar,
        if failures.is_empty() {
            "all answered"
        } else {
            "not all well"
        },
    );
    drop(stop);
    serving.await??;
    Ok(failures)
}

fn paths(flux: &Manifest) -> Vec<String> {
    let product = &flux.product;
    let mut paths: Vec<String> = PAGES.iter().map(|path| (*path).to_owned()).collect();
    for mode in contract::job::Mode::SCALAR {
        paths.push(format!("/tiles/{product}/{mode}/0/0/0.png"));
    }
    let center = flux
        .grid
        .cell_center(flux.grid.rows / 2, flux.grid.cols / 2);
    paths.push(format!(
        "/globe/{product}/volume.png?lon={}&lat={}&width=320&height=240",
        center.lon, center.lat
    ));
    paths.push(format!(
        "/api/products/{product}/point?lon={}&lat={}",
        center.lon, center.lat
    ));
    paths.push(format!("/api/products/{product}/budget?step=month"));
    paths
}

/// A page must answer; a picture must also show something.
fn fetch(base: &str, path: &str) -> Result<()> {
    let agent: ureq::Agent = ureq::Agent::config_builder()
        .timeout_global(Some(Duration::from_mins(2)))
        .http_status_as_error(false)
        .build()
        .into();
    let mut response = agent.get(format!("{base}{path}")).call()?;
    let status = response.status();
    let body = response.body_mut().read_to_vec()?;
    anyhow::ensure!(status.is_success(), refusal(path, status.as_u16(), &body));
    anyhow::ensure!(!body.is_empty(), "an empty answer");
    if path.contains(".png") {
        let picture = image::load_from_memory(&body)
            .context("not a picture")?
            .to_rgba8();
        anyhow::ensure!(
            picture.pixels().any(|pixel| pixel[3] > 0),
            "an empty picture"
        );
    }
    Ok(())
}

/// What an answer other than 200 says, and of the page itself what to do.
fn refusal(path: &str, status: u16, body: &[u8]) -> String {
    if path == "/" {
        return format!(
            "{status}: the viewer has not been built; `make viewer` builds it, and --viewer names the folder of one that is elsewhere"
        );
    }
    let text = String::from_utf8_lossy(body);
    let text: String = text.chars().take(SHOWN_CHARS).collect();
    format!("{status}: {text}")
}

/// The accumulated fields must hold the mass that the budget says left the sea.
async fn mass(settings: &Settings, store: &Store, flux: &Manifest) -> Result<Option<String>> {
    let accumulated =
        deployment::manifest(store, &flux.product.accumulated()?, &settings.data).await?;
    let last = accumulated
        .steps
        .last()
        .context("the accumulated product has no step")?;
    let values = storage::fields::read(store, &last.field, &accumulated.grid).await?;
    let cols = accumulated.grid.cols as usize;
    let area_m2 = |index: usize| {
        accumulated
            .grid
            .cell_area_m2((index / cols) as u32, Earth::Wgs84)
    };
    let cells = values
        .iter()
        .enumerate()
        .filter(|(_, value)| !value.is_nan());
    let in_fields_tg: f64 = cells
        .map(|(index, value)| f64::from(*value) * area_m2(index) / 1e9)
        .sum();
    let query = BudgetQuery::new(flux.product.clone(), "global".parse()?);
    let answer =
        compute::budget::budget_of(&deployment::engine(settings, store.clone())?, &query, flux)
            .await?;
    let budget_tg: f64 = answer.rows.iter().map(|row| row.budget_tg).sum();
    let difference = (in_fields_tg / budget_tg - 1.0).abs();
    progress::say(&format!(
        "{:>24} {in_fields_tg:.6} Tg C in fields, {budget_tg:.6} in the budget, relative difference {difference:.1e}",
        "conservation"
    ));
    let is_kept = difference <= MASS_TOLERANCE;
    Ok((!is_kept)
        .then(|| format!("accumulated fields hold {in_fields_tg} Tg C, the budget is {budget_tg}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_answer_says_why() {
        let page = refusal("/", 404, b"<html>");
        assert!(page.contains("make viewer") && page.contains("--viewer"));
        let tile = refusal("/tiles/a/map/0/0/0.png", 503, b"{\"error\":\"busy\"}");
        assert_eq!(tile, "503: {\"error\":\"busy\"}");
    }
}
