//! How quantities are written in JSON: built-in ones as one word, open ones as an object of their words.

use std::fmt::Formatter;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Schema, SchemaType, Type};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};

use super::{Flag, OpenQuantity, OpenWords, Quantity};

impl Quantity {
    /// Its one word, as JSON and variables of cubes have it; of an open one its name.
    pub fn word(self) -> &'static str {
        match self {
            Self::CarbonFlux => "carbon_flux",
            Self::AccumulatedCarbon => "accumulated_carbon",
            Self::SeaSurfaceTemperature => "sea_surface_temperature",
            Self::SeaSurfaceSkinTemperature => "sea_surface_skin_temperature",
            Self::SeaSurfaceSubskinTemperature => "sea_surface_subskin_temperature",
            Self::SeaSurfaceFoundationTemperature => "sea_surface_foundation_temperature",
            Self::Chlorophyll => "chlorophyll",
            Self::WindSpeed => "wind_speed",
            Self::Pco2 => "pco2",
            Self::Fco2 => "fco2",
            Self::Salinity => "salinity",
            Self::AirPressure => "air_pressure",
            Self::IceFraction => "ice_fraction",
            Self::WaveHeight => "wave_height",
            Self::Precipitation => "precipitation",
            Self::Current => "current",
            Self::Elevation => "elevation",
            Self::SeaAreaFraction => "sea_area_fraction",
            Self::LandAreaFraction => "land_area_fraction",
            Self::Open(open) => &open.words().name,
        }
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Open(open) => open.words().serialize(to),
            known => to.serialize_str(known.word()),
        }
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(Words)
    }
}

struct Words;

impl<'de> Visitor<'de> for Words {
    type Value = Quantity;

    fn expecting(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(
            "a quantity: a word such as \"carbon_flux\", or name, unit and title of another one",
        )
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<Quantity, E> {
        let known = Quantity::ALL.into_iter().find(|q| q.word() == word);
        known.ok_or_else(|| {
            let words = Quantity::ALL.map(Quantity::word).join(", ");
            E::custom(format_args!(
                "unknown quantity {word:?}, known are {words}, or give name, unit and title"
            ))
        })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Quantity, A::Error> {
        let words = OpenWords::deserialize(MapAccessDeserializer::new(map))?;
        OpenQuantity::new(words)
            .map(Quantity::Open)
            .map_err(A::Error::custom)
    }
}

impl PartialSchema for Quantity {
    fn schema() -> RefOr<Schema> {
        let word = ObjectBuilder::new()
            .schema_type(SchemaType::new(Type::String))
            .enum_values(Some(Self::ALL.map(Self::word)));
        let open = Ref::from_schema_name(OpenWords::name());
        OneOfBuilder::new()
            .description(Some("What the values of a product are: one that is built in, or any other by its own words."))
            .item(word)
            .item(open)
            .into()
    }
}

impl ToSchema for Quantity {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        schemas.push((OpenWords::name().into_owned(), OpenWords::schema()));
        schemas.push((Flag::name().into_owned(), Flag::schema()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_built_in_quantity_is_one_word_and_comes_back() {
        for quantity in Quantity::ALL {
            let json = serde_json::to_string(&quantity).unwrap();
            assert_eq!(json, format!("\"{}\"", quantity.word()));
            assert_eq!(serde_json::from_str::<Quantity>(&json).unwrap(), quantity);
        }
        let refused = serde_json::from_str::<Quantity>("\"sst\"")
            .unwrap_err()
            .to_string();
        assert!(refused.contains("sea_surface_temperature"), "{refused}");
    }

    #[test]
    fn an_open_quantity_is_its_words_and_comes_back() {
        let json = r#"{"name":"river_flux","unit":"mol m-2 s-1","title":"River flux","range":[-1.0,25.0]}"#;
        let quantity: Quantity = serde_json::from_str(json).unwrap();
        assert_eq!(serde_json::to_string(&quantity).unwrap(), json);
        assert_eq!(
            (quantity.word(), quantity.unit()),
            ("river_flux", "mol m-2 s-1")
        );
        assert_eq!(quantity.display().unit, "mol m⁻² s⁻¹");
        let trend = Quantity::open("trend_of_x", "K year-1", "Trend").unwrap();
        let json = serde_json::to_string(&trend).unwrap();
        assert_eq!(serde_json::from_str::<Quantity>(&json).unwrap(), trend);
        for bad in [
            r#"{"name":"x"}"#,
            r#"{"name":"X","unit":"1","title":"x"}"#,
            "1",
        ] {
            assert!(serde_json::from_str::<Quantity>(bad).is_err(), "{bad}");
        }
    }
}
