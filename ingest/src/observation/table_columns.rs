//! What the columns of a tab-separated table are: place, time, platform, flags, and what was measured.

use super::convert::Conversion;

/// Most columns that are looked at.
const MAX_COLUMNS: usize = 1000;

/// Places of the columns of a table.
#[derive(Debug, Default)]
pub(super) struct Columns {
    pub(super) latitude: Option<usize>,
    pub(super) longitude: Option<usize>,
    pub(super) platform: Option<usize>,
    /// Depth of the sample, m.
    pub(super) depth: Option<usize>,
    /// WOCE flag of the carbon dioxide value.
    pub(super) flag: Option<usize>,
    /// Date and time in one.
    pub(super) date_time: Option<usize>,
    /// Year, month, day, hour, minute, second.
    pub(super) clock: [Option<usize>; 6],
    pub(super) measured: Vec<Measured>,
}

/// A measured column.
#[derive(Debug)]
pub(super) struct Measured {
    pub(super) at: usize,
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

impl Columns {
    /// The columns that a line names; none if it names neither place nor time.
    pub(super) fn of(line: &str) -> Option<Self> {
        let mut columns = Self::default();
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
            && (columns.date_time.is_some() || has_day);
        is_table.then_some(columns)
    }

    fn note(&mut self, at: usize, name: &str, unit: Option<&str>) {
        let places = [
            (LATITUDE, &mut self.latitude),
            (LONGITUDE, &mut self.longitude),
            (PLATFORM, &mut self.platform),
            (DEPTH, &mut self.depth),
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
        let known = MEASURED.iter().find(|(names, ..)| names.contains(&name));
        let Some((_, property, usual, height_m, is_flagged)) = known else {
            return;
        };
        let is_new = self
            .measured
            .iter()
            .all(|m| m.conversion.property != *property);
        // A column whose unit makes no sense is passed over, as one with an unknown name is.
        if let (Ok(conversion), true) = (Conversion::new(property, unit.unwrap_or(usual)), is_new) {
            self.measured.push(Measured {
                at,
                conversion,
                height_m: *height_m,
                is_flagged: *is_flagged,
            });
        }
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
            (Some(0), Some(4), Some(9))
        );
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
}
