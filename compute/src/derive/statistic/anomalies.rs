//! Anomalies landed: the climatology computed, then step by step taken off.

use contract::manifest::{Manifest, SeriesSegment};
use contract::product::ProductId;
use storage::{fields, series};

use super::super::{DeriveProgress, Progress};
use super::landed::{Found, computed, manifest, step};
use super::plan::Plan;
use crate::{ComputeError, Engine};

/// Values of one series segment: 256 MiB of f32, whatever the grid.
const SEGMENT_VALUES: usize = 64 << 20;

/// Computes and stores everything but the manifest, which is returned with number 0.
pub(super) async fn land(
    engine: &Engine,
    source: &Manifest,
    target: &ProductId,
    plan: &Plan,
    progress: &Progress<'_>,
) -> Result<Manifest, ComputeError> {
    let (store, grid) = (engine.store(), &source.grid);
    let normals = computed(engine, source, plan, &|_cells| ()).await?;
    let written = plan.first_written..plan.first_written + plan.outputs.len();
    let sources = &source.steps[written];
    let per_segment = (SEGMENT_VALUES / grid.cell_count()).max(1);
    let (mut steps, mut segments) = (vec![], vec![]);
    let mut found = Found::nothing(grid.cell_count());
    let all: Vec<_> = sources.iter().zip(&plan.outputs).collect();
    for run in all.chunks(per_segment) {
        let mut columns = vec![];
        for (own, output) in run {
            let mut values = fields::read(store, &own.field, grid).await?;
            let normal = &normals[plan.bins.of(own.period)];
            for (value, normal) in values.iter_mut().zip(normal) {
                *value = ((f64::from(*value) - normal) * plan.factor) as f32;
            }
            found.add(&values);
            steps.push(step(store, source, target, output, &values).await?);
            columns.push(values);
            progress(DeriveProgress {
                done_steps: steps.len(),
                all_steps: all.len(),
            });
        }
        let views: Vec<&[f32]> = columns.iter().map(Vec::as_slice).collect();
        segments.push(SeriesSegment {
            first_step: (steps.len() - run.len()) as u32,
            steps: run.len() as u32,
            series: series::write(store, target, grid, &views).await?,
        });
    }
    manifest(store, source, target, plan, (steps, segments), &found).await
}
