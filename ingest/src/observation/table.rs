//! Tab-separated tables of underway and station measurements, as SOCAT and PANGAEA give them: rows in, observations out.
//!
//! Comments before the line of column names are passed over. Flags are WOCE's and speak of the carbon dioxide value
//! only; all else counts as not evaluated. A platform whose rows all lie at one place is a station, any other a ship.

use std::collections::BTreeMap;

use contract::event::RejectReason;
use contract::observation::{Observation, PlatformKind, Quality};
use contract::product::ProductId;
use csv::{ByteRecord, Reader, ReaderBuilder};

use super::convert::Given;
use super::gather::{Found, Gathered};
use super::property::SURFACE_M;
use super::quality::Scheme;
use super::table_columns::{Columns, Degrees, Measured};
use super::{Source, name, table_time};
use crate::error::Rejection;

/// Lines that may come before the column names.
const MAX_COMMENT_LINES: usize = 10_000;
/// A table of which more than one row in this many has no place or time is damaged.
const READABLE_IN: u64 = 10;
/// Depths and flags at and below stand for none (-999, -9999); so do those at and above the other.
const MISSING_BELOW: f64 = -900.0;
const MISSING_ABOVE: f64 = 1e30;
/// A platform that moves less than this is a station, degrees.
const STATION_DEG: f64 = 0.01;

/// Does the head of a file hold a line of column names?
pub(super) fn has_columns(head: &[u8]) -> bool {
    columns(head, Columns::of).is_some()
}

/// Grid cells by latitude and longitude under plain numbers: `"","Grid_lat","Grid_long","1","2"`.
pub(super) fn is_undated_grid(line: &str) -> bool {
    let fields: Vec<String> = line
        .split(',')
        .map(|field| field.trim().trim_matches('"').to_lowercase())
        .collect();
    let has = |word: &str| fields.iter().any(|field| field.contains(word));
    let numbers = fields
        .iter()
        .filter(|field| field.parse::<u32>().is_ok())
        .count();
    has("lat") && has("lon") && numbers >= 2 && numbers + 3 >= fields.len()
}

/// Why such a table is refused.
pub(super) fn undated() -> Rejection {
    let detail = "has columns 1, 2, 3 ... of grid cells: nothing in the file says when, what or in which unit; \
                  give it as NetCDF with time and units";
    Rejection::new(RejectReason::Time, "columns", detail)
}

/// The columns that a line names as `of` reads it, and where that line ends.
fn columns(content: &[u8], of: fn(&str) -> Option<Columns>) -> Option<(Columns, usize)> {
    let mut start = 0;
    for line in content
        .split_inclusive(|b| *b == b'\n')
        .take(MAX_COMMENT_LINES)
    {
        start += line.len();
        let found = std::str::from_utf8(line).ok().and_then(of);
        if let Some(columns) = found {
            return Some((columns, start));
        }
    }
    None
}

/// Reads a table.
pub(super) fn read(content: &[u8], source: Source<'_>) -> Result<Found, Rejection> {
    let none = || {
        Rejection::new(
            RejectReason::NoVariable,
            "columns",
            "has no column of place and time",
        )
    };
    let (of_surface, start) = columns(content, Columns::of).ok_or_else(none)?;
    let is_of_depths = reaches_down(&of_surface, &content[start..]);
    let columns = if is_of_depths {
        let (of_depths, _) = columns(content, Columns::of_depths).ok_or_else(none)?;
        of_depths
    } else {
        of_surface
    };
    let content = &content[start..];
    check(&columns)?;
    let is_socat = columns.measured.iter().any(|m| m.is_flagged);
    let stem = name::stem(source.file_name);
    let mut reading = TableReader {
        dataset: name::dataset(source, if is_socat { "socat" } else { stem }),
        lone_platform: name::platform(stem).unwrap_or_else(|| "1".to_owned()),
        is_of_depths,
        gathered: Gathered::default(),
        spans: BTreeMap::new(),
    };
    let mut rows = rows_of(content);
    let (mut good, mut bad) = (0u64, 0u64);
    let mut record = ByteRecord::new();
    let broken = |e: csv::Error| Rejection::new(RejectReason::Corrupt, "file", e.to_string());
    while rows.read_byte_record(&mut record).map_err(broken)? {
        if let Some(row) = Row::of(&columns, &record) {
            good += 1;
            reading.take(&columns, &row)?;
        } else {
            bad += 1;
            reading.pass_over(&columns, &record);
        }
    }
    if bad * READABLE_IN > good + bad {
        let all = good + bad;
        let detail = format!("{bad} of {all} rows have no place or time; it is damaged");
        return Err(Rejection::new(RejectReason::Corrupt, "file", detail));
    }
    for rejection in columns.passed_over {
        reading.gathered.pass_over(rejection);
    }
    reading.finish()
}

