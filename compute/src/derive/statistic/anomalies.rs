//! Anomalies landed: step by step, the climatology taken off.

use contract::manifest::{Manifest, Step};
use futures::{FutureExt as _, StreamExt as _, TryStreamExt as _, stream};
use storage::fields;

use super::super::{DeriveProgress, Progress};
use super::landed::{Found, Landing};
use crate::ComputeError;

impl Landing<'_> {
    /// Stores everything but the manifest, which is returned with number 0; `normals` are those of every bin, `[bin][row, col]`,
    /// stored unit, NaN where there is none.
    pub(super) async fn anomalies(
        &self,
        normals: &[Vec<f64>],
        progress: &Progress<'_>,
    ) -> Result<Manifest, ComputeError> {
        let plan = self.plan;
        let mut found = Found::nothing(self.source.grid.cell_count());
        let mut steps = vec![];
        let each = (0..plan.outputs.len()).map(|at| self.anomaly(at, normals).boxed());
        // One is read while others are encoded, in the order of time.
        let mut landing = stream::iter(each).buffered(self.engine.partitions().get() + 1);
        while let Some((step, of_step)) = landing.try_next().await? {
            found.merge(&of_step);
            steps.push(step);
            progress(DeriveProgress {
                done_steps: steps.len(),
                all_steps: plan.outputs.len(),
            });
        }
        drop(landing);
        self.manifest(steps, &found).await
    }

    async fn anomaly(
        &self,
        at: usize,
        normals: &[Vec<f64>],
    ) -> Result<(Step, Found), ComputeError> {
        let (own, output) = (
            &self.source.steps[self.plan.first_written + at],
            &self.plan.outputs[at],
        );
        let store = self.engine.store();
        let mut values = fields::read(store, &own.field, &self.source.grid).await?;
        let normal = &normals[self.plan.bins.of(own.period)];
        // Where nothing was wanted there is no normal.
        for (value, normal) in values.iter_mut().zip(normal) {
            *value = ((f64::from(*value) - normal) * self.plan.factor) as f32;
        }
        let mut found = Found::nothing(values.len());
        found.add(&values);
        Ok((self.step(output, &values).await?, found))
    }
}
