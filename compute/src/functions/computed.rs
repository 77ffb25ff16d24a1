//! `computed_field(job, task)` and `computed_series(job, task)`: one step of a computed product, or one run of its steps,
//! computed and stored by whoever executes it. Texts of JSON in, one of what was stored out: no value passes a plan.
//!
//! What they store is named by its values, so that a task that runs twice leaves the same objects.

use std::sync::Arc;

use async_trait::async_trait;
use datafusion::arrow::array::{Array as _, AsArray as _, StringArray};
use datafusion::arrow::datatypes::DataType;
use datafusion::common::{DataFusionError, Result, ScalarValue, exec_err};
use datafusion::logical_expr::async_udf::AsyncScalarUDFImpl;
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::lists::{Argument, check_types};
use crate::computed::job::Job;
use crate::computed::make::{self, Maker};
use crate::objects::{Objects, Storing};
use crate::workshop::Workshop;

/// Of a step.
pub(crate) const FIELD: &str = "computed_field";
/// Of a run of steps.
pub(crate) const SERIES: &str = "computed_series";

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct Computed {
    name: &'static str,
    signature: Signature,
    objects: Objects,
}

/// One of each.
pub(super) fn both(objects: &Objects) -> [Computed; 2] {
    [FIELD, SERIES].map(|name| Computed {
        name,
        // It stores something: no plan may call it less often because it looks the same.
        signature: Signature::any(2, Volatility::Volatile),
        objects: objects.clone(),
    })
}

impl ScalarUDFImpl for Computed {
    fn name(&self) -> &'static str {
        self.name
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        let text = || Argument::Scalar(DataType::Utf8);
        check_types(self.name, arguments, &[text(), text()])?;
        Ok(DataType::Utf8)
    }

    fn invoke_with_args(&self, _args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        exec_err!(
            "{} stores objects and is called asynchronously only",
            self.name
        )
    }
}

#[async_trait]
impl AsyncScalarUDFImpl for Computed {
    async fn invoke_async_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let Some(ColumnarValue::Scalar(ScalarValue::Utf8(Some(job)))) = args.args.first() else {
            return exec_err!("{}: the job is not one text", self.name);
        };
        let job: Job = read(job)?;
        let tasks = args.args[1].to_array(args.number_rows)?;
        let Some(tasks) = tasks.as_string_opt::<i32>() else {
            return exec_err!("{}: tasks are no texts", self.name);
        };
        let storing = self.objects.to_store()?;
        let maker = Maker::of(&job).map_err(|e| DataFusionError::External(e.into()))?;
        let mut made = vec![];
        for row in 0..tasks.len() {
            made.push(self.one(storing, &job, &maker, tasks.value(row)).await?);
        }
        Ok(ColumnarValue::Array(Arc::new(StringArray::from(made))))
    }
}

impl Computed {
    async fn one(&self, storing: &Storing, job: &Job, maker: &Maker, task: &str) -> Result<String> {
        let external = |e: crate::ComputeError| DataFusionError::External(e.into());
        // Bands of maps are held: not more of them than there are processors.
        let turn = storing.turns.acquire().await;
        let _turn = turn.map_err(|closed| DataFusionError::External(closed.into()))?;
        let workshop = Workshop {
            spool: &storing.spool,
            ..Workshop::of(&storing.store)
        };
        if self.name == SERIES {
            let task = read(task)?;
            let made = make::run(workshop, job, &task).await;
            text(&made.map_err(external)?)
        } else {
            let task = read(task)?;
            let made = make::field(workshop, job, maker, &task).await;
            text(&made.map_err(external)?)
        }
    }
}

fn read<T: DeserializeOwned>(text: &str) -> Result<T> {
    serde_json::from_str(text).map_err(|e| DataFusionError::External(e.into()))
}

fn text<T: Serialize>(value: &T) -> Result<String> {
    serde_json::to_string(value).map_err(|e| DataFusionError::External(e.into()))
}
