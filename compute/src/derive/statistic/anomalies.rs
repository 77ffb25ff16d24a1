//! Anomalies landed: the climatology computed, then step by step taken off.

use contract::manifest::Manifest;
use contract::product::ProductId;
use storage::fields;

use super::super::{DeriveProgress, Progress};
use super::landed::{Found, computed, manifest, step};
use super::plan::Plan;
use crate::{ComputeError, Engine};

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
    let mut steps = vec![];
    let mut found = Found::nothing(grid.cell_count());
    for (own, output) in sources.iter().zip(&plan.outputs) {
        let mut values = fields::read(store, &own.field, grid).await?;
        let normal = &normals[plan.bins.of(own.period)];
        for (value, normal) in values.iter_mut().zip(normal) {
            *value = ((f64::from(*value) - normal) * plan.factor) as f32;
        }
        found.add(&values);
        steps.push(step(store, source, target, output, &values).await?);
        progress(DeriveProgress {
            done_steps: steps.len(),
            all_steps: sources.len(),
        });
    }
    manifest(store, source, target, plan, steps, &found).await
}
