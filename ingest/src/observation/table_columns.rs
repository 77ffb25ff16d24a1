//! What the columns of a tab-separated table are: place, time, platform, flags, and what was measured.

use contract::event::RejectReason;

use super::convert::{Conversion, Given};
use crate::error::Rejection;

/// Most columns that are looked at.
const MAX_COLUMNS: usize = 1000;

/// Places of the columns of a table.
#[derive(Debug, Default)]
pub(super) struct Columns {
    pub(super) latitude: Option<Degrees>,
    pub(super) longitude: Option<Degrees>,
    pub(super) platform: Option<usize>,
    /// Depth of the sample, and metres of its unit: none where that is no length.
    pub(super) depth: Option<(usize, Option<f64>)>,
    /// WOCE flag of the carbon dioxide value.
    pub(super) flag: Option<usize>,
    /// Date and time in one.
    pub(super) date_time: Option<usize>,
    /// Year, month, day, hour, minute, second.
    pub(super) clock: [Option<usize>; 6],
    /// Is there one more that says it is of the place, and not UTC?
    is_local: bool,
    /// Do samples come from depths of all kinds?
    is_of_depths: bool,
    pub(super) measured: Vec<Measured>,
    /// Columns of what is measured that are not read, and why.
    pub(super) passed_over: Vec<Rejection>,
}

/// A column of longitudes or latitudes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Degrees {
    pub(super) at: usize,
    /// 1; -1 where its unit says that it counts westwards or southwards.
    pub(super) sign: f64,
}

/// A measured column.
#[derive(Debug)]
pub(super) struct Measured {
    pub(super) at: usize,
    name: String,
    /// Place of its name among those of its property.
    rank: usize,
    pub(super) conversion: Conversion,
    /// Where it is measured, m below the surface; none for water, which comes from the depth of the sample.
    pub(super) height_m: Option<f64>,
    /// Does the flag speak of it?
    pub(super) is_flagged: bool,
}

/// Names of columns, lower case, that hold one thing.
type Names = &'static [&'static str];

const LATITUDE: Names = &["latitude", "lat"];
const LONGITUDE: Names = &["longitude", "lon", "long"];
const PLATFORM: Names = &[
    "expocode",
    "dataset_name",
    "event",
    "cruise",
    "platform",
    "station",
];
const DEPTH: Names = &["depth water", "sample_depth", "depth", "depth, water"];
const FLAG: Names = &["flag", "fco2rec_flag", "woce_flag", "qf_fco2", "wocefco2"];
const DATE_TIME: Names = &["date/time", "datetime", "date_time", "date time"];
const CLOCK: [Names; 6] = [
    &["year", "yr", "yyyy"],
    &["month", "mon", "mo"],
    &["day", "dd"],
    &["hour", "hh", "hr"],
    &["minute", "min", "mm"],
    &["second", "sec", "ss"],
];

/// A measured column: its names, property, unit if the column says none, height below the surface, flagged.
type Known = (Names, &'static str, &'static str, Option<f64>, bool);

/// What is measured on the way. Fields that tables add from climatologies and models (`WOA_SSS`, `NCEP_SLP`,
/// `Sal interp`, `xCO2air_interp`) are no measurements and stand under names that are not here.
const MEASURED: &[Known] = &[
    (
        &["sst", "temp", "temperature"],
        "sea_surface_temperature",
        "degC",
        None,
        false,
    ),
    (
        &["sal", "salinity"],
        "sea_surface_salinity",
        "psu",
        None,
        false,
    ),
    (
        &["fco2rec", "fco2water", "fco2water_sst_wet", "fco2"],
        "fugacity_of_carbon_dioxide_in_sea_water",
        "uatm",
        None,
        true,
    ),
    (
        &["pco2water_sst_wet", "pco2water", "pco2"],
        "surface_partial_pressure_of_carbon_dioxide_in_sea_water",
        "uatm",
        None,
        true,
    ),
    (
        &["pppp", "air_pressure"],
        "air_pressure",
        "hPa",
        Some(0.0),
        false,
    ),
    (
        &["windspeed", "wind_speed"],
        "wind_speed",
        "m s-1",
        Some(-10.0),
        false,
    ),
];

