//! Text in, the one statement that may be asked out; whatever would write or read elsewhere is refused with the reason.

use datafusion::sql::parser::{DFParserBuilder, Statement};
use datafusion::sql::sqlparser::ast::{
    DescribeAlias, SetExpr, ShowStatementOptions, Statement as Ansi,
};

use super::told::told;
use super::{copies, overlooked};
use crate::{ComputeError, depth};

/// Longest text of a question: nobody writes more by hand, and programs need not.
const MAX_BYTES: usize = 256 << 10;
/// What may be asked.
const MAY: &str = "SELECT, WITH, VALUES, EXPLAIN, SHOW and DESCRIBE";

/// Functions of the engine, and other names of theirs, whose value is as large as a number says, or as its arguments multiplied: one of a few hundred
/// kilobytes of text may have gigabytes, which no limit of memory sees.
pub(super) const LARGE: [&str; 24] = [
    "repeat",
    "lpad",
    "rpad",
    "array_repeat",
    "list_repeat",
    "array_resize",
    "list_resize",
    "range",
    "generate_series",
    "replace",
    "regexp_replace",
    "concat_ws",
    "array_to_string",
    "list_to_string",
    "array_join",
    "list_join",
    "array_replace",
    "list_replace",
    "array_replace_n",
    "list_replace_n",
    "array_replace_all",
    "list_replace_all",
    "array_transform",
    "list_transform",
];

/// The statement of a text.
///
/// # Errors
/// `Sql`: it is no SQL, more than one statement, deeper than a stack, or does more than ask.
pub(super) fn statement(text: &str) -> Result<Statement, ComputeError> {
    if text.len() > MAX_BYTES {
        let bytes = text.len();
        return refused(&format!(
            "{bytes} bytes are more than the {MAX_BYTES} of a question"
        ));
    }
    let checked = depth::check(text).and_then(|()| copies::check(text));
    checked.map_err(|reason| ComputeError::Sql { reason })?;
    let parsed = DFParserBuilder::new(text).build();
    let parsed = parsed.and_then(|mut parser| parser.parse_statements());
    let mut statements = parsed.map_err(|error| with_hint(told(error, None)))?;
    let statement = statements.pop_front();
    let Some(statement) = statement else {
        return refused(&format!("it is empty; give one of {MAY}"));
    };
    if !statements.is_empty() {
        return refused("it is more than one statement; ask one at a time");
    }
    check(&statement)?;
    overlooked::check(&statement)?;
    described(statement)
}

/// What SHOW COLUMNS asks as DESCRIBE, which finds a table by whichever name: the engine looks for columns of the very name, and none of ours has `_`.
///
/// # Errors
/// `Sql`: it asks for some of the columns, or more of them.
fn described(statement: Statement) -> Result<Statement, ComputeError> {
    let Statement::Statement(own) = &statement else {
        return Ok(statement);
    };
    let Ansi::ShowColumns {
        extended,
        full,
        show_options,
    } = own.as_ref()
    else {
        return Ok(statement);
    };
    let ShowStatementOptions {
        show_in,
        starts_with,
        limit,
        limit_from,
        filter_position,
    } = show_options;
    let is_of_some = starts_with.is_some() || filter_position.is_some();
    let is_cut = limit.is_some() || limit_from.is_some();
    let table = show_in.as_ref().and_then(|it| it.parent_name.clone());
    match table {
        Some(table_name) if !(*extended || *full || is_of_some || is_cut) => {
            let describe = Ansi::ExplainTable {
                describe_alias: DescribeAlias::Describe,
                hive_format: None,
                has_table_keyword: false,
                table_name,
            };
            Ok(Statement::Statement(Box::new(describe)))
        }
        _ => refused(
            "SHOW COLUMNS takes FROM and a table alone: ask DESCRIBE and the table, or choose from information_schema.columns",
        ),
    }
}

/// What most who write the name of a product for the first time need to know.
fn with_hint(error: ComputeError) -> ComputeError {
    match error {
        ComputeError::Sql { reason } if reason.contains("found: -") => ComputeError::Sql {
            reason: format!(
                "{reason}; a name with - in it is written with _, or stands in double quotes"
            ),
        },
        other => other,
    }
}

fn check(statement: &Statement) -> Result<(), ComputeError> {
    match statement {
        Statement::Statement(own) => match own.as_ref() {
            Ansi::Query(query) => match *query.body {
                SetExpr::Insert(_)
                | SetExpr::Update(_)
                | SetExpr::Delete(_)
                | SetExpr::Merge(_) => refused(&reads_only(&query.body.to_string())),
                _ => Ok(()),
            },
            Ansi::ExplainTable { .. }
            | Ansi::ShowTables { .. }
            | Ansi::ShowColumns { .. }
            | Ansi::ShowFunctions { .. }
            | Ansi::ShowVariable { .. } => Ok(()),
            Ansi::Explain { statement, .. } if matches!(**statement, Ansi::Query(_)) => Ok(()),
            other => refused(&reads_only(&other.to_string())),
        },
        Statement::Explain(explained) => check(&explained.statement),
        Statement::CopyTo(_) => refused(
            "COPY writes files: give --format and --output, which write what a question answers",
        ),
        Statement::CreateExternalTable(_) => refused(
            "CREATE EXTERNAL TABLE reads files: land them with `fluxglobe ingest`, then they are a product",
        ),
        Statement::Reset(_) => refused(&reads_only("RESET")),
    }
}

fn reads_only(text: &str) -> String {
    let word = text.split_whitespace().next().unwrap_or_default();
    format!(
        "{} is refused: SQL here reads only, by {MAY}",
        word.to_uppercase()
    )
}

fn refused<T>(reason: &str) -> Result<T, ComputeError> {
    Err(ComputeError::Sql {
        reason: reason.to_owned(),
    })
}
