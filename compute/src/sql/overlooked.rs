//! What the engine reads in a question and overlooks, or takes wrongly: a statement in; a refusal out, since the answer would be another one.

use std::ops::ControlFlow;

use datafusion::sql::parser::Statement;
use datafusion::sql::sqlparser::ast::{
    Expr, GroupByExpr, Select, TableFactor, Visit as _, Visitor,
};

use crate::ComputeError;

/// # Errors
/// `Sql`: there is some of it.
pub(super) fn check(statement: &Statement) -> Result<(), ComputeError> {
    let found = match statement {
        Statement::Statement(own) => own.visit(&mut Overlooked),
        Statement::Explain(explained) => return check(&explained.statement),
        _ => return Ok(()),
    };
    match found {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(reason) => Err(ComputeError::Sql {
            reason: reason.to_owned(),
        }),
    }
}

/// Ends at the first that is found, with the reason.
struct Overlooked;

type Found = ControlFlow<&'static str>;

fn refused(is_there: bool, reason: &'static str) -> Found {
    if is_there {
        ControlFlow::Break(reason)
    } else {
        ControlFlow::Continue(())
    }
}

impl Visitor for Overlooked {
    type Break = &'static str;

    fn pre_visit_select(&mut self, select: &Select) -> Found {
        let (GroupByExpr::All(modifiers) | GroupByExpr::Expressions(_, modifiers)) =
            &select.group_by;
        refused(
            select.prewhere.is_some(),
            "PREWHERE is not known: write WHERE",
        )?;
        refused(
            !select.connect_by.is_empty(),
            "CONNECT BY is not known: write WITH RECURSIVE",
        )?;
        refused(
            !modifiers.is_empty(),
            "WITH ROLLUP and its like are not known: write GROUP BY ROLLUP (...), CUBE (...) or GROUPING SETS (...)",
        )
    }

    fn pre_visit_table_factor(&mut self, table: &TableFactor) -> Found {
        let TableFactor::Table {
            sample,
            partitions,
            version,
            ..
        } = table
        else {
            return ControlFlow::Continue(());
        };
        refused(
            sample.is_some(),
            "TABLESAMPLE is not known, and all rows would be read: leave it out",
        )?;
        refused(
            !partitions.is_empty(),
            "PARTITION of a table is not known: write WHERE",
        )?;
        refused(
            version.is_some(),
            "a version of a table is part of its name: \"sst@3\"",
        )
    }

    /// Where a query names its column as the one that it is compared with is named, the engine compares that with itself.
    fn pre_visit_expr(&mut self, expr: &Expr) -> Found {
        let is_of_a_query = match expr {
            Expr::AnyOp { right, .. } | Expr::AllOp { right, .. } => {
                matches!(**right, Expr::Subquery(_))
            }
            _ => false,
        };
        refused(
            is_of_a_query,
            "ANY, SOME and ALL of a query are not known: compare with (SELECT min(...)) or (SELECT max(...)), or write IN (SELECT ...)",
        )
    }
}
