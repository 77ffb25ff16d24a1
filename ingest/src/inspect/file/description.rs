//! What is in a data file, without its values: dimensions, variables and attributes; crosses the process border as JSON.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Most variables that are looked at.
pub(crate) const MAX_VARIABLES: usize = 4096;
/// Most attributes of the file, or of one variable, that are looked at.
pub(crate) const MAX_ATTRIBUTES: usize = 1024;
/// Most numbers of one attribute that are kept.
pub(crate) const MAX_ATTRIBUTE_NUMBERS: usize = 1024;
/// Most bytes of one text attribute that are kept.
pub(crate) const MAX_ATTRIBUTE_TEXT_BYTES: usize = 4096;
/// Longest name of a variable, dimension or attribute, bytes.
pub(crate) const MAX_NAME_BYTES: usize = 256;
/// Bytes of a text that are read: the longest name of a platform.
pub(crate) const TEXT_BYTES: u8 = 64;
/// Most dimensions of a variable (the limit of HDF5).
pub(crate) const MAX_RANK: usize = 32;

/// Groups that are told.
const TOLD_GROUPS: usize = 8;

/// What is in a data file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Description {
    /// Format for people, such as `NetCDF classic`.
    pub(crate) format: String,
    /// Attributes of the whole file.
    pub(crate) attributes: Attributes,
    /// Variables in the order of the file.
    pub(crate) variables: Vec<Variable>,
    /// Most memory that is taken to unpack values of a variable, beside the values themselves, bytes.
    pub(crate) library_bytes: u64,
    /// Groups beside its variables, as far as they are told: no variable of theirs is read.
    #[serde(default)]
    pub(crate) groups: Vec<String>,
}

/// One variable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Variable {
    /// Name.
    pub(crate) name: String,
    /// Dimensions, slowest first.
    pub(crate) dimensions: Vec<Dimension>,
    /// How values are stored.
    pub(crate) kind: Kind,
    /// Attributes.
    pub(crate) attributes: Attributes,
}

/// One dimension of a variable.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Dimension {
    /// Name; none in plain HDF5 files that name no dimensions.
    pub(crate) name: Option<String>,
    /// Length.
    pub(crate) len: u64,
}

/// How the values of a variable are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Kind {
    /// Signed integers of this many bytes.
    Integer(u8),
    /// Unsigned integers of this many bytes.
    Unsigned(u8),
    /// Floating point of this many bytes.
    Float(u8),
    /// Text; each value is read as this many numbers: its bytes and zeros behind them. One: letters.
    Text(u8),
    /// Compound or anything else that is neither number nor text.
    Other,
}

impl Kind {
    /// The type as programs call it.
    pub(crate) fn name(self) -> String {
        match self {
            Self::Integer(bytes) => format!("int{}", 8 * u16::from(bytes)),
            Self::Unsigned(bytes) => format!("uint{}", 8 * u16::from(bytes)),
            Self::Float(bytes) => format!("float{}", 8 * u16::from(bytes)),
            Self::Text(_) => "text".to_owned(),
            Self::Other => "of another type".to_owned(),
        }
    }

    /// What NetCDF fills a variable with that has no fill value of its own; of bytes every value may be meant, and floating-point
    /// numbers as large are values of nothing.
    pub(crate) fn netcdf_fill(self) -> Option<f64> {
        match self {
            Self::Integer(2) => Some(-32_767.0),
            Self::Integer(4) => Some(-2_147_483_647.0),
            Self::Integer(8) => Some(-9_223_372_036_854_775_806.0),
            Self::Unsigned(2) => Some(65_535.0),
            Self::Unsigned(4) => Some(4_294_967_295.0),
            Self::Unsigned(8) => Some(18_446_744_073_709_551_614.0),
            Self::Integer(_) | Self::Unsigned(_) | Self::Float(_) | Self::Text(_) | Self::Other => {
                None
            }
        }
    }
}

/// Attributes by name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Attributes(pub(crate) BTreeMap<String, AttributeValue>);

/// The value of an attribute.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum AttributeValue {
    /// Text.
    Text(String),
    /// One or more numbers of a type, which tells what they speak of: stored numbers or unpacked ones.
    Numbers {
        /// How the file stores them.
        kind: Kind,
        /// Each as its bit pattern, since JSON holds neither NaN nor infinity.
        bits: Vec<NumberBits>,
    },
}

/// A float64 that survives JSON whatever it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct NumberBits(u64);

impl From<f64> for NumberBits {
    fn from(number: f64) -> Self {
        Self(number.to_bits())
    }
}

impl NumberBits {
    /// The number.
    pub(crate) fn number(self) -> f64 {
        f64::from_bits(self.0)
    }
}

