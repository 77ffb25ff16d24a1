//! Statistics landed: fields and domain stored.

use contract::ContractError;
use contract::analysis::{CorrelationStatistic, MapStatistic};
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use storage::{domain, fields};

use super::computed::{Maps, stored_values};
use super::found::Found;
use super::plan::{Output, Plan};
use super::sources::SourcesOf;
use super::stored::Stored;
use super::wanted::Wanted;
use crate::{ComputeError, Engine};

/// A statistic that was computed, to be stored.
pub(super) struct Landing<'a> {
    pub(super) engine: &'a Engine,
    pub(super) sources: SourcesOf<'a>,
    pub(super) target: &'a ProductId,
    pub(super) plan: &'a Plan,
    pub(super) wanted: &'a Wanted,
    pub(super) stored: &'a Stored,
}

impl Landing<'_> {
    /// Stores everything but the manifest, which is returned with number 0; of bins one after the other, in the order of the
    /// calendar, which is that of their periods.
    pub(super) async fn each(&self, maps: Maps) -> Result<Manifest, ComputeError> {
        let outputs = self.plan.outputs.iter();
        let mut steps = vec![];
        let found = match maps {
            Maps::Held(all) => {
                let mut found = Found::nothing(self.stored.grid.cell_count());
                for (output, values) in outputs.zip(all) {
                    let values = stored_values(&values, self.plan.factor);
                    steps.push(self.step(output, &values).await?);
                    found.add(0, &values);
                }
                found
            }
            Maps::Written(fields, found) => {
                for (output, field) in outputs.zip(fields) {
                    let (field, valid_cells) = field.put(self.engine.store(), self.target).await?;
                    steps.push(output.step(field, valid_cells));
                }
                found
            }
        };
        self.manifest(steps, found).await
    }

    /// Stores one step.
    async fn step(&self, output: &Output, values: &[f32]) -> Result<Step, ComputeError> {
        let (store, grid) = (self.engine.store(), &self.stored.grid);
        let field = fields::write(store, self.target, grid, values, output.period).await?;
        let valid_cells = values.iter().filter(|value| !value.is_nan()).count();
        Ok(output.step(field, valid_cells as u64))
    }

    /// The manifest, with number 0.
    pub(super) async fn manifest(
        &self,
        steps: Vec<Step>,
        found: Found,
    ) -> Result<Manifest, ComputeError> {
        let Self {
            sources,
            target,
            plan,
            ..
        } = *self;
        let source = sources.first;
        if !found.cells.is_any() {
            let name = plan.statistic.to_string();
            return Err(ContractError::invalid("statistic", &name, self.nothing()).into());
        }
        Ok(Manifest {
            schema: MANIFEST_SCHEMA,
            product: target.clone(),
            number: 0,
            title: format!("{}, {}", sources.title(), plan.title),
            quantity: plan.quantity.over(found.range)?,
            synthetic: sources.is_synthetic(),
            source: sources.citation(),
            grid: self.stored.grid,
            steps,
            domain: domain::write_cells(self.engine.store(), target, found.cells).await?,
            series: vec![],
            derived_from: Some(source.id()),
            computed: Some(plan.computed.clone()),
            notices: vec![],
            indexes: vec![],
        })
    }

    /// Why no cell has a value.
    fn nothing(&self) -> String {
        let reason = match self.plan.statistic {
            MapStatistic::Trend
            | MapStatistic::TrendPValue
            | MapStatistic::LeastSquaresTrend
            | MapStatistic::LeastSquaresTrendPValue => {
                "has the ten values and five years that a trend needs"
            }
            MapStatistic::Amplitude | MapStatistic::Phase => {
                "has the eight values in different parts of a year that a season needs"
            }
            MapStatistic::Correlation(CorrelationStatistic::Pairs) => "holds data of both products",
            MapStatistic::Correlation(_) => {
                "has three pairs of values that vary, in as many of the common steps as is asked for"
            }
            _ => "holds data in as much of the time as is asked for",
        };
        let place = match self.wanted {
            Wanted::All => "",
            Wanted::Some(_) => " of the region",
        };
        format!("no cell{place} {reason}")
    }
}
