//! Words of the contract as schemas: each list comes from the type that parses and writes it, so that none is a copy.

use std::borrow::Cow;

use serde_json::json;
use utoipa::openapi::schema::{KnownFormat, SchemaFormat};
use utoipa::openapi::{ObjectBuilder, RefOr, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

macro_rules! words {
    ($(#[doc = $doc:literal] $name:ident = $all:expr;)+) => {$(
        #[doc = $doc]
        pub(crate) enum $name {}

        impl PartialSchema for $name {
            fn schema() -> RefOr<Schema> {
                let words: Vec<_> = $all.iter().map(|word| json!(word)).collect();
                ObjectBuilder::new()
                    .schema_type(Type::String)
                    .description(Some($doc.trim()))
                    .enum_values(Some(words))
                    .into()
            }
        }

        impl ToSchema for $name {
            fn name() -> Cow<'static, str> {
                Cow::Borrowed(stringify!($name))
            }
        }
    )+};
}

words! {
    /// How a layer is drawn: a thematic map, particles as points, sprites or a volume with shadows, or trails of a flow.
    Mode = contract::job::Mode::ALL;
    /// A list of colours with a name.
    Palette = contract::colour::Palette::ALL;
    /// How values are spread over the colours.
    Scale = contract::colour::Scale::ALL;
    /// Colours of the ground of a globe view.
    BaseMap = contract::base_map::BaseMap::ALL;
    /// What is seen beside the globe.
    Background = contract::base_map::Background::ALL;
    /// What a legend is written as.
    LegendForm = legend::Form::ALL.map(legend::Form::as_str);
}

/// A geometry as it is sent along.
pub(crate) enum GeoJson {}

impl PartialSchema for GeoJson {
    fn schema() -> RefOr<Schema> {
        let text =
            "A geometry, a `Feature` or a `FeatureCollection` (RFC 7946): polygons, or lines.";
        ObjectBuilder::new()
            .description(Some(text))
            .property("type", ObjectBuilder::new().schema_type(Type::String))
            .required("type")
            .into()
    }
}

impl ToSchema for GeoJson {
    fn name() -> Cow<'static, str> {
        Cow::Borrowed("GeoJson")
    }
}

/// A half-open period `[start, end)`.
pub(crate) enum Period {}

impl PartialSchema for Period {
    fn schema() -> RefOr<Schema> {
        let instant = |text: &str| {
            ObjectBuilder::new()
                .schema_type(Type::String)
                .format(Some(SchemaFormat::KnownFormat(KnownFormat::DateTime)))
                .description(Some(text))
        };
        ObjectBuilder::new()
            .description(Some("A half-open period `[start, end)`."))
            .property("start", instant("First instant, ISO 8601 UTC."))
            .property("end", instant("First instant after it."))
            .required("start")
            .required("end")
            .into()
    }
}

impl ToSchema for Period {
    fn name() -> Cow<'static, str> {
        Cow::Borrowed("Period")
    }
}
