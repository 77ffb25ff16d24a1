//! Accumulated carbon: a product of fluxes in, a product of the carbon given off since a chosen start out.

mod steps;

use contract::digest::Digest;
use contract::event::Body;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, ManifestId, SeriesSegment, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use serde::Serialize;
use storage::{StorageError, domain, frames, manifests, series};

use crate::{ComputeError, Engine, catalog};
use steps::accumulate_segment;

/// Values of one query and one series segment: 256 MiB of f32, whatever the grid.
const SEGMENT_VALUES: usize = 64 << 20;
/// How often the commit is tried again when another writer takes the number.
const COMMIT_ATTEMPTS: u32 = 5;

/// How far a derivation has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeriveProgress {
    /// Steps stored.
    pub done_steps: usize,
    /// Steps in all.
    pub all_steps: usize,
}

/// A step of the source and the part of it after the start.
#[derive(Debug, Clone, Copy)]
struct SourceStep<'a> {
    step: &'a Step,
    /// From the start on; the whole period except perhaps in the first step.
    period: Period,
}

/// What a derived step depends on.
#[derive(Serialize)]
struct StepJob<'a> {
    kind: &'static str,
    source: &'a ManifestId,
    start: TimeMs,
    period: Period,
}

/// Derives the product of a flux product's accumulated carbon, kg m⁻², from `start` (the product's own if absent) on.
///
/// A step's values hold at its end. A gap in time leaves a cell as it was; a cell without data in any step holds none.
/// If the newest version was derived from the same version of the source and the same start, it is returned as it is.
/// [`derived`] is the event to tell of it, after the manifest.
pub async fn derive_accumulated(
    engine: &Engine,
    product: &ProductId,
    start: Option<TimeMs>,
    progress: &(dyn Fn(DeriveProgress) + Send + Sync),
) -> Result<Manifest, ComputeError> {
    let source = catalog::product(engine.store(), product).await?;
    if source.quantity != Quantity::CarbonFlux {
        return Err(ComputeError::NotAFlux {
            product: product.clone(),
            quantity: source.quantity,
        });
    }
    let steps = steps_since(&source, start)?;
    let target = product.accumulated()?;
    let latest = manifests::latest(engine.store(), &target).await?;
    let manifest = match latest.filter(|latest| is_up_to_date(latest, &source, &steps)) {
        Some(latest) => {
            progress(DeriveProgress {
                done_steps: steps.len(),
                all_steps: steps.len(),
            });
            latest
        }
        None => {
            commit(
                engine,
                &source,
                &steps,
                derive(engine, &source, &target, &steps, progress).await?,
            )
            .await?
        }
    };
    Ok(manifest)
}

/// What is told of a derived manifest; nothing if it was not derived.
pub fn derived(manifest: &Manifest) -> Option<Body> {
    Some(Body::ProductDerived {
        manifest: manifest.id(),
        derived_from: manifest.derived_from.clone()?,
    })
}

/// The steps that end after the start, the first cut at it.
fn steps_since(
    source: &Manifest,
    start: Option<TimeMs>,
) -> Result<Vec<SourceStep<'_>>, ComputeError> {
    let mut steps = vec![];
    for step in &source.steps {
        let from = start.map_or(step.period.start, |start| start.max(step.period.start));
        if from < step.period.end {
            steps.push(SourceStep {
                step,
                period: Period::new(from, step.period.end)?,
            });
        }
    }
    if steps.is_empty() {
        let asked = start.map_or_else(
            || "any period".to_owned(),
            |start| format!("the time from {start} on"),
        );
        return Err(ComputeError::NoStep {
            product: source.product.clone(),
            asked,
            covered: source.extent(),
        });
    }
    Ok(steps)
}

fn is_up_to_date(latest: &Manifest, source: &Manifest, steps: &[SourceStep<'_>]) -> bool {
    let periods = latest.steps.iter().map(|step| step.period);
    latest.derived_from.as_ref() == Some(&source.id())
        && periods.eq(steps.iter().map(|step| step.period))
}

/// Computes and stores everything but the manifest, which is returned with number 0.
async fn derive(
    engine: &Engine,
    source: &Manifest,
    target: &ProductId,
    steps: &[SourceStep<'_>],
    progress: &(dyn Fn(DeriveProgress) + Send + Sync),
) -> Result<Manifest, ComputeError> {
    let store = engine.store();
    let cells = domain::read(store, &source.domain).await?;
    if cells.len() != source.grid.cell_count() {
        return Err(ComputeError::inconsistent(
            source.domain.to_string(),
            "it does not fill its product's grid",
        ));
    }
    let per_segment = (SEGMENT_VALUES / source.grid.cell_count()).max(1);
    let (mut sums, mut done) = (vec![0; source.grid.cell_count()], vec![]);
    let mut segments = vec![];
    for run in steps.chunks(per_segment) {
        let columns = accumulate_segment(engine, &source.grid, run, &cells, &mut sums).await?;
        let views: Vec<&[f32]> = columns.iter().map(Vec::as_slice).collect();
        let key = series::write(store, target, &source.grid, &views).await?;
        segments.push(SeriesSegment {
            first_step: done.len() as u32,
            steps: run.len() as u32,
            series: key,
        });
        for (step, values) in run.iter().zip(&columns) {
            let frame = frames::write(store, target, &source.grid, values, step.period).await?;
            let job = StepJob {
                kind: "accumulated",
                source: &source.id(),
                start: steps[0].period.start,
                period: step.period,
            };
            done.push(Step {
                period: step.period,
                frame,
                raw_sha256: Digest::of_json(&job),
                origin: format!("accumulated from {}, {}", source.id(), step.step.origin),
                valid_cells: values.iter().filter(|value| !value.is_nan()).count() as u64,
            });
            progress(DeriveProgress {
                done_steps: done.len(),
                all_steps: steps.len(),
            });
        }
    }
    Ok(Manifest {
        schema: MANIFEST_SCHEMA,
        product: target.clone(),
        number: 0,
        title: format!("{}, accumulated", source.title),
        quantity: Quantity::AccumulatedCarbon,
        synthetic: source.synthetic,
        source: source.source.clone(),
        grid: source.grid,
        steps: done,
        domain: domain::write(store, target, &cells).await?,
        series: segments,
        derived_from: Some(source.id()),
    })
}

/// Publishes the manifest under the next free number, unless another writer published the same derivation meanwhile.
async fn commit(
    engine: &Engine,
    source: &Manifest,
    steps: &[SourceStep<'_>],
    derived: Manifest,
) -> Result<Manifest, ComputeError> {
    let mut attempt = 1;
    loop {
        let latest = manifests::latest(engine.store(), &derived.product).await?;
        let number = latest.as_ref().map_or(1, |latest| latest.number + 1);
        if let Some(latest) = latest.filter(|latest| is_up_to_date(latest, source, steps)) {
            return Ok(latest);
        }
        let manifest = Manifest {
            number,
            ..derived.clone()
        };
        match manifests::commit(engine.store(), &manifest).await {
            Ok(()) => return Ok(manifest),
            Err(StorageError::Conflict { .. }) if attempt < COMMIT_ATTEMPTS => attempt += 1,
            Err(e) => return Err(e.into()),
        }
    }
}
