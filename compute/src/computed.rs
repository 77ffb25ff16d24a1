//! Computed products: an expression over products, or a product brought to another grid, in; a product landed out.
//!
//! Every step is computed and stored by an executor, which reads the fields of the inputs and answers with names; then runs
//! of steps are stored time-major in the same way. A step is named by the computation and the content of what it is made of:
//! those of the newest version that still are what they would be, and that are there, are kept.

pub mod co2_flux;
mod fits;
pub(crate) mod job;
mod lineage;
pub(crate) mod make;
mod matched;
mod read;
mod request;
mod work;

use std::collections::{BTreeMap, BTreeSet};

use contract::computed::{Computation, Computed, ComputedInput};
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::masked::MaskedCells;
use contract::quantity::Quantity;
use futures::future::BoxFuture;
use storage::domain::Cells;
use storage::{domain, manifests, verify};

use crate::functions::{COMPUTED_EXTENT, COMPUTED_FIELD};
use crate::publish::{IsStillAsked, MADE_AGAIN, check_asked, publish_if};
use crate::summed::check_regridded;
use crate::{ComputeError, DeriveProgress, Engine, catalogue};
use job::{ExtentMade, ExtentTask, FieldMade, FieldTask, Job, METHOD};
use matched::{Input, Matched, Matches};
pub use request::{Request, RequestedInput};

/// Values that a task looks through for the cells that hold data: 256 MiB of f32, whatever the grid.
const RUN_VALUES: usize = 64 << 20;
/// Steps that it looks through at the least: what it finds lies in the store until clean-up.
const LEAST_RUN: usize = 16;
/// Steps that are asked of the engine at a time, so that progress is told.
const STEPS_AT_A_TIME: usize = 1024;

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The version that holds it.
    pub manifest: Manifest,
    /// Steps that were there and are kept.
    pub kept_count: usize,
    /// Steps of the input that gives the periods which another input has nothing for.
    pub left_out: usize,
    /// In the steps that were computed now, calls by function outside the range that its paper gives; `origin` of a step says
    /// it for good.
    pub outside: BTreeMap<String, u64>,
}

/// Computes a product and lands it. Nothing is changed if the newest version is what would come out, or that of newer inputs, which
/// was asked for alike.
///
/// # Errors
/// [`ComputeError::Expression`] where it makes no sense as it is asked for: mixed units, other grids, no common period.
pub fn compute<'a>(
    engine: &'a Engine,
    request: &'a Request,
    progress: &'a (dyn Fn(DeriveProgress) + Send + Sync),
) -> BoxFuture<'a, Result<Outcome, ComputeError>> {
    Box::pin(async move {
        for _ in 1..MADE_AGAIN {
            match compute_if(engine, request, None, progress).await {
                // It was brought up to date meanwhile, as it was asked for before.
                Err(ComputeError::AskedOtherwise { .. }) => {}
                computed => return computed,
            }
        }
        compute_if(engine, request, None, progress).await
    })
}

/// The same, landed only if the newest version of the product still asks for it.
///
/// # Errors
/// As there; `AskedOtherwise`, with nothing landed.
pub(crate) fn compute_if<'a>(
    engine: &'a Engine,
    request: &'a Request,
    is_still_asked: Option<&'a IsStillAsked<'a>>,
    progress: &'a (dyn Fn(DeriveProgress) + Send + Sync),
) -> BoxFuture<'a, Result<Outcome, ComputeError>> {
    Box::pin(async move {
        let plan = Plan::of(engine, request).await?;
        let latest = manifests::latest(engine.store(), &request.target).await?;
        check_asked((&request.target, latest.as_ref()), is_still_asked)?;
        if let Some(latest) = &latest {
            fits::what_is_there(latest, request, &plan.job)?;
            // Nothing was made of what is not there.
            let inputs = plan.inputs.iter().map(|input| &input.manifest);
            lineage::check(engine.store(), &request.target, inputs).await?;
        }
        let there = verify::own_there(engine.store(), &request.target).await?;
        let kept = kept(&plan, latest.as_ref(), &there);
        let is_there = |latest: &Manifest| {
            there.contains(&latest.domain) && plan.is_what_is_there(request, latest, &kept)
        };
        if let Some(latest) = latest.filter(is_there) {
            cube::keep_up(engine.store(), &latest).await;
            return Ok(Outcome {
                kept_count: latest.steps.len(),
                left_out: plan.matches.left_out,
                outside: BTreeMap::new(),
                manifest: latest,
            });
        }
        let (kept_count, left_out) = (kept.len(), plan.matches.left_out);
        let (steps, outside) = plan.fields(engine, kept, progress).await?;
        let domain = plan.extent(engine, &steps).await?;
        let manifest = plan.manifest(request, steps, domain);
        Ok(Outcome {
            manifest: publish_if(engine, manifest, None, is_still_asked).await?,
            kept_count,
            left_out,
            outside,
        })
    })
}

