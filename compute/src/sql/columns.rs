//! Columns of a product's table.

use std::collections::HashMap;
use std::sync::Arc;

use cube::{Description, cf};
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef, TimeUnit};

/// One of them, in the order of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Column {
    TimeStart,
    TimeEnd,
    Latitude,
    Longitude,
    Value,
    Area,
}

impl Column {
    pub(super) const ALL: [Self; 6] = [
        Self::TimeStart,
        Self::TimeEnd,
        Self::Latitude,
        Self::Longitude,
        Self::Value,
        Self::Area,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::TimeStart => "time_start",
            Self::TimeEnd => "time_end",
            Self::Latitude => "latitude",
            Self::Longitude => "longitude",
            Self::Value => "value",
            Self::Area => "area_km2",
        }
    }

    pub(super) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|column| column.name() == name)
    }

    fn field(self, description: &Description) -> Field {
        let said = |pairs: &[(&str, &str)]| {
            let pair = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
            pairs.iter().map(pair).collect::<HashMap<_, _>>()
        };
        let field = |kind| Field::new(self.name(), kind, self == Self::Value);
        match self {
            Self::TimeStart | Self::TimeEnd => {
                field(instant()).with_metadata(said(&[("standard_name", "time")]))
            }
            Self::Latitude => field(DataType::Float64).with_metadata(said(&[
                ("standard_name", "latitude"),
                ("units", "degrees_north"),
            ])),
            Self::Longitude => field(DataType::Float64).with_metadata(said(&[
                ("standard_name", "longitude"),
                ("units", "degrees_east"),
            ])),
            Self::Area => field(DataType::Float64)
                .with_metadata(said(&[("standard_name", "cell_area"), ("units", "km2")])),
            Self::Value => {
                let texts = cf::of_values(description).into_iter();
                let texts = texts
                    .filter_map(|(name, value)| value.as_str().map(|text| (name, text.to_owned())));
                field(DataType::Float32).with_metadata(texts.collect())
            }
        }
    }
}

/// The type of an instant.
pub(super) fn instant() -> DataType {
    DataType::Timestamp(TimeUnit::Millisecond, Some("UTC".into()))
}

/// The table of a version: values in the stored unit, which their field says as the CF conventions do.
pub(super) fn schema(description: &Description) -> SchemaRef {
    let fields = Column::ALL.map(|column| column.field(description));
    Arc::new(Schema::new(fields.to_vec()))
}
