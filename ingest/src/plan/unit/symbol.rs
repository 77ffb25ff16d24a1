//! The words of unit spellings: symbols and names, prefixes, and what each means in base units.

use contract::quantity::SECONDS_PER_YEAR;

use super::{Dimension, Unit};

const NONE: Dimension = Dimension {
    mass: 0,
    length: 0,
    time: 0,
    month: 0,
    temperature: 0,
    amount: 0,
};
const MASS: Dimension = Dimension { mass: 1, ..NONE };
const LENGTH: Dimension = Dimension { length: 1, ..NONE };
const VOLUME: Dimension = Dimension { length: 3, ..NONE };
const SPEED: Dimension = Dimension {
    length: 1,
    time: -1,
    ..NONE
};
const TIME: Dimension = Dimension { time: 1, ..NONE };
const MONTH: Dimension = Dimension { month: 1, ..NONE };
const TEMPERATURE: Dimension = Dimension {
    temperature: 1,
    ..NONE
};
const AMOUNT: Dimension = Dimension { amount: 1, ..NONE };
const PRESSURE: Dimension = Dimension {
    mass: 1,
    length: -1,
    time: -2,
    ..NONE
};
const POWER: Dimension = Dimension {
    mass: 1,
    length: 2,
    time: -3,
    ..NONE
};

/// Zero of the Celsius scale, K.
const CELSIUS_ZERO_K: f64 = 273.15;
/// One international knot, m s⁻¹: 1852 m an hour.
const KNOT_M_S: f64 = 1852.0 / 3600.0;

/// May a prefix stand before the word?
#[derive(PartialEq, Clone, Copy)]
enum Prefix {
    /// A symbol's (`k`, `m`, `u`).
    Symbol,
    /// A name's (`kilo`, `milli`, `micro`).
    Name,
    No,
}

type Entry = (&'static [&'static str], Dimension, f64, f64, Prefix);

/// Words, powers, factor, offset, prefixes. A year is the Julian year, as everywhere in this program (UDUNITS has the
/// tropical year, 20 parts in a million shorter). "C" alone is carbon here, never coulomb.
const ENTRIES: &[Entry] = &[
    (&["g"], MASS, 1e-3, 0.0, Prefix::Symbol),
    (
        &["gram", "grams", "gm", "gramme", "grammes"],
        MASS,
        1e-3,
        0.0,
        Prefix::Name,
    ),
    (&["t", "tonne", "tonnes"], MASS, 1e3, 0.0, Prefix::No),
    (&["m"], LENGTH, 1.0, 0.0, Prefix::Symbol),
    (
        &["meter", "meters", "metre", "metres"],
        LENGTH,
        1.0,
        0.0,
        Prefix::Name,
    ),
    (&["l", "L"], VOLUME, 1e-3, 0.0, Prefix::Symbol),
    (
        &["liter", "liters", "litre", "litres"],
        VOLUME,
        1e-3,
        0.0,
        Prefix::Name,
    ),
    (&["s"], TIME, 1.0, 0.0, Prefix::Symbol),
    (&["sec", "second", "seconds"], TIME, 1.0, 0.0, Prefix::Name),
    (&["min", "minute", "minutes"], TIME, 60.0, 0.0, Prefix::No),
    (
        &["h", "hr", "hrs", "hour", "hours"],
        TIME,
        3600.0,
        0.0,
        Prefix::No,
    ),
    (&["d", "day", "days"], TIME, 86_400.0, 0.0, Prefix::No),
    (&["mon", "month", "months"], MONTH, 1.0, 0.0, Prefix::No),
    (
        &["a", "yr", "yrs", "year", "years"],
        TIME,
        SECONDS_PER_YEAR,
        0.0,
        Prefix::No,
    ),
    (&["K"], TEMPERATURE, 1.0, 0.0, Prefix::Symbol),
    (
        &["kelvin", "kelvins", "degK", "degreeK", "degree_K", "deg_K"],
        TEMPERATURE,
        1.0,
        0.0,
        Prefix::No,
    ),
    (
        &[
            "degC",
            "degreeC",
            "degree_C",
            "degrees_C",
            "degreesC",
            "deg_C",
            "celsius",
            "degree_celsius",
            "degrees_celsius",
            "degree_centigrade",
            "°C",
            "^oC",
            "oC",
            "℃",
        ],
        TEMPERATURE,
        1.0,
        CELSIUS_ZERO_K,
        Prefix::No,
    ),
    (&["mol"], AMOUNT, 1.0, 0.0, Prefix::Symbol),
    (&["mole", "moles"], AMOUNT, 1.0, 0.0, Prefix::Name),
    (&["Pa"], PRESSURE, 1.0, 0.0, Prefix::Symbol),
    (&["pascal", "pascals"], PRESSURE, 1.0, 0.0, Prefix::Name),
    (&["W"], POWER, 1.0, 0.0, Prefix::Symbol),
    (&["watt", "watts"], POWER, 1.0, 0.0, Prefix::Name),
    (&["bar"], PRESSURE, 1e5, 0.0, Prefix::Symbol),
    (&["mb", "mbars"], PRESSURE, 100.0, 0.0, Prefix::No),
    (&["atm"], PRESSURE, 101_325.0, 0.0, Prefix::Symbol),
    (
        &["atmosphere", "atmospheres"],
        PRESSURE,
        101_325.0,
        0.0,
        Prefix::Name,
    ),
    (
        &["kn", "kt", "kts", "knot", "knots"],
        SPEED,
        KNOT_M_S,
        0.0,
        Prefix::No,
    ),
    (
        &[
            "1",
            "unitless",
            "dimensionless",
            "fraction",
            "psu",
            "practical_salinity_unit",
        ],
        NONE,
        1.0,
        0.0,
        Prefix::No,
    ),
    (&["%", "percent"], NONE, 0.01, 0.0, Prefix::No),
    (&["ppm"], NONE, 1e-6, 0.0, Prefix::No),
];