/// # Errors
/// Nothing is measured in these columns, times are of the place, or depths are no lengths.
fn check(columns: &Columns) -> Result<(), Rejection> {
    if let Some(rejection) = columns.passed_over.first()
        && columns.measured.is_empty()
    {
        return Err(rejection.clone());
    }
    if columns.measured.is_empty() {
        let detail = "has no measured column that is known, such as SST, sal or fCO2rec";
        return Err(Rejection::new(RejectReason::NoVariable, "columns", detail));
    }
    if columns.lacks_utc() {
        let detail = "is of the place, and nothing says how far that is from UTC; give it in UTC, or with its offset";
        return Err(Rejection::new(RejectReason::Time, "time", detail));
    }
    if let Some((_, None)) = columns.depth {
        let detail = "has a unit that is no length; give depths in m";
        return Err(Rejection::new(RejectReason::Unit, "depth", detail));
    }
    Ok(())
}

/// The rows below the names of columns.
fn rows_of(content: &[u8]) -> Reader<&[u8]> {
    ReaderBuilder::new()
        .delimiter(b'\t')
        .quoting(false)
        .flexible(true)
        .has_headers(false)
        .from_reader(content)
}

/// Is one of the depths beyond what ships and buoys call the surface, so that nobody knows how deep a sample is whose depth is missing?
fn reaches_down(columns: &Columns, content: &[u8]) -> bool {
    let Some((at, Some(metres))) = columns.depth else {
        return false;
    };
    let (mut rows, mut record) = (rows_of(content), ByteRecord::new());
    while matches!(rows.read_byte_record(&mut record), Ok(true)) {
        if remark(&record, at).is_some_and(|depth| depth * metres > SURFACE_M) {
            return true;
        }
    }
    false
}

/// What was read of a table so far.
struct TableReader {
    dataset: ProductId,
    /// Name of the platform where no column says it.
    lone_platform: String,
    /// Are samples at depths of all kinds?
    is_of_depths: bool,
    gathered: Gathered,
    spans: BTreeMap<String, Span>,
}

impl TableReader {
    fn take(&mut self, columns: &Columns, row: &Row<'_>) -> Result<(), Rejection> {
        let platform = row.text(columns.platform).and_then(name::platform);
        let platform = platform.unwrap_or_else(|| self.lone_platform.clone());
        let span = self.spans.entry(platform.clone()).or_default();
        span.widen(row.place);
        for measured in &columns.measured {
            if let Some(text) = unread(row.record, measured.at) {
                self.gathered.unread(&measured.conversion, text);
            }
        }
        let sample_m = row.depth_m(columns).or((!self.is_of_depths).then_some(0.0));
        for (measured, value, quality) in row.values(columns) {
            let conversion = &measured.conversion;
            let value = match value {
                Given::Value(value) => value,
                Given::Missing => continue,
                Given::Implausible(value) => {
                    self.gathered.implausible(conversion, value);
                    continue;
                }
            };
            let Some(depth_m) = measured.height_m.or(sample_m) else {
                self.gathered.unplaced();
                continue;
            };
            self.gathered.take(Observation {
                dataset: self.dataset.clone(),
                platform: platform.clone(),
                kind: PlatformKind::Ship,
                time: row.time,
                lon_deg: row.place[0],
                lat_deg: row.place[1],
                depth_m,
                property: conversion.property.clone(),
                value,
                unit: conversion.unit.clone(),
                quality,
            })?;
        }
        Ok(())
    }

    /// Counts the values of a row without a place or a time.
    fn pass_over(&mut self, columns: &Columns, record: &ByteRecord) {
        for measured in &columns.measured {
            let number = number(record, measured.at);
            let given = number.map(|number| measured.conversion.given(number));
            let is_value = matches!(given, Some(Given::Value(_) | Given::Implausible(_)));
            if is_value || unread(record, measured.at).is_some() {
                self.gathered.unplaced();
            }
        }
    }

