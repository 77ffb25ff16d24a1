//! The ground of a globe view in words: which colours it has, and what lies behind the globe.

use serde::{Deserialize, Serialize};

use crate::ContractError;

/// Colours of sea, land, lines and air.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BaseMap {
    /// Dark sea, dark grey land.
    #[default]
    Dark,
    /// Pale sea, almost white land.
    Light,
}

/// What is seen beside the globe.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Background {
    /// Nothing: the picture is transparent there, but for the air over the globe's outline.
    #[default]
    None,
    /// A sky of one colour, that of the base map.
    Sky,
}

macro_rules! words {
    ($name:ident, $what:literal, $valid:literal, $($word:literal $value:ident,)+) => {
        impl $name {
            /// All of them, in the order they are offered.
            pub const ALL: &'static [Self] = &[$(Self::$value,)+];

            /// Name in URLs and on the command line.
            pub fn as_str(self) -> &'static str {
                match self { $(Self::$value => $word,)+ }
            }

            pub(crate) fn is_usual(&self) -> bool {
                *self == Self::default()
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.as_str())
            }
        }

        impl std::str::FromStr for $name {
            type Err = ContractError;

            fn from_str(text: &str) -> Result<Self, Self::Err> {
                let found = Self::ALL.iter().find(|one| one.as_str() == text).copied();
                found.ok_or_else(|| ContractError::invalid($what, text, $valid))
            }
        }
    };
}

words!(BaseMap, "base map", "dark or light", "dark" Dark, "light" Light,);
words!(Background, "background", "none or sky", "none" None, "sky" Sky,);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_as_they_are_written_and_others_refused() {
        for one in BaseMap::ALL {
            assert_eq!(one.to_string().parse::<BaseMap>().unwrap(), *one);
            assert_eq!(
                serde_json::to_value(one).unwrap(),
                serde_json::json!(one.as_str())
            );
        }
        for one in Background::ALL {
            assert_eq!(one.to_string().parse::<Background>().unwrap(), *one);
            assert_eq!(
                serde_json::to_value(one).unwrap(),
                serde_json::json!(one.as_str())
            );
        }
        let refused = "grey".parse::<BaseMap>().unwrap_err().to_string();
        assert!(refused.contains("dark or light"), "{refused}");
        let refused = "Sky".parse::<Background>().unwrap_err().to_string();
        assert!(refused.contains("none or sky"), "{refused}");
    }
}
