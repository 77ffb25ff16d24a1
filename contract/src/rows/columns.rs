//! Columns of answers: instants, numbers with gaps, whole numbers, flags, words.

use serde::Serialize;

use crate::series::{PointSeries, PointValue, RegionSeries, RegionValue};
use crate::statistics::{StatisticsAnswer, StatisticsRow};
use crate::time::TimeMs;

/// Rows as columns, all of one length.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// What the answer says besides its rows, as JSON: what it is to be cited with among it.
    pub about: String,
    /// From left to right; no two have one name.
    pub columns: Vec<Column>,
}

/// A column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// Unit of its numbers; none of what has none.
    pub unit: Option<String>,
    /// A value a row.
    pub values: ColumnValues,
}

/// The values of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum ColumnValues {
    /// UTC.
    Instants(Vec<TimeMs>),
    /// The same with gaps.
    SomeInstants(Vec<Option<TimeMs>>),
    /// Numbers, none where there is no data.
    Numbers(Vec<Option<f64>>),
    /// Whole numbers, none where nobody can tell.
    Counts(Vec<Option<u32>>),
    /// Is it so?
    Flags(Vec<bool>),
    /// Names, words, and numbers that are exact as decimal text.
    Texts(Vec<Option<String>>),
}

impl ColumnValues {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Instants(own) => own.len(),
            Self::SomeInstants(own) => own.len(),
            Self::Numbers(own) => own.len(),
            Self::Counts(own) => own.len(),
            Self::Flags(own) => own.len(),
            Self::Texts(own) => own.len(),
        }
    }

    /// Are there none?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// An answer whose rows are columns too.
pub trait Tabular {
    /// It as JSON. Written here, because loops of this crate are compiled to be fast: to write a point of many steps takes as long as to read
    /// its values.
    ///
    /// # Errors
    /// A number or a name that JSON cannot hold.
    fn json(&self) -> serde_json::Result<Vec<u8>>;

    /// Its rows as columns.
    fn columns(&self) -> Columns;
}

pub(super) fn column(name: &str, unit: Option<&str>, values: ColumnValues) -> Column {
    Column {
        name: name.to_owned(),
        unit: unit.map(str::to_owned),
        values,
    }
}

pub(super) fn instants<R>(name: &str, rows: &[R], of: impl Fn(&R) -> TimeMs) -> Column {
    column(
        name,
        None,
        ColumnValues::Instants(rows.iter().map(of).collect()),
    )
}

pub(super) fn numbers<R>(
    name: &str,
    unit: &str,
    rows: &[R],
    of: impl Fn(&R) -> Option<f64>,
) -> Column {
    let values = rows.iter().map(of).collect();
    column(name, Some(unit), ColumnValues::Numbers(values))
}

pub(super) fn texts<R>(name: &str, rows: &[R], of: impl Fn(&R) -> Option<String>) -> Column {
    let values = rows.iter().map(of).collect();
    column(name, None, ColumnValues::Texts(values))
}

fn counts<R>(name: &str, rows: &[R], of: impl Fn(&R) -> Option<u32>) -> Column {
    column(
        name,
        None,
        ColumnValues::Counts(rows.iter().map(of).collect()),
    )
}

/// What an answer says besides its rows, which were taken out of it.
pub(super) fn about<T: Serialize>(without_rows: &T, rows: &str) -> String {
    let mut own = serde_json::to_value(without_rows).unwrap_or_default();
    if let Some(own) = own.as_object_mut() {
        own.remove(rows);
    }
    own.to_string()
}

impl Tabular for PointSeries {
    fn json(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(self)
    }

