//! Who answers SQL: a session a question, with tables of its own, memory of its own and a time that it may take.

use std::num::NonZeroUsize;
use std::sync::Arc;

use datafusion::arrow::datatypes::{Schema, SchemaRef};
use datafusion::catalog::{
    CatalogProvider as _, CatalogProviderList as _, MemoryCatalogProvider,
    MemoryCatalogProviderList, SchemaProvider as _,
};
use datafusion::execution::SendableRecordBatchStream;
use datafusion::execution::context::{SQLOptions, SessionContext};
use datafusion::execution::disk_manager::{DiskManagerBuilder, DiskManagerMode};
use datafusion::execution::memory_pool::{GreedyMemoryPool, TrackConsumersPool};
use datafusion::execution::runtime_env::RuntimeEnvBuilder;
use datafusion::execution::session_state::{SessionState, SessionStateBuilder};
use datafusion::logical_expr::AggregateUDF;
use datafusion::physical_optimizer::PhysicalOptimizerRule;
use datafusion::physical_optimizer::optimizer::PhysicalOptimizer;
use datafusion::physical_plan::execute_stream;
use datafusion::prelude::SessionConfig;
use futures::future::BoxFuture;
use tokio::time::Instant;

use super::limits::SqlLimits;
use super::mean_weighted::MeanWeighted;
use super::pinned::Pinned;
use super::planning::Planning;
use super::rows::BATCH_ROWS;
use super::running::{Rows, Turn};
use super::statement::{LARGE, statement};
use super::tables::Tables;
use super::told::told;
use super::whole_sums::CheckedSum;
use super::worked_out::AnswerFunction;
use super::yielding::Yielding;
use super::{analysis, batches, budget, checked, compared, joined, statistics, substituted};
use crate::expression::udf::number_functions;
use crate::{ComputeError, Engine};

/// Catalog of the tables.
pub(crate) const CATALOG: &str = "fluxglobe";
/// Their schema.
pub(crate) const SCHEMA: &str = "public";
/// Consumers of memory that a log line names.
const TOLD_CONSUMERS: NonZeroUsize = NonZeroUsize::new(3).expect("it is not 0");

/// Answers SQL over the products of an engine. Clones share it.
#[derive(Clone)]
pub struct Sql {
    engine: Engine,
    limits: SqlLimits,
    /// Settings and functions; sessions add tables, functions that stand for tables, and memory.
    state: SessionState,
}

/// The rules of the engine for plans that run, without one: it brings filters below joins whose sides were exchanged, to the wrong side, so that of a
/// `RIGHT JOIN` rows without a partner came through a filter of that partner. Filters were brought to tables before, in plans that say what is asked.
fn sound_rules() -> Vec<Arc<dyn PhysicalOptimizerRule + Send + Sync>> {
    let all = PhysicalOptimizer::new().rules.into_iter();
    all.filter(|rule| !rule.name().starts_with("FilterPushdown"))
        .collect()
}

/// A question that was understood, and what it would answer.
struct Planned {
    schema: SchemaRef,
    stream: SendableRecordBatchStream,
}

impl Sql {
    /// # Errors
    /// A function of ours is called as one of the engine's.
    pub fn new(engine: &Engine, limits: SqlLimits) -> Result<Self, ComputeError> {
        let mut builder = SessionStateBuilder::new().with_default_features();
        if let Some(functions) = builder.scalar_functions() {
            functions.retain(|it| !LARGE.contains(&it.name()));
            functions.extend(number_functions().map(Arc::new));
        }
        if let Some(functions) = builder.higher_order_functions() {
            functions.retain(|it| !LARGE.contains(&it.name()));
        }
        if let Some(functions) = builder.aggregate_functions() {
            let sum = AggregateUDF::from(CheckedSum::default());
            functions.retain(|it| it.name() != sum.name());
            functions.extend([sum, MeanWeighted::new().into()].map(Arc::new));
        }
        let builder = builder
            .with_analyzer_rule(checked::rule())
            .with_physical_optimizer_rules(sound_rules())
            .with_physical_optimizer_rule(Arc::new(Yielding));
        Ok(Self {
            engine: engine.clone(),
            limits,
            state: builder.with_config(config()).build(),
        })
    }

    /// The engine whose products it reads.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// The answer to a question, whose rows are computed as they are taken.
    ///
    /// # Errors
    /// `Sql`: it makes no sense, or would do more than read; what [`Rows::next`] says.
    pub fn ask<'a>(&'a self, text: &'a str) -> BoxFuture<'a, Result<Rows, ComputeError>> {
        Box::pin(async move { self.ask_in_turn(text, None).await })
    }

    /// The same, holding a turn until the work on it ends.
    pub(crate) async fn ask_in_turn(&self, text: &str, turn: Turn) -> Result<Rows, ComputeError> {
        let deadline = Instant::now() + self.limits.time;
        let (own, text) = (self.clone(), text.to_owned());
        let planning = Planning::start(async move {
            let planned = own.planned(&text).await?;
            Ok((planned, turn))
        });
        let (planned, turn) = planning.until(deadline, self.limits).await?;
        Ok(Rows::start(
            planned.schema,
            planned.stream,
            deadline,
            self.limits,
            turn,
        ))
    }

