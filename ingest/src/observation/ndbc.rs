//! NDBC standard meteorological data: lines of columns under a line of names, in UTC, missing values as nines.
//!
//! Names, units and sentinels: National Data Buoy Center, "Measurement Descriptions and Units". The files carry no flags,
//! so values count as not evaluated. Places come from the table of stations.

use contract::event::RejectReason;
use contract::observation::{Observation, PlatformKind, Quality};
use contract::time::TimeMs;

use super::convert::{Conversion, Given};
use super::gather::{Found, Gathered};
use super::{Source, name, station};
use crate::error::Rejection;

/// Longest line that is read, bytes.
const MAX_LINE_BYTES: usize = 4096;
/// Share of lines that may be unreadable: one in this many.
const READABLE_IN: u64 = 100;

/// A measured column: its names over the years, property, unit, stand-in for no value, m below the surface.
struct Column {
    names: &'static [&'static str],
    property: &'static str,
    unit: &'static str,
    missing: f64,
    depth_m: f64,
}

const fn column(
    names: &'static [&'static str],
    property: &'static str,
    unit: &'static str,
    missing: f64,
    depth_m: f64,
) -> Column {
    Column {
        names,
        property,
        unit,
        missing,
        depth_m,
    }
}

/// Heights and depths are those of most hulls: air at 4 m, wind at 5 m, water at 0.6 m.
const COLUMNS: [Column; 13] = [
    column(
        &["WDIR", "WD"],
        "wind_from_direction",
        "degree",
        999.0,
        -5.0,
    ),
    column(&["WSPD"], "wind_speed", "m s-1", 99.0, -5.0),
    column(&["GST"], "wind_speed_of_gust", "m s-1", 99.0, -5.0),
    column(
        &["WVHT"],
        "sea_surface_wave_significant_height",
        "m",
        99.0,
        0.0,
    ),
    column(
        &["DPD"],
        "sea_surface_wave_period_at_variance_spectral_density_maximum",
        "s",
        99.0,
        0.0,
    ),
    column(&["APD"], "sea_surface_wave_mean_period", "s", 99.0, 0.0),
    column(
        &["MWD"],
        "sea_surface_wave_from_direction",
        "degree",
        999.0,
        0.0,
    ),
    column(
        &["PRES", "BAR"],
        "air_pressure_at_mean_sea_level",
        "hPa",
        9999.0,
        0.0,
    ),
    column(&["ATMP"], "air_temperature", "degC", 999.0, -4.0),
    column(&["WTMP"], "sea_surface_temperature", "degC", 999.0, 0.6),
    column(&["DEWP"], "dew_point_temperature", "degC", 999.0, -4.0),
    column(&["VIS"], "visibility_in_air", "nmi", 99.0, 0.0),
    column(
        &["TIDE"],
        "water_surface_height_above_reference_datum",
        "ft",
        99.0,
        0.0,
    ),
];

/// Columns of the time, in any of the spellings of the years.
const CLOCK: [&[&str]; 5] = [&["YY", "YYYY"], &["MM"], &["DD"], &["HH"], &["mm"]];

/// Is this the line of names?
pub(super) fn is_header(line: &str) -> bool {
    let mut words = line.trim_start_matches('#').split_whitespace();
    let is_clock = CLOCK[..4].iter().all(|names| {
        words
            .next()
            .is_some_and(|w| names.iter().any(|n| n.eq_ignore_ascii_case(w)))
    });
    is_clock && words.any(|word| COLUMNS.iter().any(|c| c.names.contains(&word)))
}

/// Where in a line the clock and the measured columns are.
struct Layout {
    clock: [Option<usize>; 5],
    measured: Vec<(usize, &'static Column, Conversion)>,
}

impl Layout {
    fn of(header: &str) -> Result<Self, Rejection> {
        let words: Vec<&str> = header.trim_start_matches('#').split_whitespace().collect();
        // Months and minutes differ in case only.
        let exactly = |names: &[&str]| words.iter().position(|w| names.contains(w));
        let clock = [
            exactly(&["YY", "YYYY"]),
            exactly(&["MM"]),
            exactly(&["DD"]),
            exactly(&["hh", "HH"]),
            exactly(&["mm"]),
        ];
        let mut measured = vec![];
        for (at, word) in words.iter().enumerate() {
            if let Some(column) = COLUMNS.iter().find(|c| c.names.contains(word)) {
                let conversion = Conversion::new(column.property, column.unit)
                    .map_err(|e| Rejection::new(RejectReason::Unit, word, e))?;
                measured.push((at, column, conversion));
            }
        }
        Ok(Self { clock, measured })
    }

