//! Plans that pause: what makes many rows of few gives way to others after some batches, so that a question can be ended.
//!
//! The engine lets leaves pause. A join of two tables in memory reads none for hours, and would be told of its end by nobody.

use std::sync::Arc;

use datafusion::common::Result;
use datafusion::common::config::ConfigOptions;
use datafusion::common::tree_node::{Transformed, TransformedResult as _, TreeNode as _};
use datafusion::physical_optimizer::PhysicalOptimizerRule;
use datafusion::physical_plan::ExecutionPlan;
use datafusion::physical_plan::coop::CooperativeExec;

/// Lets joins and the like pause.
#[derive(Debug)]
pub(super) struct Yielding;

impl PhysicalOptimizerRule for Yielding {
    fn optimize(
        &self,
        plan: Arc<dyn ExecutionPlan>,
        _settings: &ConfigOptions,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let paused = |node: Arc<dyn ExecutionPlan>| {
            let makes_many = node.children().len() > 1 || node.name() == "UnnestExec";
            Ok(if makes_many {
                Transformed::yes(Arc::new(CooperativeExec::new(node)) as Arc<dyn ExecutionPlan>)
            } else {
                Transformed::no(node)
            })
        };
        plan.transform_up(paused).data()
    }

    fn name(&self) -> &'static str {
        "yielding"
    }

    fn schema_check(&self) -> bool {
        true
    }
}