    /// The observations, now that it is known who moved.
    fn finish(self) -> Result<Found, Rejection> {
        let none = Rejection::new(RejectReason::Values, "file", "holds no measured value");
        let mut found = self.gathered.finish(none)?;
        for observation in &mut found.observations {
            let span = self.spans.get(&observation.platform);
            if span.is_some_and(Span::is_one_place) {
                observation.kind = PlatformKind::Station;
            }
        }
        Ok(found)
    }
}

/// Where a platform was.
#[derive(Default)]
struct Span {
    /// West, south, east, north; none before the first row.
    bounds: Option<[f64; 4]>,
    rows: u64,
}

impl Span {
    fn widen(&mut self, [lon, lat]: [f64; 2]) {
        let [w, s, e, n] = self.bounds.unwrap_or([lon, lat, lon, lat]);
        self.bounds = Some([w.min(lon), s.min(lat), e.max(lon), n.max(lat)]);
        self.rows += 1;
    }

    fn is_one_place(&self) -> bool {
        let within = |[w, s, e, n]: [f64; 4]| e - w < STATION_DEG && n - s < STATION_DEG;
        self.rows > 1 && self.bounds.is_some_and(within)
    }
}

/// The number in a field of a row.
fn number(record: &ByteRecord, at: usize) -> Option<f64> {
    let text = std::str::from_utf8(record.get(at)?).ok()?;
    text.trim().parse().ok()
}

/// The text of a field that holds digits and no number, such as `12,5` or `<0.1`; words stand for no value.
fn unread(record: &ByteRecord, at: usize) -> Option<&str> {
    let text = std::str::from_utf8(record.get(at)?).ok()?.trim();
    let is_unread = text.bytes().any(|b| b.is_ascii_digit()) && text.parse::<f64>().is_err();
    is_unread.then_some(text)
}

/// A depth or a flag.
fn remark(record: &ByteRecord, at: usize) -> Option<f64> {
    let is_one = |number: &f64| *number > MISSING_BELOW && *number < MISSING_ABOVE;
    number(record, at).filter(is_one)
}

/// A row with a place and a time.
struct Row<'a> {
    record: &'a ByteRecord,
    time: contract::time::TimeMs,
    place: [f64; 2],
}

impl<'a> Row<'a> {
    fn of(columns: &Columns, record: &'a ByteRecord) -> Option<Self> {
        let field = |at: usize| std::str::from_utf8(record.get(at)?).ok().map(str::trim);
        let number = |column: Degrees| field(column.at)?.parse::<f64>().ok();
        let (longitude, latitude) = (columns.longitude?, columns.latitude?);
        let (lon, lat) = (number(longitude)?, number(latitude)?);
        let time = table_time::of_row(columns, field)?;
        let is_place = (-180.0..=360.0).contains(&lon) && (-90.0..=90.0).contains(&lat);
        let is_at_depth = columns
            .depth
            .is_none_or(|(at, _)| unread(record, at).is_none());
        (is_place && is_at_depth).then_some(Self {
            record,
            time,
            place: [longitude.sign * lon, latitude.sign * lat],
        })
    }

    fn text(&self, at: Option<usize>) -> Option<&str> {
        std::str::from_utf8(self.record.get(at?)?).ok()
    }

    /// Depth of the sample, 0 where no column says any; none where that is missing.
    fn depth_m(&self, columns: &Columns) -> Option<f64> {
        match columns.depth {
            Some((at, metres)) => Some(remark(self.record, at)? * metres?),
            None => Some(0.0),
        }
    }