    fn columns(&self) -> Columns {
        let Self { series, .. } = self;
        let unit = &self.cited.unit;
        let mut columns = vec![
            instants("start", series, |row: &PointValue| row.start),
            instants("end", series, |row| row.end),
            numbers("value", unit, series, |row| row.value),
        ];
        if series.iter().any(|row| row.contributed.is_some()) {
            columns.extend([
                counts("contributed_steps", series, |row| {
                    Some(row.contributed?.steps)
                }),
                counts("contributed_of_steps", series, |row| {
                    Some(row.contributed?.of_steps)
                }),
                numbers("contributed_time_percent", "%", series, |row| {
                    Some(row.contributed?.time_percent)
                }),
            ]);
        }
        let without_rows = Self {
            cited: self.cited.clone(),
            series: vec![],
            ..*self
        };
        Columns {
            about: about(&without_rows, "series"),
            columns,
        }
    }
}

impl Tabular for RegionSeries {
    fn json(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(self)
    }

    fn columns(&self) -> Columns {
        let Self { series, .. } = self;
        let columns = vec![
            instants("start", series, |row: &RegionValue| row.start),
            instants("end", series, |row| row.end),
            numbers("mean", &self.cited.unit, series, |row| row.mean),
            numbers("area_m2", "m2", series, |row| Some(row.area_m2)),
            numbers("coverage_percent", "%", series, |row| {
                Some(row.coverage_percent)
            }),
        ];
        let without_rows = Self {
            cited: self.cited.clone(),
            region: self.region.clone(),
            ocean_source: self.ocean_source.clone(),
            notes: self.notes.clone(),
            series: vec![],
            ..*self
        };
        Columns {
            about: about(&without_rows, "series"),
            columns,
        }
    }
}

impl Tabular for StatisticsAnswer {
    fn json(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(self)
    }

