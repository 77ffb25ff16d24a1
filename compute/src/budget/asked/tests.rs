//! What the plan of sums does with values: reads the chunks of the region, and sends nothing but sums on.

use std::num::NonZeroUsize;
use std::sync::Arc;

use contract::earth::Earth;
use contract::region::Region;
use datafusion::arrow::datatypes::DataType;
use datafusion::execution::context::SessionContext;
use datafusion::physical_plan::{ExecutionPlan, displayable};
use datafusion::prelude::SessionConfig;
use storage::{Store, fields};

use super::*;
use crate::objects::Objects;
use crate::region::weights::RegionKeys;
use crate::state;

const GRID: Grid = Grid {
    rows: 180,
    cols: 360,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};
const PARTS: usize = 4;

/// The plan of a year's sums over a region in four parts.
async fn plan(config: SessionConfig, region: &str) -> Arc<dyn ExecutionPlan> {
    let store = Store::memory();
    let product = "even".parse().unwrap();
    let mut keys = vec![];
    for month in 1..=12 {
        let period = Period::month(2000, month).unwrap();
        let values = vec![1e-9; GRID.cell_count()];
        let key = fields::write(&store, &product, &GRID, &values, period).await;
        keys.push(key.unwrap());
    }
    let region: Region = region.parse().unwrap();
    let weights = RegionKeys::stored(&store, &GRID, &region, Earth::Wgs84).await;
    let engine = Engine::local(store.clone());
    let weights = RegionAddress::stored(&store, weights.unwrap().unwrap());
    let region = WeighedRegion::read(&engine, &GRID, &weights).await.unwrap();
    let objects = Objects::of(&store);
    let runtime = state::runtime(&objects, state::MEMORY_BYTES).unwrap();
    let state = state::session_state(config, runtime, &objects).unwrap();
    let context = SessionContext::new_with_state(state);
    let keys: Vec<&ObjectKey> = keys.iter().collect();
    let registered = scan::register(&context, "fields", &store, &keys);
    registered.await.unwrap();
    let query = context.sql(&sql(Measure::Mass, &region)).await;
    query.unwrap().create_physical_plan().await.unwrap()
}

/// Both kinds of session; a cluster's scheduler plans with the second.
fn sessions() -> [SessionConfig; 2] {
    let parts = NonZeroUsize::new(PARTS).unwrap();
    [state::local_config(parts), state::ballista_config(parts)]
}

/// Operators above the scan that are handed arrays of values and hand them on.
fn carriers(plan: &Arc<dyn ExecutionPlan>) -> Vec<String> {
    let schema = plan.schema();
    let mut types = schema.fields().iter().map(|field| field.data_type());
    let holds_values = types.any(|of| matches!(of, DataType::List(_)));
    let below = plan.children().into_iter().flat_map(carriers);
    let own = (holds_values && plan.name() != "DataSourceExec").then(|| plan.name().to_owned());
    own.into_iter().chain(below).collect()
}

#[tokio::test]
async fn values_are_summed_where_they_are_read() {
    for config in sessions() {
        let plan = plan(config, "global").await;
        let text = displayable(plan.as_ref()).indent(false).to_string();
        assert!(!text.contains("Join") && !text.contains("Sort"), "{text}");
        // The function is handed them and adds its sums; the projection above it drops them.
        assert_eq!(carriers(&plan), ["async_func"], "{text}");
        for function in ["region_sums(", "band_sums("] {
            assert_eq!(text.matches(function).count(), 1, "{text}");
        }
        // Each part sums by itself before anything is sent to another.
        let lines: Vec<&str> = text.lines().map(str::trim_start).collect();
        let first = |name: &str| lines.iter().position(|line| line.starts_with(name));
        let (sent, summed) = (
            first("RepartitionExec"),
            first("AggregateExec: mode=Partial"),
        );
        assert!(sent.unwrap() < summed.unwrap(), "{text}");
        let sent_count = lines.iter().filter(|line| line.starts_with("Repartition"));
        assert_eq!(sent_count.count(), 1, "{text}");
        let scan = lines.last().unwrap();
        assert!(scan.contains(&format!("{{{PARTS} groups")), "{scan}");
    }
}

#[tokio::test]
async fn chunks_that_the_region_does_not_touch_are_not_read() {
    for config in sessions() {
        // Chunks are 60 rows by 120 columns: this box lies in the second of the northernmost three and in the one below.
        let plan = plan(config, "-10,25,10,40").await;
        let text = displayable(plan.as_ref()).indent(false).to_string();
        let scan = text.lines().last().unwrap();
        assert!(
            !text.contains("FilterExec"),
            "rows are dropped late: {text}"
        );
        for run in [
            "chunk@0 >= 1 AND chunk@0 <= 1",
            "chunk@0 >= 4 AND chunk@0 <= 4",
        ] {
            let equal = run.split_once(" >= ").unwrap().1.split_once(' ').unwrap().0;
            let found = scan.contains(run) || scan.contains(&format!("chunk@0 = {equal}"));
            assert!(found, "{run} in {scan}");
        }
        let (_, pruning) = scan.split_once("pruning_predicate=").unwrap();
        assert!(pruning.contains("chunk_max@") && pruning.contains("chunk_min@"));
    }
}