/// Everything that is known before the first value is read.
struct Plan {
    inputs: Vec<Input>,
    matches: Matches,
    job: Job,
    computation: Digest,
    title: String,
}

impl Plan {
    async fn of(engine: &Engine, request: &Request) -> Result<Self, ComputeError> {
        let mut inputs: Vec<Input> = vec![];
        for asked in &request.inputs {
            if asked.product == request.target {
                let reason = format!("{} cannot be computed from itself", request.target);
                return Err(ComputeError::Expression { reason });
            }
            if inputs.iter().any(|input| input.name == asked.name) {
                let reason = format!("two inputs have the name {:?}", asked.name);
                return Err(ComputeError::Expression { reason });
            }
            inputs.push(Input {
                name: asked.name.clone(),
                manifest: catalogue::product(engine.store(), &asked.product).await?,
                matching: asked.matching,
            });
        }
        let grid = matched::shared_grid(&inputs)?;
        let first = &inputs[0].manifest;
        let job = Job {
            how: request.how.clone(),
            inputs: inputs.iter().map(named_unit).collect(),
            grid,
            target_grid: request.grid.unwrap_or(grid),
            target: request.target.clone(),
            quantity: request.quantity.unwrap_or(first.quantity),
        };
        fits::check(&job)?;
        matched::pressures_of_a_kind(&inputs, &request.how)?;
        matched::places_of_a_kind(&inputs)?;
        matched::codes_are_compared(&inputs, &request.how)?;
        if let Computation::Regrid { method, .. } = request.how {
            check_regridded(first, method)?;
        }
        let title = match (&request.title, &request.how) {
            (Some(title), _) => title.clone(),
            (None, Computation::Regrid { method, .. }) => format!(
                "{}, regridded to {} x {} cells ({method})",
                first.title, job.target_grid.rows, job.target_grid.cols
            ),
            (None, _) => format!("{}, computed", job.quantity.title()),
        };
        Ok(Self {
            matches: matched::steps(&inputs, (request.from, request.to))?,
            computation: computation(&job)?,
            inputs,
            job,
            title,
        })
    }

    fn is_what_is_there(
        &self,
        request: &Request,
        latest: &Manifest,
        kept: &BTreeMap<usize, Step>,
    ) -> bool {
        kept.len() == self.matches.steps.len()
            && latest.steps.len() == kept.len()
            && latest.title == self.title
            && latest.quantity == self.job.quantity
            && latest.computed.as_ref() == Some(&self.computed(request))
    }

    fn computed(&self, request: &Request) -> Computed {
        let named = |input: &Input| ComputedInput {
            name: input.name.clone(),
            manifest: input.manifest.id(),
            matching: input.matching,
        };
        Computed {
            how: request.how.clone(),
            inputs: self.inputs.iter().map(named).collect(),
            from: request.from,
            to: request.to,
            map: None,
        }
    }

    /// Steps with their fields stored, those that are kept as they are.
    async fn fields(
        &self,
        engine: &Engine,
        mut done: BTreeMap<usize, Step>,
        progress: &(dyn Fn(DeriveProgress) + Send + Sync),
    ) -> Result<(Vec<Step>, BTreeMap<String, u64>), ComputeError> {
        let steps = &self.matches.steps;
        let tell = |done_steps| {
            progress(DeriveProgress {
                done_steps,
                all_steps: steps.len(),
            });
        };
        tell(done.len());
        let task = |(index, step): (usize, &Matched)| FieldTask {
            index,
            period: step.period,
            fields: step.fields.clone(),
        };
        let is_new = |(index, _): &(usize, &Matched)| !done.contains_key(index);
        let tasks: Vec<FieldTask> = steps.iter().enumerate().filter(is_new).map(task).collect();
        let mut outside: BTreeMap<String, u64> = BTreeMap::new();
        for some in tasks.chunks(STEPS_AT_A_TIME) {
            let made: Vec<FieldMade> =
                work::on_engine(engine, COMPUTED_FIELD, &self.job, some).await?;
            for made in made {
                if made.method != METHOD {
                    return Err(ComputeError::OtherMethod {
                        product: self.job.target.clone(),
                        theirs: made.method,
                        own: METHOD,
                    });
                }
                for (name, count) in &made.outside {
                    *outside.entry(name.clone()).or_default() += count;
                }
                let step = steps.get(made.index).ok_or_else(not_asked)?;
                done.insert(made.index, self.step(step, made));
            }
            tell(done.len());
        }
        if done.len() != steps.len() {
            return Err(not_asked());
        }
        Ok((done.into_values().collect(), outside))
    }

    fn step(&self, step: &Matched, made: FieldMade) -> Step {
        Step {
            period: step.period,
            field: made.field,
            raw_sha256: matched::made_of(self.computation, step),
            origin: origin(step, &made.outside),
            valid_cells: made.valid_cells,
            masked: Some(MaskedCells {
                implausible: made.implausible,
                ..MaskedCells::default()
            }),
            contributed: None,
        }
    }