    /// What was measured, what its number is, and its quality; not what its flag calls missing.
    fn values<'b>(
        &self,
        columns: &'b Columns,
    ) -> impl Iterator<Item = (&'b Measured, Given, Quality)> {
        let record = self.record;
        let flag = columns.flag.and_then(|at| remark(record, at));
        columns.measured.iter().filter_map(move |measured| {
            let value = measured.conversion.given(number(record, measured.at)?);
            let quality = match flag {
                Some(flag) if measured.is_flagged => Scheme::Woce.verdict(flag)?,
                _ => Quality::NotEvaluated,
            };
            Some((measured, value, quality))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: Source<'static> = Source {
        file_name: "cruise.tsv",
        dataset: None,
    };
    const TABLE: &str = "/* comment */\nExpocode\tyr\tmon\tday\thh\tmm\tss\tlongitude [dec.deg.E]\tlatitude [dec.deg.N]\tsample_depth [m]\tsal\tSST [deg.C]\tWOA_SSS\tfCO2rec [uatm]\tfCO2rec_flag\n\
        33HQ\t2015\t7\t14\t7\t14\t40\t181.5\t70.9\t5\t31.5\t-1.0\t30\t271.4\t2\n\
        33HQ\t2015\t7\t14\t7\t44\t40\t181.7\t70.8\t5\tNaN\t-999\t30\t300.0\t4\n";

    #[test]
    fn rows_become_observations_with_their_flags() {
        let found = read(TABLE.as_bytes(), SOURCE).unwrap();
        let (found, masked) = (found.observations, found.masked);
        assert!(masked.is_none(), "{masked}");
        let of = |property: &str| -> Vec<_> {
            let those = found.iter().filter(|o| o.property == property);
            those.map(|o| (o.value, o.quality)).collect()
        };
        assert_eq!(of("sea_surface_salinity"), [(31.5, Quality::NotEvaluated)]);
        assert_eq!(of("sea_surface_temperature").len(), 1);
        let qualities: Vec<_> = of("fugacity_of_carbon_dioxide_in_sea_water")
            .iter()
            .map(|v| v.1)
            .collect();
        assert_eq!(qualities, [Quality::Good, Quality::Bad]);
        let first = &found[0];
        assert!((first.lon_deg + 178.5).abs() < 1e-9, "past the date line");
        assert_eq!(
            (first.dataset.as_str(), first.platform.as_str()),
            ("socat", "33HQ")
        );
        assert_eq!((first.kind, first.depth_m), (PlatformKind::Ship, 5.0));
    }

    #[test]
    fn what_stays_at_one_place_is_a_station() {
        let fixed = TABLE.replace("181.7\t70.8", "181.5\t70.9");
        let found = read(fixed.as_bytes(), SOURCE).unwrap().observations;
        assert!(found.iter().all(|o| o.kind == PlatformKind::Station));
    }

    #[test]
    fn values_that_cannot_be_true_are_counted() {
        let row = "33HQ\t2015\t7\t14\t7\t14\t40\t181.5\t70.9\t5\t31.5\t-1.0\t30\t271.4\t2\n";
        let hot = row.replace("-1.0", "71.0").replace("31.5", "-950.0");
        let text = format!("{TABLE}{}{hot}", row.repeat(40));
        let found = read(text.as_bytes(), SOURCE).unwrap();
        assert_eq!(found.masked.implausible, 2, "-999 is none of them");
        let lost = row.replace("70.9", "95.0");
        let found = read(format!("{text}{lost}").as_bytes(), SOURCE).unwrap();
        assert_eq!(found.masked.implausible, 2 + 3, "no place has such values");
        let refused = read(format!("{text}{}", hot.repeat(3)).as_bytes(), SOURCE).unwrap_err();
        assert_eq!(refused.reason, RejectReason::Values, "{refused}");
    }

    #[test]
    fn damaged_and_empty_tables_are_refused_with_their_reasons() {
        let reason = |text: &str| read(text.as_bytes(), SOURCE).unwrap_err().reason;
        assert_eq!(
            reason(&TABLE.replace("2015", "soon")),
            RejectReason::Corrupt
        );
        assert_eq!(
            reason("yr\tmon\tday\tlat\tlon\n2000\t1\t1\t0\t0\n"),
            RejectReason::NoVariable
        );
        let header: String = TABLE.split_inclusive('\n').take(2).collect();
        assert_eq!(reason(&header), RejectReason::Values);
        assert_eq!(undated().reason, RejectReason::Time);
    }

    #[test]
    fn places_in_degrees_west_are_in_the_west() {
        let west = TABLE
            .replace("longitude [dec.deg.E]", "longitude [deg.W]")
            .replace("181.", "30.");
        let found = read(west.as_bytes(), SOURCE).unwrap().observations;
        assert!((found[0].lon_deg + 30.5).abs() < 1e-9, "{:?}", found[0]);
    }

    #[test]
    fn times_of_the_place_are_refused() {
        for (own, other) in [("\thh\t", "\thour (local)\t"), ("\thh\t", "\tHH [LST]\t")] {
            let table = TABLE.replace(own, other);
            let refused = read(table.as_bytes(), SOURCE).unwrap_err();
            assert_eq!(refused.reason, RejectReason::Time, "{refused}");
        }
        let utc = TABLE.replace("\thh\t", "\thour (UTC)\t");
        read(utc.as_bytes(), SOURCE).unwrap();
        let both = TABLE.replace("WOA_SSS", "Date/Time (local)");
        let found = read(both.as_bytes(), SOURCE).unwrap().observations;
        let time = found[0].time.to_string();
        assert_eq!(time, "2015-07-14T07:14:40Z", "that of the other columns");
    }

    #[test]
    fn depths_have_the_unit_of_their_column() {
        let depth = |unit: &str| {
            let table = TABLE.replace("sample_depth [m]", unit);
            read(table.as_bytes(), SOURCE).map(|found| found.observations[0].depth_m)
        };
        assert_eq!(depth("sample_depth [cm]").ok(), Some(0.05));
        let refused = depth("sample_depth [dbar]").unwrap_err();
        assert_eq!(refused.reason, RejectReason::Unit, "{refused}");
    }

    /// A row of TABLE with other words for the depth and the salinity.
    fn row(depth: &str, salinity: &str, minute: usize) -> String {
        format!(
            "33HQ\t2015\t7\t15\t7\t{minute}\t40\t181.5\t70.9\t{depth}\t{salinity}\t1.0\t30\t271.4\t2\n"
        )
    }

    #[test]
    fn numbers_that_cannot_be_read_are_counted_and_words_are_none() {
        let good: String = (0..40).map(|minute| row("5", "31.5", minute)).collect();
        let found = read(format!("{TABLE}{good}").as_bytes(), SOURCE).unwrap();
        assert_eq!(found.masked.implausible, 0);
        let words = format!("{TABLE}{good}{}", row("5", "n/a", 50));
        let found = read(words.as_bytes(), SOURCE).unwrap();
        assert_eq!(found.masked.implausible, 0, "a word is no value");
        let comma = format!("{TABLE}{good}{}", row("5", "31,5", 50));
        let found = read(comma.as_bytes(), SOURCE).unwrap();
        assert_eq!(found.masked.implausible, 1);
        let depth = format!("{TABLE}{good}{}", row("5-7", "31.5", 50));
        let found = read(depth.as_bytes(), SOURCE).unwrap();
        assert_eq!(
            found.masked.implausible, 3,
            "nobody knows how deep these are"
        );
        let many: String = (0..40).map(|minute| row("5", "31,5", minute)).collect();
        let refused = read(format!("{TABLE}{many}").as_bytes(), SOURCE).unwrap_err();
        assert_eq!(refused.reason, RejectReason::Values);
        assert!(refused.detail.contains("\"31,5\""), "{refused}");
    }

    #[test]
    fn a_sample_without_a_depth_is_at_the_surface_unless_others_lie_deep() {
        let table = |depth: &str| format!("{TABLE}{}{}", row(depth, "31.5", 1), row("", "31.5", 2));
        let found = read(table("20").as_bytes(), SOURCE).unwrap();
        let at_surface = |found: &Found| {
            let depths = found.observations.iter().map(|o| o.depth_m);
            depths.filter(|depth_m| *depth_m < 1.0).count()
        };
        assert_eq!((at_surface(&found), found.masked.implausible), (3, 0));
        let found = read(table("800").as_bytes(), SOURCE).unwrap();
        assert_eq!((at_surface(&found), found.masked.implausible), (0, 3));
    }

    #[test]
    fn temperatures_and_salinities_of_casts_are_not_called_those_of_the_surface() {
        let names = |depth: &str| {
            let table = format!("{TABLE}{}", row(depth, "31.5", 1)).replace("SST [", "Temp [");
            let found = read(table.as_bytes(), SOURCE).unwrap().observations;
            let names = found.into_iter().map(|o| o.property);
            names.collect::<std::collections::BTreeSet<String>>()
        };
        let fugacity = "fugacity_of_carbon_dioxide_in_sea_water";
        let surface = ["sea_surface_salinity", "sea_surface_temperature"];
        assert!(names("20").iter().eq([fugacity, surface[0], surface[1]]));
        let water = ["sea_water_practical_salinity", "sea_water_temperature"];
        assert!(names("800").iter().eq([fugacity, water[0], water[1]]));
    }

    #[test]
    fn columns_that_are_not_read_are_told() {
        let table = TABLE.replace("SST [deg.C]", "SST [furlong]");
        let found = read(table.as_bytes(), SOURCE).unwrap();
        let told: Vec<String> = found.passed_over.iter().map(ToString::to_string).collect();
        assert!(told.len() == 1 && told[0].contains("furlong"), "{told:?}");
    }
}