    fn columns(&self) -> Columns {
        let rows = &self.rows;
        let mut columns = vec![
            instants("start", rows, |row: &StatisticsRow| row.start),
            instants("end", rows, |row| row.end),
        ];
        for note in &self.statistics {
            let value = |row: &StatisticsRow| row.values.get(&note.name).copied().flatten();
            columns.push(numbers(&note.name, &note.unit, rows, value));
            // Extremes say when they were found.
            if ["min", "max"].contains(&note.name.as_str()) {
                let found = rows.iter().map(|row| row.found_at.get(&note.name).copied());
                let values = ColumnValues::SomeInstants(found.collect());
                columns.push(column(&format!("{}_found_at", note.name), None, values));
            }
        }
        columns.extend([
            numbers("coverage_percent", "%", rows, |row| {
                Some(row.coverage_percent)
            }),
            counts("step_count", rows, |row| Some(row.step_count)),
            column(
                "is_withheld",
                None,
                ColumnValues::Flags(rows.iter().map(|row| row.is_withheld).collect()),
            ),
        ]);
        let without_rows = Self {
            cited: self.cited.clone(),
            kind: self.kind.clone(),
            geometry: self.geometry.clone(),
            statistics: self.statistics.clone(),
            coverage_basis: self.coverage_basis.clone(),
            size_unit: self.size_unit.clone(),
            ocean_source: self.ocean_source.clone(),
            notes: self.notes.clone(),
            rows: vec![],
            ..*self
        };
        Columns {
            about: about(&without_rows, "rows"),
            columns,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::cited::Cited;
    use crate::digest::Digest;
    use crate::earth::Earth;
    use crate::quantity::Quantity;
    use crate::series::{Cell, CellCounts};
    use crate::statistics::StatisticNote;
    use crate::time::TimeStep;

    fn day(day: i64) -> TimeMs {
        TimeMs::new(day * 86_400_000).unwrap()
    }

    fn cited() -> Cited {
        Cited {
            product: "flux".parse().unwrap(),
            manifest: format!("flux@1-{}", &Digest::of(b"").to_string()[..8])
                .parse()
                .unwrap(),
            title: "A \"flux\"".to_owned(),
            source: "a test".to_owned(),
            synthetic: true,
            quantity: Quantity::CarbonFlux,
            unit: "g C m-2 a-1".to_owned(),
        }
    }

    fn names(columns: &Columns) -> Vec<&str> {
        columns
            .columns
            .iter()
            .map(|own| own.name.as_str())
            .collect()
    }

    #[test]
    fn a_point_has_its_counts_where_there_are_any() {
        let row = |at: i64| PointValue {
            start: day(at),
            end: day(at + 1),
            mid: day(at),
            value: (at != 1).then_some(at as f64),
            contributed: None,
        };
        let mut own = PointSeries {
            cited: cited(),
            lon_deg: 1.5,
            lat_deg: 2.5,
            cell: Cell {
                row: 3,
                col: 4,
                lon_deg: 1.0,
                lat_deg: 2.0,
            },
            series: (0..3).map(row).collect(),
        };
        let columns = own.columns();
        assert_eq!(names(&columns), ["start", "end", "value"]);
        let value = &columns.columns[2];
        assert_eq!(
            value.values,
            ColumnValues::Numbers(vec![Some(0.0), None, Some(2.0)])
        );
        assert_eq!(value.unit.as_deref(), Some("g C m-2 a-1"));
        assert_eq!(
            columns.columns[1].values,
            ColumnValues::Instants(vec![day(1), day(2), day(3)])
        );
        let about: serde_json::Value = serde_json::from_str(&columns.about).unwrap();
        assert_eq!(
            (&about["title"], &about["cell"]["row"]),
            (&"A \"flux\"".into(), &3.into())
        );
        assert!(about.get("series").is_none());
        own.series[1].contributed = Some(CellCounts {
            steps: 1,
            of_steps: 2,
            time_percent: 50.0,
        });
        let columns = own.columns();
        assert_eq!(
            names(&columns)[3..],
            [
                "contributed_steps",
                "contributed_of_steps",
                "contributed_time_percent"
            ]
        );
        assert_eq!(
            columns.columns[4].values,
            ColumnValues::Counts(vec![None, Some(2), None])
        );
        assert!(
            columns
                .columns
                .iter()
                .all(|own| own.values.len() == 3 && !own.values.is_empty())
        );
    }

    #[test]
    fn statistics_have_a_column_each_and_extremes_the_instant_besides() {
        let note = |name: &str| StatisticNote {
            name: name.to_owned(),
            unit: "K".to_owned(),
            what: String::new(),
        };
        let row = |at: i64, value: Option<f64>| StatisticsRow {
            start: day(at),
            end: day(at + 1),
            mid: day(at),
            values: BTreeMap::from([("max".to_owned(), value), ("mean".to_owned(), Some(1.0))]),
            found_at: value
                .map(|_| ("max".to_owned(), day(9)))
                .into_iter()
                .collect(),
            coverage_percent: 12.5,
            step_count: 1,
            is_withheld: value.is_none(),
        };
        let own = StatisticsAnswer {
            cited: cited(),
            kind: "area".to_owned(),
            geometry: "global".to_owned(),
            step: TimeStep::Native,
            earth: Earth::Wgs84,
            cells: crate::region::Cells::Whole,
            statistics: vec![note("mean"), note("max")],
            coverage_basis: String::new(),
            size: 1.0,
            size_unit: "m²".to_owned(),
            min_coverage_percent: 0.0,
            ocean_source: None,
            notes: vec![],
            rows: vec![row(0, Some(4.0)), row(1, None)],
        };
        let columns = own.columns();
        let expected = [
            "start",
            "end",
            "mean",
            "max",
            "max_found_at",
            "coverage_percent",
            "step_count",
            "is_withheld",
        ];
        assert_eq!(names(&columns), expected);
        let values = |at: usize| columns.columns[at].values.clone();
        assert_eq!(values(3), ColumnValues::Numbers(vec![Some(4.0), None]));
        assert_eq!(
            values(4),
            ColumnValues::SomeInstants(vec![Some(day(9)), None])
        );
        assert_eq!(values(7), ColumnValues::Flags(vec![false, true]));
        let about: serde_json::Value = serde_json::from_str(&columns.about).unwrap();
        assert_eq!((&about["kind"], about.get("rows")), (&"area".into(), None));
    }
}
