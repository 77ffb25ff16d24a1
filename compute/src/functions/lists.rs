//! Arguments of the SQL functions: list columns checked once, then read row by row as slices.

use std::ops::Range;

use datafusion::arrow::array::{Array as _, ArrayRef, ListArray, PrimitiveArray};
use datafusion::arrow::datatypes::{ArrowPrimitiveType, DataType};
use datafusion::common::{Result, exec_err, plan_err};

/// A list column and its flat values.
pub(crate) struct Lists<'a, T: ArrowPrimitiveType> {
    lists: &'a ListArray,
    values: &'a PrimitiveArray<T>,
}

impl<'a, T: ArrowPrimitiveType> Lists<'a, T> {
    /// The lists of an argument; `function` is named in errors.
    pub(crate) fn of(function: &str, argument: &'a ArrayRef) -> Result<Self> {
        let lists = argument.as_any().downcast_ref::<ListArray>();
        let values =
            lists.and_then(|lists| lists.values().as_any().downcast_ref::<PrimitiveArray<T>>());
        match (lists, values) {
            (Some(lists), Some(values)) if lists.null_count() == 0 && values.null_count() == 0 => {
                Ok(Self { lists, values })
            }
            _ => exec_err!(
                "{function}: an argument is no list of {} without nulls",
                T::DATA_TYPE
            ),
        }
    }

    /// Values of one row.
    pub(crate) fn row(&self, row: usize) -> &'a [T::Native] {
        let offsets = self.lists.value_offsets();
        let range: Range<usize> = offsets[row] as usize..offsets[row + 1] as usize;
        &self.values.values()[range]
    }
}

/// Checks the types of arguments: `expected` holds the item type of a list or the type itself.
pub(crate) fn check_types(function: &str, found: &[DataType], expected: &[Argument]) -> Result<()> {
    let fits = |(found, expected): (&DataType, &Argument)| match (found, expected) {
        (DataType::List(item), Argument::List(expected)) => item.data_type() == expected,
        (found, Argument::Scalar(expected)) => found == expected,
        _ => false,
    };
    if found.len() == expected.len() && found.iter().zip(expected).all(fits) {
        Ok(())
    } else {
        plan_err!("{function} takes {expected:?}, not {found:?}")
    }
}

/// The type of an argument.
#[derive(Debug)]
pub(crate) enum Argument {
    /// A list of these.
    List(DataType),
    /// One of these.
    Scalar(DataType),
}