    /// When a line was measured; none if it is no line of data.
    fn time(&self, words: &[&str]) -> Option<TimeMs> {
        let number = |at: Option<usize>| words.get(at?)?.parse::<u32>().ok();
        let [year, month, day, hour, minute] = self.clock;
        let year = number(year)?;
        // Two digits were written until 1998.
        let year = if year < 100 { year + 1900 } else { year };
        let minute = minute.map_or(Some(0), |at| number(Some(at)))?;
        let midnight =
            TimeMs::from_ymd(year.try_into().ok()?, number(month)?, number(day)?).ok()?;
        let hour = number(hour)?;
        if hour > 23 || minute > 59 {
            return None;
        }
        TimeMs::new(midnight.ms() + i64::from(hour * 60 + minute) * 60_000).ok()
    }

    /// What a measured column of a line says.
    fn given(words: &[&str], (at, column, conversion): &(usize, &Column, Conversion)) -> Given {
        let number = words.get(*at).and_then(|word| word.parse::<f64>().ok());
        let number = number.filter(|n| is_measured(*n, column));
        number.map_or(Given::Missing, |n| conversion.given(n))
    }

    /// Counts the values of a line without a date.
    fn pass_over(&self, words: &[&str], gathered: &mut Gathered) {
        for measured in &self.measured {
            if Self::given(words, measured) != Given::Missing {
                gathered.unplaced();
            }
        }
    }
}

/// Reads a file.
pub(super) fn read(content: &[u8], source: Source<'_>) -> Result<Found, Rejection> {
    let station = station::ndbc(source.file_name).ok_or_else(|| {
        let detail = "the file does not say where its station is, and its name names no station that is known; \
                      name it after a known station, such as 44005h2012.txt";
        Rejection::new(RejectReason::Grid, "station", detail)
    })?;
    let mut lines = content.split(|b| *b == b'\n');
    let layout =
        Layout::of(std::str::from_utf8(lines.next().unwrap_or_default()).unwrap_or_default())?;
    let dataset = name::dataset(source, "ndbc");
    let place = station.place();
    let mut gathered = Gathered::default();
    let (mut good, mut bad) = (0u64, 0u64);
    for line in lines {
        let text = std::str::from_utf8(line).unwrap_or_default().trim();
        if line.len() > MAX_LINE_BYTES {
            bad += 1;
            gathered.unplaced();
            continue;
        }
        // The second line of newer files holds units.
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        let words: Vec<&str> = text.split_whitespace().collect();
        let Some(time) = layout.time(&words) else {
            bad += 1;
            layout.pass_over(&words, &mut gathered);
            continue;
        };
        good += 1;
        for measured in &layout.measured {
            let (_, column, conversion) = measured;
            let value = match Layout::given(&words, measured) {
                Given::Value(value) => value,
                Given::Missing => continue,
                Given::Implausible(value) => {
                    gathered.implausible(conversion, value);
                    continue;
                }
            };
            gathered.take(Observation {
                dataset: dataset.clone(),
                platform: station.id.clone(),
                kind: PlatformKind::Buoy,
                time,
                lon_deg: place.lon,
                lat_deg: place.lat,
                depth_m: column.depth_m,
                property: conversion.property.clone(),
                value,
                unit: conversion.unit.clone(),
                quality: Quality::NotEvaluated,
            })?;
        }
    }
    if bad * READABLE_IN > good + bad {
        let detail = format!(
            "{bad} of {} lines have no date or are too long; it is damaged",
            good + bad
        );
        return Err(Rejection::new(RejectReason::Corrupt, "file", detail));
    }
    gathered.finish(Rejection::new(
        RejectReason::Values,
        "file",
        "holds no value, only nines",
    ))
}

#[expect(clippy::float_cmp, reason = "a sentinel is one exact number")]
fn is_measured(number: f64, column: &Column) -> bool {
    number != column.missing
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: Source<'static> = Source {
        file_name: "44005h2012.txt",
        dataset: None,
    };
    const OLD: &str = "YY  MM DD hh mm WDIR WSPD GST  WVHT   DPD   APD MWD   PRES  ATMP  WTMP  DEWP  VIS  TIDE\n\
                       2012 01 01 00 50  99  5.5  6.3  0.89  5.56  4.60 999 1007.8   6.1   8.1 999.0 99.0 99.00\n";

