//! Rows of an answer column by column, and the forms in which they travel.
//!
//! Columns are what tables and array programs read; the texts of an answer's own JSON name every number of every row.

mod budgets;
mod columns;

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::Serialize;
use utoipa::ToSchema;

use crate::ContractError;

pub use columns::{Column, ColumnValues, Columns, Tabular};

/// A form in which an answer about time travels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum RowsForm {
    /// The answer as it is, an object with a list of rows.
    #[default]
    Json,
    /// Its rows: commas, a line of names first; nothing where there is no value.
    Csv,
    /// Its rows in Arrow's file format, and what it is to be cited with in the schema's metadata.
    Arrow,
}

impl RowsForm {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Json, Self::Csv, Self::Arrow];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Json => "json",
            Self::Csv => "csv",
            Self::Arrow => "arrow",
        }
    }

    /// Its name on the web: RFC 8259, RFC 4180, and the registration of Apache Arrow.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Json => "application/json",
            Self::Csv => "text/csv",
            Self::Arrow => "application/vnd.apache.arrow.file",
        }
    }

    /// The one that a client likes best, by its header `Accept` (RFC 9110, 12.5.1); JSON where it likes none of them, or all.
    pub fn accepted(header: &str) -> Self {
        let mut best = (0.0, Self::Json);
        // A header that has more ranges than this is nobody's wish.
        for range in header.split(',').take(MOST_RANGES) {
            let mut parts = range.split(';').map(str::trim);
            let name = parts.next().unwrap_or_default();
            let Some(form) = Self::named_by(name) else {
                continue;
            };
            let weight = parts.find_map(|part| part.strip_prefix("q="));
            let weight = weight.map_or(Some(1.0), |text| text.parse::<f64>().ok());
            let weight = weight.filter(|weight| (0.0..=1.0).contains(weight));
            let weight = weight.unwrap_or(0.0);
            // Of several that are liked alike the first one.
            if weight > best.0 {
                best = (weight, form);
            }
        }
        best.1
    }

    /// The form of a media range; JSON is what all get who take anything.
    fn named_by(range: &str) -> Option<Self> {
        let is = |form: &Self| range.eq_ignore_ascii_case(form.media_type());
        match range {
            "*/*" | "application/*" => Some(Self::Json),
            _ => Self::ALL.into_iter().find(is),
        }
    }
}

/// Media ranges of a header that are read.
const MOST_RANGES: usize = 32;

impl Display for RowsForm {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for RowsForm {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|form| form.as_str() == s);
        found.ok_or_else(|| ContractError::invalid("format", s, "use json, csv or arrow"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_are_read_as_they_are_written_and_nothing_else_is() {
        for form in RowsForm::ALL {
            assert_eq!(form.to_string().parse(), Ok(form));
            assert_eq!(RowsForm::accepted(form.media_type()), form);
            assert_eq!(serde_json::to_value(form).unwrap(), form.as_str());
        }
        let long = "arrow".repeat(10_000);
        for hostile in [
            "",
            "JSON",
            "json ",
            "../csv",
            "arrow\0",
            "parquet",
            long.as_str(),
        ] {
            let refused = hostile.parse::<RowsForm>().unwrap_err().to_string();
            assert!(refused.contains("json, csv or arrow") && refused.len() < 200);
        }
    }

    #[test]
    fn a_client_gets_what_it_likes_best() {
        for (header, form) in [
            ("", RowsForm::Json),
            ("*/*", RowsForm::Json),
            ("text/html", RowsForm::Json),
            ("text/csv", RowsForm::Csv),
            ("TEXT/CSV; charset=utf-8", RowsForm::Csv),
            ("text/csv;q=0.5, application/json", RowsForm::Json),
            ("application/json;q=0.5, text/csv;q=0.9", RowsForm::Csv),
            (
                "text/html, application/vnd.apache.arrow.file;q=0.8, */*;q=0.1",
                RowsForm::Arrow,
            ),
            ("text/csv;q=0, */*;q=0.1", RowsForm::Json),
            ("text/csv;q=2", RowsForm::Json),
            ("text/csv;q=NaN", RowsForm::Json),
            (",;,q=1;;", RowsForm::Json),
        ] {
            assert_eq!(RowsForm::accepted(header), form, "{header:?}");
        }
        let many = format!("{}text/csv", "a/b,".repeat(100_000));
        assert_eq!(RowsForm::accepted(&many), RowsForm::Json);
    }
}
