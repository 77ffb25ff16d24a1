//! Spellings that people give practical salinity, which is a plain number: values are what they are by all of them.

/// Is it one of them? `1e-3` is the unit that the conventions' table has for it: parts of salt in a thousand, as the number was
/// meant before it became one of conductivities.
pub(crate) fn is_salinity(spelling: &str) -> bool {
    let lower = spelling.trim().to_ascii_lowercase();
    let is_named = matches!(
        lower.as_str(),
        "psu"
            | "practical_salinity_unit"
            | "practical_salinity_units"
            | "practical salinity units"
            | "pss"
            | "pss-78"
            | "pss78"
            | "g kg-1"
            | "g/kg"
            | "ppt"
            | "‰"
            | "dimensionless"
            | "unitless"
    );
    is_named || matches!(lower.parse::<f64>(), Ok(1.0 | 1e-3))
}
