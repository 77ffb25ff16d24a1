//! `merge_accumulated(part)`: what several tasks accumulated, in any order, as one: an aggregate function over the bytes that
//! `accumulate` gives; NULL as soon as one of them is.

use std::mem::size_of;
use std::sync::Arc;

use datafusion::arrow::array::{Array as _, ArrayRef, AsArray as _};
use datafusion::arrow::datatypes::{DataType, Field, FieldRef};
use datafusion::common::{DataFusionError, Result, ScalarValue};
use datafusion::logical_expr::function::{AccumulatorArgs, StateFieldsArgs};
use datafusion::logical_expr::{Accumulator, AggregateUDFImpl, Signature, Volatility};

use super::lists::{Argument, check_types};
use crate::reduce::accumulator::Accumulated;

const NAME: &str = "merge_accumulated";

#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct MergeAccumulated {
    signature: Signature,
}

impl MergeAccumulated {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::any(1, Volatility::Immutable),
        }
    }
}

impl AggregateUDFImpl for MergeAccumulated {
    fn name(&self) -> &'static str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, arguments: &[DataType]) -> Result<DataType> {
        check_types(NAME, arguments, &[Argument::Scalar(DataType::Binary)])?;
        Ok(DataType::Binary)
    }

    fn state_fields(&self, args: StateFieldsArgs<'_>) -> Result<Vec<FieldRef>> {
        let field = Field::new(args.name, DataType::Binary, true);
        Ok(vec![Arc::new(field)])
    }

    fn accumulator(&self, _args: AccumulatorArgs<'_>) -> Result<Box<dyn Accumulator>> {
        Ok(Box::new(Merged::default()))
    }
}

#[derive(Debug, Default)]
struct Merged {
    all: Accumulated,
    /// The only part so far, as it came: where there is no other it goes on like that.
    only: Option<Vec<u8>>,
    has_some: bool,
    /// A part is missing.
    is_in_part: bool,
    /// Bytes of what was merged last, a measure of what is held.
    size_bytes: usize,
}

impl Merged {
    fn bytes(&self) -> ScalarValue {
        let bytes = || match &self.only {
            Some(only) => only.clone(),
            None => self.all.to_bytes(),
        };
        ScalarValue::Binary((!self.is_in_part).then(bytes))
    }

    fn add(&mut self, part: &[u8]) -> Result<()> {
        let external = |e: crate::ComputeError| DataFusionError::External(e.into());
        if !self.has_some {
            (self.has_some, self.only) = (true, Some(part.to_vec()));
            return Ok(());
        }
        if let Some(first) = self.only.take() {
            self.all.merge_bytes(&first).map_err(external)?;
        }
        self.all.merge_bytes(part).map_err(external)
    }
}

impl Accumulator for Merged {
    fn update_batch(&mut self, arguments: &[ArrayRef]) -> Result<()> {
        let parts = arguments[0].as_binary::<i32>();
        self.is_in_part |= parts.null_count() > 0;
        for part in parts.iter().flatten() {
            self.add(part)?;
        }
        self.size_bytes = self.size_bytes.max(arguments[0].get_array_memory_size());
        Ok(())
    }

    fn merge_batch(&mut self, states: &[ArrayRef]) -> Result<()> {
        self.update_batch(states)
    }

    fn state(&mut self) -> Result<Vec<ScalarValue>> {
        Ok(vec![self.bytes()])
    }

    fn evaluate(&mut self) -> Result<ScalarValue> {
        Ok(self.bytes())
    }

    fn size(&self) -> usize {
        size_of::<Self>() + self.size_bytes
    }
}