    /// Columns of the answer to a question, which is not worked on, holding a turn until its plan ends.
    ///
    /// # Errors
    /// As [`Sql::ask`].
    pub(crate) async fn columns_in_turn(
        &self,
        text: &str,
        turn: Turn,
    ) -> Result<SchemaRef, ComputeError> {
        let deadline = Instant::now() + self.limits.time;
        let (own, text) = (self.clone(), text.to_owned());
        let planning = Planning::start(async move {
            let _turn = turn;
            let (context, tables) = own.context().await?;
            let frame = own.frame(&context, &tables, &text).await?;
            Ok(Arc::clone(frame.schema().inner()))
        });
        planning.until(deadline, self.limits).await
    }

    /// Every table there is, and its columns where they are wanted.
    ///
    /// # Errors
    /// A store that does not answer.
    pub(crate) async fn tables(
        &self,
        with_columns: bool,
    ) -> Result<Vec<(String, SchemaRef)>, ComputeError> {
        let tables = Tables::of(&self.engine, Pinned::new(&self.engine)).await?;
        let mut listed = vec![];
        for name in tables.table_names() {
            let columns = if with_columns {
                let found = tables.table(&name).await;
                let found = found.map_err(|error| told(error, Some(self.limits)))?;
                found.map(|table| table.schema())
            } else {
                None
            };
            listed.push((name, columns.unwrap_or_else(|| Arc::new(Schema::empty()))));
        }
        Ok(listed)
    }

    async fn planned(&self, text: &str) -> Result<Planned, ComputeError> {
        let (context, tables) = self.context().await?;
        let frame = self.frame(&context, &tables, text).await?;
        let failed = |error| told(error, Some(self.limits));
        let plan = frame.create_physical_plan().await.map_err(failed)?;
        Ok(Planned {
            schema: plan.schema(),
            stream: execute_stream(plan, context.task_ctx()).map_err(failed)?,
        })
    }

    async fn frame(
        &self,
        context: &SessionContext,
        tables: &Tables,
        text: &str,
    ) -> Result<datafusion::dataframe::DataFrame, ComputeError> {
        let statement = statement(text)?;
        let failed = |error| Self::with_advice(told(error, Some(self.limits)), tables);
        let plan = context
            .state()
            .statement_to_plan(statement)
            .await
            .map_err(failed)?;
        let reading = SQLOptions::new()
            .with_allow_ddl(false)
            .with_allow_dml(false)
            .with_allow_statements(false);
        reading
            .verify_plan(&plan)
            .map_err(|error| ComputeError::Sql {
                reason: format!("{}: SQL here reads only", error.strip_backtrace()),
            })?;
        compared::check(&plan)?;
        joined::check(&plan, text.len())?;
        substituted::check(&plan)?;
        batches::check(&plan, text.len())?;
        context.execute_logical_plan(plan).await.map_err(failed)
    }

    /// A session for one question.
    async fn context(&self) -> Result<(SessionContext, Arc<Tables>), ComputeError> {
        let pinned = Pinned::new(&self.engine);
        let tables = Arc::new(Tables::of(&self.engine, Arc::clone(&pinned)).await?);
        let failed = || ComputeError::engine("starting a session");
        let catalog = MemoryCatalogProvider::new();
        let registered = catalog.register_schema(SCHEMA, Arc::clone(&tables) as _);
        registered.map_err(failed())?;
        let catalogs = MemoryCatalogProviderList::new();
        catalogs.register_catalog(CATALOG.to_owned(), Arc::new(catalog));
        let pool = GreedyMemoryPool::new(self.limits.memory_bytes);
        // Nothing is written, intermediate rows neither.
        let disk = DiskManagerBuilder::default().with_mode(DiskManagerMode::Disabled);
        let runtime = RuntimeEnvBuilder::new()
            .with_memory_pool(Arc::new(TrackConsumersPool::new(pool, TOLD_CONSUMERS)))
            .with_disk_manager_builder(disk)
            .build_arc();
        let mut state = SessionStateBuilder::new_from_existing(self.state.clone())
            .with_catalog_list(Arc::new(catalogs))
            .with_runtime_env(runtime.map_err(failed())?)
            .build();
        for kind in [&statistics::KIND, &budget::KIND, &analysis::KIND] {
            let function = Arc::new(AnswerFunction::new(kind, &self.engine, &pinned));
            state.register_udtf(kind.name, function);
        }
        Ok((SessionContext::new_with_state(state), tables))
    }

    /// An error with what to do about it, where that is known.
    fn with_advice(error: ComputeError, tables: &Tables) -> ComputeError {
        let ComputeError::Sql { reason } = error else {
            return error;
        };
        let large = LARGE.iter().find(|name| {
            let quoted = format!("function '{name}'");
            reason.to_lowercase().contains(&quoted)
        });
        let advice = if let Some(name) = large {
            format!("{name} is left out: its values may be larger than any limit of memory sees")
        } else if reason.contains("table '") && reason.contains("not found") {
            let names: Vec<_> = tables.products().iter().map(ToString::to_string).collect();
            let names = if names.is_empty() {
                "none yet".to_owned()
            } else {
                names.join(", ")
            };
            format!(
                "products are {names}; write - as _, or the name in double quotes, and a version as \"NAME@12\""
            )
        } else {
            return ComputeError::Sql { reason };
        };
        ComputeError::Sql {
            reason: format!("{reason}; {advice}"),
        }
    }
}

/// In one part: sums of floating-point numbers depend on their order, and an answer must not depend on the machine.
fn config() -> SessionConfig {
    SessionConfig::new()
        .with_target_partitions(1)
        .with_batch_size(BATCH_ROWS)
        .with_information_schema(true)
        .with_default_catalog_and_schema(CATALOG, SCHEMA)
        .with_create_default_catalog_and_schema(false)
}
