//! Latitude or longitude against time: a version of a product and bands in, their means step by step out.

use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{Along, Hovmoller, HovmollerBand, HovmollerQuery, HovmollerRow};
use contract::cited::Cited;
use contract::grid::Grid;
use contract::manifest::{Manifest, Step};
use contract::quantity::Display;
use contract::time::{Period, TimeStep};
use cube::Values;
use futures::TryStreamExt as _;
use futures::future::BoxFuture;
use storage::{Store, domain};

use super::bands::{BandSum, Bands};
use super::read::Version;
use super::timeline::{bins_over, no_shorter};
use crate::ComputeError;
use crate::step_range::step_range;
use crate::summed::check_averaged;

/// Means in one answer: 5 MiB as text.
const MOST_MEANS: usize = 400_000;
/// Heights of bands that are chosen where nobody chose one, degrees.
const BANDS_DEG: [f64; 4] = [1.0, 2.0, 5.0, 10.0];

/// The means of bands of a version of a product against time.
///
/// Of each step the cells inside the bounds are read, with what is stored round them. Each counts by area and time: the mean of a month is that of all its
/// cells with data over all its time, so that a cell that is seen once counts by the step that saw it.
///
/// # Errors
/// No step in the period, nothing of the grid inside the bounds, bands below the size of cells, more means than one answer holds.
pub fn hovmoller<'a>(
    store: &'a Store,
    (manifest, id): Version<'a>,
    query: &'a HovmollerQuery,
) -> BoxFuture<'a, Result<Hovmoller, ComputeError>> {
    Box::pin(async move {
        check_averaged(manifest)?;
        let (_window, steps) = manifest.steps_inside(query.from, query.to)?;
        let grid = &manifest.grid;
        let band_deg = band_deg(grid, query)?;
        let bounds_deg = bounds_deg(grid, query)?;
        let bands = Bands::of(grid, query.along, band_deg, bounds_deg, query.earth);
        if bands.edges_deg().is_empty() {
            let reason = format!(
                "no cell of {} has its middle in it; it covers {}",
                manifest.product,
                manifest.bounds_text()
            );
            let text = bounds_deg.map(|edge| edge.to_string()).join(",");
            return Err(ContractError::invalid("region", &text, reason).into());
        }
        let periods: Vec<Period> = steps.iter().map(|step| step.period).collect();
        let step = no_shorter(&periods, query.step);
        let bins = bins_over(&periods, step);
        let means = bins.len().saturating_mul(bands.edges_deg().len());
        if means > MOST_MEANS {
            let reason = format!(
                "{means} means are more than an answer's {MOST_MEANS}: ask for longer steps, wider bands or a shorter period"
            );
            return Err(ContractError::invalid("step", step.as_str(), reason).into());
        }
        let bands = Arc::new(bands);
        let areas_m2 = domain_areas(store, manifest, &bands).await?;
        // One row of all is a profile, which is told with its spread.
        let with_stds = step == TimeStep::Total;
        let sums = sums_in(store, manifest, &steps, &bands, (&bins[..], with_stds)).await?;
        let display = manifest.quantity.display();
        let row = |(bin, sums): (&Period, &Vec<BandSum>)| {
            row(*bin, sums, &areas_m2, (display, with_stds))
        };
        let band = |((low_deg, high_deg), area_m2): (&(f64, f64), &f64)| HovmollerBand {
            low_deg: *low_deg,
            high_deg: *high_deg,
            area_m2: *area_m2,
        };
        Ok(Hovmoller {
            cited: Cited::of(manifest, id.clone()),
            along: query.along,
            band_deg,
            bounds_deg,
            step,
            earth: query.earth,
            bands: bands.edges_deg().iter().zip(&areas_m2).map(band).collect(),
            rows: bins.iter().zip(&sums).map(row).collect(),
        })
    })
}

/// A row of the sums of bands whose areas with data are `areas_m2`.
fn row(
    bin: Period,
    sums: &[BandSum],
    areas_m2: &[f64],
    (display, with_stds): (Display, bool),
) -> HovmollerRow {
    let coverage_percent = |(sum, area_m2): (&BandSum, &f64)| {
        let all = area_m2 * bin.seconds();
        if all > 0.0 {
            (100.0 * sum.area_m2 / all).min(100.0)
        } else {
            0.0
        }
    };
    let mean = |sum: &BandSum| sum.mean().map(|mean| display.shown(mean));
    let std = |sum: &BandSum| sum.std().map(|std| std * display.factor.abs());
    HovmollerRow {
        start: bin.start,
        end: bin.end,
        means: sums.iter().map(mean).collect(),
        stds: sums.iter().filter(|_| with_stds).map(std).collect(),
        coverage_percent: sums.iter().zip(areas_m2).map(coverage_percent).collect(),
    }
}