/// What short names mean where samples come from depths of all kinds, as they do in files of casts: none of them says that it is of the surface.
const OF_DEPTHS: &[(Names, &str)] = &[
    (&["temp", "temperature"], "sea_water_temperature"),
    (&["sal", "salinity"], "sea_water_practical_salinity"),
];

impl Columns {
    /// The columns that a line names; none if it names neither place nor time.
    pub(super) fn of(line: &str) -> Option<Self> {
        Self::named(line, false)
    }

    /// The same of a table whose samples come from depths of all kinds.
    pub(super) fn of_depths(line: &str) -> Option<Self> {
        Self::named(line, true)
    }

    fn named(line: &str, is_of_depths: bool) -> Option<Self> {
        let mut columns = Self {
            is_of_depths,
            ..Self::default()
        };
        for (at, field) in line
            .trim_end_matches(['\r', '\n'])
            .split('\t')
            .take(MAX_COLUMNS)
            .enumerate()
        {
            let Some((name, unit)) = name_and_unit(field) else {
                continue;
            };
            columns.note(at, &name, unit);
        }
        let has_day = columns.clock[..3].iter().all(Option::is_some);
        let is_table = columns.latitude.is_some()
            && columns.longitude.is_some()
            && (columns.date_time.is_some() || has_day || columns.is_local);
        is_table.then_some(columns)
    }

    /// Are times, or parts of them, of the place alone?
    pub(super) fn lacks_utc(&self) -> bool {
        let has_hour = self.clock[..4].iter().all(Option::is_some);
        self.is_local && self.date_time.is_none() && !has_hour
    }

    fn note(&mut self, at: usize, name: &str, unit: Option<&str>) {
        let degrees = [
            (LATITUDE, &mut self.latitude, ["s", "south"]),
            (LONGITUDE, &mut self.longitude, ["w", "west"]),
        ];
        for (names, place, against) in degrees {
            if names.contains(&name) {
                let sign = sign(unit, against);
                place.get_or_insert(Degrees { at, sign });
                return;
            }
        }
        if DEPTH.contains(&name) {
            self.depth.get_or_insert_with(|| (at, metres(unit)));
            return;
        }
        let is_time = [DATE_TIME]
            .iter()
            .chain(&CLOCK)
            .any(|names| names.contains(&name));
        if is_time && unit.is_some_and(is_local) {
            self.is_local = true;
            return;
        }
        let places = [
            (PLATFORM, &mut self.platform),
            (FLAG, &mut self.flag),
            (DATE_TIME, &mut self.date_time),
        ];
        for (names, place) in places {
            if names.contains(&name) {
                place.get_or_insert(at);
                return;
            }
        }
        if let Some(part) = CLOCK.iter().position(|names| names.contains(&name)) {
            self.clock[part].get_or_insert(at);
            return;
        }
        self.note_measured(at, name, unit);
    }

    /// Notes a measured column, unless it says no more than another one or its unit makes no sense.
    fn note_measured(&mut self, at: usize, name: &str, unit: Option<&str>) {
        let known = MEASURED.iter().find_map(|known| {
            let rank = known.0.iter().position(|own| *own == name)?;
            Some((known, rank))
        });
        let Some(((_, of_surface, usual, height_m, is_flagged), rank)) = known else {
            return;
        };
        let mut of_depths = OF_DEPTHS.iter().filter(|_| self.is_of_depths);
        let of_depths = of_depths.find(|(names, _)| names.contains(&name));
        let property = of_depths.map_or(of_surface, |(_, property)| property);
        let conversion = match Conversion::new(property, unit.unwrap_or(usual)) {
            Ok(conversion) => conversion,
            Err(wrong) => {
                let rejection = Rejection::new(RejectReason::Unit, name, wrong);
                self.passed_over.push(rejection);
                return;
            }
        };
        let own = Measured {
            at,
            name: name.to_owned(),
            rank,
            conversion,
            height_m: *height_m,
            is_flagged: *is_flagged,
        };
        let mut all = self.measured.iter_mut();
        let Some(same) = all.find(|m| m.conversion.property == *property) else {
            self.measured.push(own);
            return;
        };
        // The first of their names counts: what a flag speaks of, and a compilation recommends, before what it was made of.
        let other = if own.rank < same.rank {
            std::mem::replace(same, own)
        } else {
            own
        };
        let detail = format!("is {property}, as {} is, which is read", same.name);
        let rejection = Rejection::new(RejectReason::NoVariable, other.name, detail);
        self.passed_over.push(rejection);
    }
}