const SYMBOL_PREFIXES: [(&str, f64); 12] = [
    ("P", 1e15),
    ("T", 1e12),
    ("G", 1e9),
    ("M", 1e6),
    ("k", 1e3),
    ("h", 1e2),
    ("d", 1e-1),
    ("c", 1e-2),
    ("m", 1e-3),
    ("u", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
];

const NAME_PREFIXES: [(&str, f64); 9] = [
    ("peta", 1e15),
    ("tera", 1e12),
    ("giga", 1e9),
    ("mega", 1e6),
    ("kilo", 1e3),
    ("hecto", 1e2),
    ("centi", 1e-2),
    ("milli", 1e-3),
    ("micro", 1e-6),
];

/// The unit of one word, prefix and all; names in any case, symbols as they are.
pub(super) fn look_up(word: &str) -> Option<Unit> {
    if let Some((_, dimension, factor, offset, _)) = find(word, |_| true) {
        return Some(unit(*dimension, *factor, *offset));
    }
    let symbol = SYMBOL_PREFIXES.iter().find_map(|(prefix, scale)| {
        let rest = word.strip_prefix(prefix)?;
        // "microatm" and the like: a name's prefix before a symbol is common and unmistakable, see below.
        find(rest, |p| p == Prefix::Symbol).map(|entry| (entry, *scale))
    });
    let lower = word.to_lowercase();
    let named = || {
        NAME_PREFIXES.iter().find_map(|(prefix, scale)| {
            let rest = lower.strip_prefix(prefix)?;
            find(rest, |p| {
                p == Prefix::Name || p == Prefix::Symbol && rest.len() > 1
            })
            .map(|entry| (entry, *scale))
        })
    };
    let ((_, dimension, factor, _, _), scale) = symbol.or_else(named)?;
    Some(unit(*dimension, factor * scale, 0.0))
}

fn find(word: &str, allowed: impl Fn(Prefix) -> bool) -> Option<&'static Entry> {
    let is = |known: &str| known == word || known.len() > 2 && known.eq_ignore_ascii_case(word);
    ENTRIES
        .iter()
        .find(|(words, _, _, _, prefix)| allowed(*prefix) && words.iter().any(|known| is(known)))
}

fn unit(dimension: Dimension, factor: f64, offset: f64) -> Unit {
    Unit {
        dimension,
        factor,
        offset,
        substance: None,
    }
}