fn band_deg(grid: &Grid, query: &HovmollerQuery) -> Result<f64, ContractError> {
    let cell_deg = match query.along {
        Along::Lat => grid.dlat_deg,
        Along::Lon => grid.dlon_deg,
    };
    // Steps of grids come from rounded coordinates.
    let least = cell_deg * (1.0 - 1e-6);
    match query.band_deg {
        None => Ok(BANDS_DEG
            .into_iter()
            .find(|band| *band >= least)
            .unwrap_or(cell_deg)),
        Some(band) if band.is_finite() && band >= least && band <= 180.0 => Ok(band),
        Some(band) => {
            let reason = format!("from the size of a cell, {cell_deg}, to 180 degrees");
            Err(ContractError::invalid("band", &band.to_string(), reason))
        }
    }
}

fn bounds_deg(grid: &Grid, query: &HovmollerQuery) -> Result<[f64; 4], ContractError> {
    let Some(bounds) = query.bounds_deg else {
        return Ok(grid.shown_bounds_deg());
    };
    let [west, south, east, north] = bounds;
    let is_one = bounds.iter().all(|edge| edge.is_finite())
        && (-90.0..=90.0).contains(&south)
        && (-90.0..=90.0).contains(&north)
        && south < north
        && west < east
        && east - west <= 360.0;
    if is_one {
        return Ok(bounds);
    }
    let text = bounds.map(|edge| edge.to_string()).join(",");
    let valid = "west,south,east,north in degrees, at most once around";
    Err(ContractError::invalid("region", &text, valid))
}

/// Area of the cells of each band that hold data in some step, m².
async fn domain_areas(
    store: &Store,
    manifest: &Manifest,
    bands: &Bands,
) -> Result<Vec<f64>, ComputeError> {
    let cells = domain::read_cells(store, &manifest.domain).await?;
    if cells.map_count() != manifest.grid.cell_count() {
        let what = manifest.domain.to_string();
        return Err(ComputeError::inconsistent(
            what,
            "it does not fill its product's grid",
        ));
    }
    let cols = manifest.grid.cols as usize;
    Ok(bands.areas_m2(|row, col| cells.has(row as usize * cols + col as usize)))
}

/// Sums of each bin and band, by area and seconds, with squares where they are asked for.
async fn sums_in(
    store: &Store,
    manifest: &Manifest,
    steps: &[&Step],
    bands: &Arc<Bands>,
    (bins, with_squares): (&[Period], bool),
) -> Result<Vec<Vec<BandSum>>, ComputeError> {
    let windows = bands.windows();
    let values = Values::of(store, &Arc::new(manifest.clone())).await?;
    let range = step_range(manifest, steps)?;
    let mut read = std::pin::pin!(values.each(range, &windows));
    let mut all = vec![vec![BandSum::default(); bands.edges_deg().len()]; bins.len()];
    // In the order of time, so that sums have the same bits each time.
    for step in steps {
        let Some(values) = read.try_next().await? else {
            let what = step.field.to_string();
            return Err(ComputeError::inconsistent(what, "it was not read"));
        };
        let (period, bands, windows) = (step.period, Arc::clone(bands), windows.clone());
        let sums = tokio::task::spawn_blocking(move || {
            if with_squares {
                bands.sums_with_squares(&windows, &values)
            } else {
                bands.sums(&windows, &values)
            }
        });
        let sums = sums.await;
        let sums = sums.map_err(|e| ComputeError::inconsistent(step.field.to_string(), e))?;
        let from = bins.partition_point(|bin| bin.end <= period.start);
        let touched = bins.iter().zip(&mut all).skip(from);
        for (bin, all) in touched.take_while(|(bin, _)| bin.start < period.end) {
            let shared_ms = period.end.min(bin.end).ms() - period.start.max(bin.start).ms();
            let seconds = shared_ms as f64 / 1000.0;
            for (all, sum) in all.iter_mut().zip(&sums) {
                all.add(sum, seconds);
            }
        }
    }
    Ok(all)
}
