//! Latitude or longitude against time: a version of a product and bands in, their means step by step out.

use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{Along, Hovmoller, HovmollerQuery, HovmollerRow};
use contract::cited::Cited;
use contract::grid::rounded_deg;
use contract::manifest::{Manifest, Step};
use contract::quantity::Display;
use contract::region::Region;
use contract::statistics::MinCoverage;
use contract::time::{Period, TimeStep};
use cube::Values;
use futures::TryStreamExt as _;
use futures::future::BoxFuture;
use storage::{Store, domain};

use super::banded::Banded;
use super::bands::{BandAreas, BandSum, Bands};
use super::read::Version;
use super::timeline::no_shorter;
use crate::step_range::step_range;
use crate::summed::check_averaged;
use crate::{ComputeError, Engine};

/// Means in one answer: 5 MiB as text.
const MOST_MEANS: usize = 400_000;
/// Heights of bands that are chosen where nobody chose one, degrees.
const BANDS_DEG: [f64; 4] = [1.0, 2.0, 5.0, 10.0];

/// The means of bands of a version of a product against time.
///
/// Of each step the cells inside the bounds are read, with what is stored round them. Each counts by area and time: the mean of a month is that of all its
/// cells with data over all its time, so that a cell that is seen once counts by the step that saw it. Of polygons each cell counts by its
/// exact share, as in the mean over the polygons clipped to a band; a cell that an edge of a band cuts is in the band of its middle. Rows end
/// with the asked period and with what steps cover of it: a step across an end counts by its time inside, and coverage is of the rest of the bin.
///
/// # Errors
/// No step in the period, nothing of the grid inside the bounds or the region, bands below the size of cells, more means, or rows, than one
/// answer holds.
pub fn hovmoller<'a>(
    engine: &'a Engine,
    (manifest, id): Version<'a>,
    query: &'a HovmollerQuery,
) -> BoxFuture<'a, Result<Hovmoller, ComputeError>> {
    Box::pin(async move {
        check_averaged(manifest)?;
        let (window, steps) = manifest.steps_inside(query.from, query.to)?;
        let grid = &manifest.grid;
        let band_deg = band_deg(manifest, query)?;
        let banded = match query.region.as_ref().map(|asked| &asked.region) {
            None | Some(Region::Global) => {
                Banded::of_box(manifest, query, band_deg, grid.shown_bounds_deg())?
            }
            Some(Region::Box {
                west,
                south,
                east,
                north,
            }) => Banded::of_box(manifest, query, band_deg, [*west, *south, *east, *north])?,
            Some(region @ Region::Polygons(_)) => {
                Box::pin(Banded::of_region(
                    engine,
                    manifest,
                    query,
                    (band_deg, region),
                ))
                .await?
            }
        };
        let bands = &banded.bands;
        let periods: Vec<Period> = steps.iter().map(|step| step.period).collect();
        let step = no_shorter(&periods, query.step);
        let bins = step.bins(covered(window, &periods), periods.iter().copied())?;
        let means = bins.len().saturating_mul(bands.edges_deg().len());
        if means > MOST_MEANS {
            let reason = format!(
                "{means} means are more than an answer's {MOST_MEANS}: ask for longer steps, wider bands or a shorter period"
            );
            return Err(ContractError::invalid("step", step.as_str(), reason).into());
        }
        let store = engine.store();
        let areas = areas(store, manifest, bands).await?;
        // One row of all is a profile, which is told with its spread.
        let with_stds = step == TimeStep::Total;
        let sums = sums_in(store, manifest, &steps, bands, (&bins[..], with_stds)).await?;
        let mut rows = Rows {
            covered_m2: areas.iter().map(|own| banded.covered_m2(own)).collect(),
            display: manifest.quantity.display(),
            with_stds,
            least: query.min_coverage,
            left_out: 0,
        };
        let all = bins.iter().zip(&sums);
        let all: Vec<HovmollerRow> = all.map(|(bin, sums)| rows.row(*bin, sums)).collect();
        let edges = bands.edges_deg().iter().zip(&areas);
        Ok(Hovmoller {
            cited: Cited::of(manifest, id.clone()),
            along: query.along,
            band_deg,
            bounds_deg: banded.bounds_deg,
            step,
            earth: query.earth,
            coverage_basis: banded.coverage_basis().to_owned(),
            min_coverage_percent: query.min_coverage.percent(),
            left_out_count: rows.left_out,
            bands: edges.map(|(edges, own)| banded.band(*edges, own)).collect(),
            notes: banded.notes(&areas, rows.left_out_note(means)),
            region: banded.region,
            rows: all,
        })
    })
}