/// The part of one dimension to read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Part {
    /// All of it.
    All,
    /// One index.
    At(u64),
    /// So many indices from the first on.
    Some { first: u64, count: u64 },
}

impl Part {
    /// First index and number of indices of a dimension of this length; none if it has not so many.
    pub(crate) fn span(self, len: u64) -> Option<(u64, u64)> {
        let (first, count) = match self {
            Self::All => (0, len),
            Self::At(index) => (index, 1),
            Self::Some { first, count } => (first, count),
        };
        (first.checked_add(count)? <= len).then_some((first, count))
    }

    /// Does the dimension stay one in what is read?
    pub(crate) fn is_dimension(self) -> bool {
        match self {
            Self::All | Self::Some { .. } => true,
            Self::At(_) => false,
        }
    }
}

impl Attributes {
    /// A text attribute, without white space and null characters around it.
    pub(crate) fn text(&self, name: &str) -> Option<&str> {
        match self.0.get(name)? {
            AttributeValue::Text(text) => {
                Some(text.trim_matches(|c: char| c.is_whitespace() || c == '\0'))
            }
            AttributeValue::Numbers { .. } => None,
        }
    }

    /// The numbers of an attribute.
    pub(crate) fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        match self.0.get(name)? {
            AttributeValue::Numbers { bits, .. } => {
                Some(bits.iter().map(|b| f64::from_bits(b.0)).collect())
            }
            AttributeValue::Text(_) => None,
        }
    }

    /// How the numbers of an attribute are stored.
    pub(crate) fn kind(&self, name: &str) -> Option<Kind> {
        match self.0.get(name)? {
            AttributeValue::Numbers { kind, .. } => Some(*kind),
            AttributeValue::Text(_) => None,
        }
    }

    /// The first number of an attribute.
    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name)?.first().copied()
    }
}

impl FromIterator<(String, AttributeValue)> for Attributes {
    fn from_iter<I: IntoIterator<Item = (String, AttributeValue)>>(items: I) -> Self {
        Self(items.into_iter().collect())
    }
}

impl Description {
    /// Some of these groups: the first few, and one more where there are more.
    pub(crate) fn some_groups(mut groups: Vec<String>) -> Vec<String> {
        groups.truncate(TOLD_GROUPS + 1);
        groups
    }

    /// Its groups for people: `physics, quality`; none where there are none.
    pub(crate) fn told_groups(&self) -> Option<String> {
        let told = &self.groups[..self.groups.len().min(TOLD_GROUPS)];
        let more = self.groups.get(TOLD_GROUPS).map_or("", |_| ", ...");
        (!told.is_empty()).then(|| format!("{}{more}", told.join(", ")))
    }

    /// The variable of a name.
    pub(crate) fn variable(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.name == name)
    }
}

impl Variable {
    /// Number of values declared, however absurd.
    pub(crate) fn cell_count(&self) -> u128 {
        self.dimensions
            .iter()
            .fold(1, |cells: u128, d| cells.saturating_mul(u128::from(d.len)))
    }

    /// Does it hold numbers?
    pub(crate) fn is_numeric(&self) -> bool {
        matches!(
            self.kind,
            Kind::Integer(_) | Kind::Unsigned(_) | Kind::Float(_)
        )
    }

    /// How many numbers one of its values is read as.
    pub(crate) fn numbers_a_value(&self) -> u64 {
        match self.kind {
            Kind::Text(bytes) => u64::from(bytes),
            Kind::Integer(_) | Kind::Unsigned(_) | Kind::Float(_) | Kind::Other => 1,
        }
    }

    /// Is it a coordinate variable: one dimension of its own name (or, unnamed, one dimension at all)?
    pub(crate) fn is_coordinate(&self) -> bool {
        match self.dimensions.as_slice() {
            [only] => only.name.as_deref().is_none_or(|name| name == self.name),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_json_cannot_hold_cross_the_border() {
        let value = AttributeValue::Numbers {
            kind: Kind::Float(8),
            bits: vec![f64::INFINITY.into(), (-0.0).into()],
        };
        let json = serde_json::to_string(&value).unwrap();
        assert_eq!(
            serde_json::from_str::<AttributeValue>(&json).unwrap(),
            value
        );
    }

    #[test]
    fn a_product_of_absurd_dimensions_does_not_overflow() {
        let absurd = Dimension {
            name: None,
            len: u64::MAX,
        };
        let variable = Variable {
            name: "v".into(),
            dimensions: vec![absurd; 32],
            kind: Kind::Float(4),
            attributes: Attributes::default(),
        };
        assert_eq!(variable.cell_count(), u128::MAX);
    }
}