    #[test]
    fn a_line_becomes_values_in_stored_units_without_its_nines() {
        let found = read(OLD.as_bytes(), SOURCE).unwrap();
        let (found, masked) = (found.observations, found.masked);
        assert!(masked.is_none(), "nines are no values: {masked}");
        let of = |property: &str| {
            found
                .iter()
                .find(|o| o.property == property)
                .map(|o| o.value)
        };
        assert!((of("sea_surface_temperature").unwrap() - 281.25).abs() < 1e-9);
        assert!((of("air_pressure_at_mean_sea_level").unwrap() - 100_780.0).abs() < 1e-6);
        assert_eq!(
            of("wind_from_direction"),
            Some(99.0),
            "99 degrees are a direction"
        );
        for missing in [
            "sea_surface_wave_from_direction",
            "dew_point_temperature",
            "visibility_in_air",
            "water_surface_height_above_reference_datum",
        ] {
            assert_eq!(of(missing), None, "{missing}");
        }
        assert_eq!(found[0].time.to_string(), "2012-01-01T00:50:00Z");
        assert_eq!(
            (found[0].platform.as_str(), found[0].dataset.as_str()),
            ("44005", "ndbc")
        );
    }

    #[test]
    fn a_newer_file_has_a_line_of_units() {
        let new = OLD.replace("YY  MM", "#YY  MM").replacen(
            '\n',
            "\n#yr  mo dy hr mn degT m/s  m/s     m   sec   sec degT   hPa  degC  degC  degC   nmi    ft\n",
            1,
        );
        assert_eq!(read(new.as_bytes(), SOURCE), read(OLD.as_bytes(), SOURCE));
    }

    #[test]
    fn what_cannot_be_true_is_counted_and_a_column_of_it_refuses_the_file() {
        let lines = |air_c: &dyn Fn(usize) -> f64| {
            let line = |hour: usize| {
                format!(
                    "2012 01 {:02} {:02} 50  99  5.5  6.3  0.89  5.56  4.60 999 1007.8 {:5.1}   8.1 999.0 99.0 99.00\n",
                    hour / 24 + 1,
                    hour % 24,
                    air_c(hour)
                )
            };
            let header = OLD.lines().next().unwrap();
            format!("{header}\n{}", (0..100).map(line).collect::<String>())
        };
        let few = lines(&|hour| if hour < 5 { 87.5 } else { 6.1 });
        let found = read(few.as_bytes(), SOURCE).unwrap();
        assert_eq!(found.masked.implausible, 5);
        let of_air = |o: &&Observation| o.property == "air_temperature";
        assert_eq!(found.observations.iter().filter(of_air).count(), 95);
        let many = lines(&|hour| if hour < 6 { 87.5 } else { 6.1 });
        let refused = read(many.as_bytes(), SOURCE).unwrap_err();
        assert_eq!(refused.object, "air_temperature");
        assert!(refused.detail.contains("6 of 100"), "{refused}");
    }

    #[test]
    fn an_unknown_station_and_a_damaged_file_are_refused_with_their_reasons() {
        let other = Source {
            file_name: "99999h2012.txt",
            ..SOURCE
        };
        assert_eq!(
            read(OLD.as_bytes(), other).unwrap_err().reason,
            RejectReason::Grid
        );
        let damaged = format!("{OLD}2012 13 01 00 50 1 1\n");
        assert_eq!(
            read(damaged.as_bytes(), SOURCE).unwrap_err().reason,
            RejectReason::Corrupt
        );
        let header = OLD.lines().next().unwrap();
        assert_eq!(
            read(header.as_bytes(), SOURCE).unwrap_err().reason,
            RejectReason::Values
        );
    }

    #[test]
    fn values_of_lines_without_a_date_are_counted() {
        let line = |date: &str| {
            format!(
                "{date} 50  99  5.5  6.3  0.89  5.56  4.60 999 1007.8   6.1   8.1 999.0 99.0 99.00\n"
            )
        };
        let header = OLD.lines().next().unwrap();
        let good: String = (0..200)
            .map(|hour| line(&format!("2012 01 {:02} {:02}", hour / 24 + 1, hour % 24)))
            .collect();
        let lost = line("2012 02 30 00");
        let found = read(format!("{header}\n{good}{lost}").as_bytes(), SOURCE).unwrap();
        // Those of its columns that hold no nines.
        assert_eq!(found.masked.implausible, 9);
        let long = format!("{header}\n{good}2012 01 20 {}\n", "0 ".repeat(4096));
        let found = read(long.as_bytes(), SOURCE).unwrap();
        assert_eq!(found.masked.implausible, 1);
    }
}