/// 1, or -1 of a unit such as `degrees_west` or `dec.deg.W` that says it counts `against` the usual way and does not name both.
fn sign(unit: Option<&str>, against: [&str; 2]) -> f64 {
    let lower = unit.unwrap_or_default().to_ascii_lowercase();
    let words = lower.split(|c: char| !c.is_ascii_alphabetic());
    let words = words.map(|word| {
        ["degrees", "degree", "deg"]
            .into_iter()
            .find_map(|degree| word.strip_prefix(degree))
            .unwrap_or(word)
    });
    let (mut is_against, mut is_usual) = (false, false);
    for word in words {
        is_against |= against.contains(&word);
        is_usual |= ["e", "east", "n", "north"].contains(&word);
    }
    if is_against && !is_usual { -1.0 } else { 1.0 }
}

/// Does what stands behind the name of a time, such as `(local)`, say that it is of the place?
fn is_local(words: &str) -> bool {
    let lower = words.to_ascii_lowercase();
    let mut words = lower.split(|c: char| !c.is_ascii_alphabetic());
    words.any(|word| matches!(word, "local" | "lst" | "lt"))
}

/// Metres of a unit of depths; none if it is no length.
fn metres(unit: Option<&str>) -> Option<f64> {
    let spelling = unit.filter(|unit| !unit.is_empty()).unwrap_or("m");
    let length = Conversion::new("depth", spelling).ok()?;
    match length.given(1.0) {
        Given::Value(metres) if length.unit == "m" => Some(metres),
        _ => None,
    }
}

