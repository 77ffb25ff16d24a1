//! `accumulate(task)`: what a task accumulates over the values that it reads by itself, as bytes (`reduce::task`); NULL
//! where this process does not find them as the task says.
//!
//! The task names objects, rows and weights by their addresses: neither values nor weights are in any plan.

use std::sync::Arc;

use async_trait::async_trait;
use datafusion::arrow::array::{Array as _, AsArray as _, BinaryArray};
use datafusion::arrow::datatypes::DataType;
use datafusion::common::{DataFusionError, Result, exec_err};
use datafusion::logical_expr::async_udf::AsyncScalarUDFImpl;
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};

use super::lists::{Argument, check_types};
use crate::objects::Objects;
use crate::reduce::task::Task;

/// What queries call it.
pub(crate) const NAME: &str = "accumulate";

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct Accumulate {
    signature: Signature,
    objects: Objects,
}

impl Accumulate {
    pub(super) fn new(objects: Objects) -> Self {
        Self {
            // It is the same each time, but must not be worked out where the question is planned.
            signature: Signature::any(1, Volatility::Volatile),
            objects,
        }
    }
}

impl ScalarUDFImpl for Accumulate {
    fn name(&self) -> &'static str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        check_types(NAME, arguments, &[Argument::Scalar(DataType::Utf8)])?;
        Ok(DataType::Binary)
    }

    fn invoke_with_args(&self, _args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        exec_err!("{NAME} reads values and is called asynchronously only")
    }
}

#[async_trait]
impl AsyncScalarUDFImpl for Accumulate {
    async fn invoke_async_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let external = |e: crate::ComputeError| DataFusionError::External(e.into());
        let tasks = args.args[0].to_array(args.number_rows)?;
        let tasks = tasks.as_string::<i32>();
        let mut parts = Vec::with_capacity(tasks.len());
        for row in 0..tasks.len() {
            let task = Task::of_text(tasks.value(row)).map_err(external)?;
            let accumulated = task.run(&self.objects).await.map_err(external)?;
            parts.push(accumulated.map(|own| own.to_bytes()));
        }
        let parts = BinaryArray::from_iter(parts);
        Ok(ColumnarValue::Array(Arc::new(parts)))
    }
}
