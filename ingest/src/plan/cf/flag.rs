//! Named states of a cell: `flag_values`, `flag_masks` and `flag_meanings` (CF 3.5).

use crate::inspect::file::description::{Kind, Variable};

/// One named state.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Flag {
    pub(crate) name: String,
    /// Bits that are looked at; all of them without a mask.
    mask: u64,
    /// What those bits are; without a value any of them is enough.
    value: Option<u64>,
    /// All bits of a stored number.
    all: u64,
}

impl Flag {
    /// Is a stored number in this state?
    pub(crate) fn holds(&self, stored: f64) -> bool {
        let bits = bits(stored, self.all) & self.mask;
        self.value.map_or(bits != 0, |value| bits == value)
    }
}

/// The flags of a variable, or what is wrong with them.
pub(crate) fn of(variable: &Variable) -> Result<Vec<Flag>, String> {
    let (Kind::Integer(bytes) | Kind::Unsigned(bytes)) = variable.kind else {
        return Err("holds no integers, so it has no flags".to_owned());
    };
    let all = u64::MAX >> (64 - 8 * u32::from(bytes.clamp(1, 8)));
    let attributes = &variable.attributes;
    let numbers = |name: &str| {
        let numbers = attributes.numbers(name)?;
        Some(
            numbers
                .into_iter()
                .map(|n| bits(n, all))
                .collect::<Vec<_>>(),
        )
    };
    let (values, masks) = (numbers("flag_values"), numbers("flag_masks"));
    let names: Vec<&str> = attributes
        .text("flag_meanings")
        .unwrap_or_default()
        .split_whitespace()
        .collect();
    let count = values.as_ref().or(masks.as_ref()).map_or(0, Vec::len);
    if count == 0 || names.is_empty() {
        return Err("has no flag_meanings with flag_values or flag_masks".to_owned());
    }
    let fits = |numbers: &Option<Vec<u64>>| numbers.as_ref().is_none_or(|n| n.len() == names.len());
    if !fits(&values) || !fits(&masks) {
        return Err(format!(
            "has {} words in flag_meanings for {count} flags",
            names.len()
        ));
    }
    let at = |numbers: &Option<Vec<u64>>, place: usize| numbers.as_ref().map(|n| n[place]);
    let flag = |(place, name): (usize, &&str)| {
        let mask = at(&masks, place).unwrap_or(all);
        Flag {
            name: (*name).to_owned(),
            mask,
            value: at(&values, place),
            all,
        }
    };
    Ok(names.iter().enumerate().map(flag).collect())
}

/// A stored number as its bits: negative ones are two's complements.
fn bits(number: f64, all: u64) -> u64 {
    (number as i64).cast_unsigned() & all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::AttributeValue;

    fn variable(meanings: &str, numbers: &[(&str, &[f64])]) -> Variable {
        let kind = Kind::Integer(1);
        let number = |(name, values): &(&str, &[f64])| {
            let bits = values.iter().map(|v| (*v).into()).collect();
            ((*name).to_owned(), AttributeValue::Numbers { kind, bits })
        };
        let text = AttributeValue::Text(meanings.to_owned());
        let meanings = ("flag_meanings".to_owned(), text);
        Variable {
            name: "flags".into(),
            dimensions: vec![],
            kind,
            attributes: numbers.iter().map(number).chain([meanings]).collect(),
        }
    }

    fn set(variable: &Variable, stored: f64) -> Vec<String> {
        let flags = of(variable).unwrap();
        let holds = flags.into_iter().filter(|flag| flag.holds(stored));
        holds.map(|flag| flag.name).collect()
    }

    #[test]
    fn values_masks_and_both_are_read_as_cf_has_them() {
        let values = variable("sea land ice", &[("flag_values", &[0.0, 1.0, 2.0])]);
        assert_eq!(
            (set(&values, 0.0), set(&values, 3.0)),
            (vec!["sea".to_owned()], vec![])
        );
        // The eighth bit of a signed byte.
        let masks = variable("water land odd", &[("flag_masks", &[1.0, 2.0, -128.0])]);
        assert_eq!(set(&masks, 3.0), ["water", "land"]);
        assert_eq!(set(&masks, -128.0), ["odd"]);
        let both = variable(
            "low high ice",
            &[
                ("flag_masks", &[6.0, 6.0, 8.0]),
                ("flag_values", &[2.0, 4.0, 8.0]),
            ],
        );
        assert_eq!(set(&both, 12.0), ["high", "ice"]);
        assert_eq!(set(&both, 6.0), Vec::<String>::new());
    }

    #[test]
    fn flags_that_do_not_add_up_are_refused() {
        let wrong = variable("1=open sea, 2=land", &[("flag_values", &[1.0, 2.0])]);
        assert!(of(&wrong).unwrap_err().contains("3 words"));
        assert!(of(&variable("a b", &[])).is_err());
        let mut float = variable("a", &[("flag_values", &[1.0])]);
        float.kind = Kind::Float(4);
        assert!(of(&float).is_err());
    }
}