    /// The cells that hold data in some of the steps.
    async fn extent(&self, engine: &Engine, steps: &[Step]) -> Result<ObjectKey, ComputeError> {
        let per_run = (RUN_VALUES / self.job.target_grid.cell_count()).max(LEAST_RUN);
        let task = |(index, run): (usize, &[Step])| ExtentTask {
            first: index * per_run,
            fields: run.iter().map(|step| step.field.clone()).collect(),
        };
        let runs = steps.chunks(per_run).enumerate();
        let tasks: Vec<ExtentTask> = runs.map(task).collect();
        let mut made: Vec<ExtentMade> =
            work::on_engine(engine, COMPUTED_EXTENT, &self.job, &tasks).await?;
        made.sort_by_key(|made| made.first);
        let mut cells = Cells::none(self.job.target_grid.cell_count());
        for (made, task) in made.iter().zip(&tasks) {
            if made.first != task.first {
                return Err(not_asked());
            }
            let own = domain::read_cells(engine.store(), &made.domain).await?;
            if own.map_count() != cells.map_count() {
                return Err(not_asked());
            }
            cells.add(&own);
        }
        Ok(domain::write_cells(engine.store(), &self.job.target, cells).await?)
    }

    fn manifest(self, request: &Request, steps: Vec<Step>, domain: ObjectKey) -> Manifest {
        let computed = self.computed(request);
        Manifest {
            schema: MANIFEST_SCHEMA,
            product: self.job.target,
            number: 0,
            title: self.title,
            quantity: self.job.quantity,
            synthetic: self.inputs.iter().any(|input| input.manifest.synthetic),
            source: citation(&request.how, &self.inputs),
            grid: self.job.target_grid,
            steps,
            domain,
            series: vec![],
            derived_from: computed.inputs.first().map(|input| input.manifest.clone()),
            computed: Some(computed),
            notices: vec![],
            indexes: vec![],
        }
    }
}

/// The name of a computation: of all that values hang on. Of a quantity that is its kind, and not the range that grows with every landing.
fn computation(job: &Job) -> Result<Digest, ComputeError> {
    let quantity = match job.quantity {
        open @ Quantity::Open(_) => Quantity::open(open.word(), open.unit(), open.word())?,
        known => known,
    };
    let job = Job {
        quantity,
        ..job.clone()
    };
    Ok(Digest::of_json(&(METHOD, job)))
}

/// What a step is made of, for people, and where functions were called outside the range of their papers.
fn origin(step: &Matched, outside: &BTreeMap<String, u64>) -> String {
    let counts = outside
        .iter()
        .map(|(name, count)| format!("; {name} outside the range of its paper in {count} cells"));
    let counts: String = counts.collect();
    format!("computed from {}{counts}", step.origin)
}

fn not_asked() -> ComputeError {
    ComputeError::inconsistent("a computed product", "the engine answered for other steps")
}

fn named_unit(input: &Input) -> (String, String) {
    (
        input.name.clone(),
        input.manifest.quantity.unit().to_owned(),
    )
}

/// Steps of the newest version that are what they would be, and whose fields are there.
fn kept(
    plan: &Plan,
    latest: Option<&Manifest>,
    there: &BTreeSet<ObjectKey>,
) -> BTreeMap<usize, Step> {
    let is_of_kind = |latest: &&Manifest| latest.quantity.is_same_kind(plan.job.quantity);
    let Some(latest) = latest.filter(is_of_kind) else {
        return BTreeMap::new();
    };
    let of_now: BTreeMap<Digest, &Step> = latest
        .steps
        .iter()
        .filter(|step| there.contains(&step.field))
        .map(|step| (step.raw_sha256, step))
        .collect();
    let kept = |(index, step): (usize, &Matched)| {
        let kept = of_now.get(&matched::made_of(plan.computation, step))?;
        Some((index, (*kept).clone()))
    };
    plan.matches
        .steps
        .iter()
        .enumerate()
        .filter_map(kept)
        .collect()
}

/// Where the values come from, for people.
fn citation(how: &Computation, inputs: &[Input]) -> String {
    let of = |input: &Input| {
        format!(
            "{} = {} ({})",
            input.name,
            input.manifest.id(),
            input.manifest.source
        )
    };
    let inputs: Vec<String> = inputs.iter().map(of).collect();
    let what = match how {
        Computation::Expression { expression } => format!("Computed as {expression}"),
        Computation::Regrid {
            method,
            min_coverage,
        } => format!("Regridded ({method}, cells covered by {min_coverage} at least)"),
        Computation::Correlation { .. } => "Correlated".to_owned(),
        Computation::Statistic { statistic, .. } => format!("{statistic} of every cell"),
    };
    format!("{what}; {}", inputs.join("; "))
}

#[cfg(test)]
mod tests;