/// What steps that reach into a period cover of it: rows are of that and of nothing else.
fn covered(window: Period, steps: &[Period]) -> Period {
    let start = steps.first().map_or(window.start, |step| step.start);
    let end = steps.last().map_or(window.end, |step| step.end);
    Period {
        start: start.max(window.start),
        end: end.min(window.end),
    }
}

/// What rows are made with.
struct Rows {
    /// Of each band, what coverage is a share of, m².
    covered_m2: Vec<f64>,
    display: Display,
    with_stds: bool,
    least: MinCoverage,
    /// Means that were left out of rows so far.
    left_out: u64,
}

impl Rows {
    fn row(&mut self, bin: Period, sums: &[BandSum]) -> HovmollerRow {
        let (display, least) = (self.display, self.least);
        let coverage_percent = |(sum, area_m2): (&BandSum, &f64)| {
            let all = area_m2 * bin.seconds();
            if all > 0.0 {
                (100.0 * sum.covered_m2 / all).min(100.0)
            } else {
                0.0
            }
        };
        let covered = sums.iter().zip(&self.covered_m2);
        let coverage_percent: Vec<f64> = covered.map(coverage_percent).collect();
        let is_kept =
            |(sum, percent): (&BandSum, &f64)| sum.area_m2 > 0.0 && least.is_met(*percent);
        let kept: Vec<bool> = sums.iter().zip(&coverage_percent).map(is_kept).collect();
        let with_data = sums.iter().filter(|sum| sum.area_m2 > 0.0).count();
        let kept_count = kept.iter().filter(|is_kept| **is_kept).count();
        self.left_out += (with_data - kept_count) as u64;
        let own = || {
            sums.iter()
                .zip(&kept)
                .map(|(sum, kept)| kept.then_some(sum))
        };
        let mean = |sum: Option<&BandSum>| sum?.mean().map(|mean| display.shown(mean));
        let std = |sum: Option<&BandSum>| sum?.std().map(|std| std * display.factor.abs());
        HovmollerRow {
            start: bin.start,
            end: bin.end,
            means: own().map(mean).collect(),
            stds: own().filter(|_| self.with_stds).map(std).collect(),
            coverage_percent,
        }
    }

    /// What was left out of so many means.
    fn left_out_note(&self, means: usize) -> Option<String> {
        let (out, least) = (self.left_out, self.least.percent());
        (out > 0).then(|| {
            format!(
                "{out} of {means} means have a coverage of less than {least} % and are left out"
            )
        })
    }
}

fn band_deg(manifest: &Manifest, query: &HovmollerQuery) -> Result<f64, ContractError> {
    let cell_deg = match query.along {
        Along::Lat => manifest.grid.dlat_deg,
        Along::Lon => manifest.grid.dlon_deg,
    };
    // Steps of grids come from rounded coordinates.
    let least = cell_deg * (1.0 - 1e-6);
    let shown_deg = rounded_deg(cell_deg);
    let refused = |band: f64, reason: String| {
        let text = band.to_string();
        Err(ContractError::invalid("band", &text, reason))
    };
    match query.band_deg {
        None => Ok(BANDS_DEG
            .into_iter()
            .find(|band| *band >= least)
            .unwrap_or(cell_deg)),
        Some(band) if band.is_finite() && band >= least && band <= 180.0 => Ok(band),
        Some(band) if band > 0.0 && band < least => refused(
            band,
            format!(
                "the band is narrower than the cells of {}, of {shown_deg} degrees: ask for bands of {shown_deg} degrees or more, or leave \
                 their size out",
                manifest.product
            ),
        ),
        Some(band) => refused(
            band,
            format!("from the size of a cell, {shown_deg}, to 180 degrees"),
        ),
    }
}

/// Areas of each band; some cells are those that hold data in some step.
async fn areas(
    store: &Store,
    manifest: &Manifest,
    bands: &Bands,
) -> Result<Vec<BandAreas>, ComputeError> {
    let cells = domain::read_cells(store, &manifest.domain).await?;
    if cells.map_count() != manifest.grid.cell_count() {
        let what = manifest.domain.to_string();
        return Err(ComputeError::inconsistent(
            what,
            "it does not fill its product's grid",
        ));
    }
    let cols = manifest.grid.cols as usize;
    let of_row = |row: u32| cells.flags(row as usize * cols..(row as usize + 1) * cols);
    Ok(bands.areas(of_row))
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