/// `Temp [C]` as `temp` and `C`; none for anything that goes on behind its unit, as copies of columns do.
fn name_and_unit(field: &str) -> Option<(String, Option<&str>)> {
    let field = field.trim().trim_matches('"');
    let Some(open) = field.find(['[', '(']) else {
        return Some((field.to_lowercase(), None));
    };
    let unit = field[open + 1..].strip_suffix([']', ')'])?;
    let name = field[..open].trim().to_lowercase();
    let is_closed = !unit.contains(['[', ']', '(', ')']);
    is_closed.then_some((name, Some(unit.trim())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measured_columns_are_told_from_copies_and_interpolations() {
        let line = "expocode\tDate/Time\tLatitude\tLongitude\tDepth water [m]\tTemp [C]\tSal interp\tPPPP interp [hPa]\tfCO2water_SST_wet [uatm]\tFlag [#]\twindspeed\tTemp [C]_copy\tnan_col_sal\r";
        let columns = Columns::of(line).unwrap();
        let found: Vec<_> = columns
            .measured
            .iter()
            .map(|m| (m.at, m.conversion.property.as_str()))
            .collect();
        let expected = [
            (5, "sea_surface_temperature"),
            (8, "fugacity_of_carbon_dioxide_in_sea_water"),
            (10, "wind_speed"),
        ];
        assert_eq!(found, expected);
        assert_eq!(
            (columns.platform, columns.depth, columns.flag),
            (Some(0), Some((4, Some(1.0))), Some(9))
        );
    }

    #[test]
    fn short_names_are_of_the_surface_only_where_all_samples_are() {
        let line = "yr\tmon\tday\tlat\tlon\tdepth [m]\tTemp [C]\tsal\tSST [C]\tfCO2rec [uatm]";
        let properties = |columns: Option<Columns>| {
            let columns = columns.unwrap();
            let found = columns.measured.iter();
            let found = found.map(|m| (m.at, m.conversion.property.clone()));
            (found.collect::<Vec<_>>(), columns.passed_over.len())
        };
        let named = |all: &[(usize, &str)]| {
            let all = all.iter().map(|(at, name)| (*at, (*name).to_owned()));
            all.collect::<Vec<_>>()
        };
        let fugacity = "fugacity_of_carbon_dioxide_in_sea_water";
        let surface = [
            (8, "sea_surface_temperature"),
            (7, "sea_surface_salinity"),
            (9, fugacity),
        ];
        assert_eq!(properties(Columns::of(line)), (named(&surface), 1));
        let of_casts = [
            (6, "sea_water_temperature"),
            (7, "sea_water_practical_salinity"),
            (8, "sea_surface_temperature"),
            (9, fugacity),
        ];
        assert_eq!(properties(Columns::of_depths(line)), (named(&of_casts), 0));
    }

    #[test]
    fn a_line_without_place_or_time_names_no_table() {
        for line in [
            "",
            "lat\tlon",
            "lat\tlon\tyear",
            "date/time\tlat",
            "lat lon datetime",
        ] {
            assert!(Columns::of(line).is_none(), "{line}");
        }
        assert!(Columns::of("yr\tmon\tday\tlat\tlon").is_some());
    }

    #[test]
    fn places_count_westwards_and_southwards_where_their_unit_says_so() {
        let columns = |lon: &str, lat: &str| {
            let columns = Columns::of(&format!("date/time\t{lon}\t{lat}\tSST [deg.C]")).unwrap();
            [columns.longitude, columns.latitude].map(|column| column.unwrap().sign < 0.0)
        };
        for lon in [
            "Longitude [deg.W]",
            "Longitude [dec.deg.W]",
            "Longitude [degrees_west]",
            "lon (°W)",
            "lon [degW]",
        ] {
            assert_eq!(columns(lon, "lat"), [true, false], "{lon}");
        }
        assert_eq!(columns("lon", "Latitude [deg S]"), [false, true]);
        for lon in [
            "lon",
            "Longitude [dec.deg.E]",
            "lon [degrees]",
            "lon [deg E/W]",
        ] {
            assert_eq!(columns(lon, "latitude [dec.deg.N]"), [false; 2], "{lon}");
        }
    }

    #[test]
    fn depths_are_lengths() {
        let depth = |name: &str| {
            let columns = Columns::of(&format!("date/time\tlon\tlat\t{name}\tSST")).unwrap();
            columns.depth.unwrap().1
        };
        assert_eq!(depth("sample_depth"), Some(1.0));
        assert_eq!(depth("Depth water [m]"), Some(1.0));
        assert_eq!(depth("Depth [km]"), Some(1000.0));
        assert_eq!(depth("Depth [dbar]"), None);
        assert_eq!(depth("Depth [below surface]"), None);
    }

    #[test]
    fn of_columns_of_one_property_the_first_of_their_names_counts_and_the_others_are_told() {
        let line = "yr\tmon\tday\tlat\tlon\tfCO2water_SST_wet [uatm]\tfCO2rec [uatm]\tfCO2rec_flag\tTemp [C]\tSST [furlong]";
        let columns = Columns::of(line).unwrap();
        let read: Vec<usize> = columns.measured.iter().map(|m| m.at).collect();
        assert_eq!(read, [6, 8]);
        let told: Vec<String> = columns
            .passed_over
            .iter()
            .map(ToString::to_string)
            .collect();
        assert!(
            told[0].starts_with("fco2water_sst_wet: is fugacity") && told[0].contains("as fco2rec"),
            "{told:?}"
        );
        assert!(told[1].starts_with("sst: has unit \"furlong\""), "{told:?}");
        assert_eq!(told.len(), 2);
    }
}
