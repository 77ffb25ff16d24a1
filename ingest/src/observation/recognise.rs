//! Is a file one of observations, and of which kind? From what is in it, never from its name.

use crate::inspect::file::description::{Description, Variable};
use crate::plan::cf::coordinate::{Role, role_of};

use super::{ndbc, table};

/// Bytes of a text file that are looked at: the comments of a table come before its columns.
const HEAD_BYTES: usize = 256 << 10;

/// Which way the samples of a file lie in space and time (CF conventions, chapter 9).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Feature {
    /// Single samples without order.
    Point,
    /// Series at fixed places.
    TimeSeries,
    /// Series along ways.
    Trajectory,
    /// Casts.
    Profile,
    /// Casts again and again at fixed places.
    TimeSeriesProfile,
    /// Casts along ways.
    TrajectoryProfile,
    /// Series of platforms for which the file has no places.
    Unplaced,
}

impl Feature {
    /// Are there values at several depths for one place and time?
    pub(crate) fn is_of_casts(self) -> bool {
        match self {
            Self::Profile | Self::TimeSeriesProfile | Self::TrajectoryProfile => true,
            Self::Point | Self::TimeSeries | Self::Trajectory | Self::Unplaced => false,
        }
    }
}

/// A text format of observations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TextFormat {
    /// NDBC standard meteorological data.
    Ndbc,
    /// Tab-separated columns with place and time.
    Table,
    /// Comma-separated values of grid cells under numbers instead of times.
    UndatedGrid,
}

/// Of which kind a NetCDF or HDF5 file of observations is; none if it is none.
pub(crate) fn recognise(description: &Description) -> Option<Feature> {
    let attributes = &description.attributes;
    let named = ["featureType", "CF:featureType", "cdm_data_type"]
        .into_iter()
        .filter_map(|name| attributes.text(name))
        .find_map(of_name);
    named
        .or_else(|| is_epic_mooring(description).then_some(Feature::TimeSeries))
        .or_else(|| is_unplaced(description).then_some(Feature::Unplaced))
}

/// Of which kind a text file of observations is; none if it is none.
pub(crate) fn recognise_text(content: &[u8]) -> Option<TextFormat> {
    let head = &content[..content.len().min(HEAD_BYTES)];
    if head.contains(&0) {
        return None;
    }
    if ndbc::is_header(first_line(head)) {
        return Some(TextFormat::Ndbc);
    }
    if table::is_undated_grid(first_line(head)) {
        return Some(TextFormat::UndatedGrid);
    }
    table::has_columns(head).then_some(TextFormat::Table)
}

fn first_line(head: &[u8]) -> &str {
    let line = head.split(|b| *b == b'\n').next().unwrap_or_default();
    std::str::from_utf8(line).unwrap_or_default().trim()
}

fn of_name(name: &str) -> Option<Feature> {
    match name.to_ascii_lowercase().as_str() {
        "point" => Some(Feature::Point),
        "timeseries" | "station" => Some(Feature::TimeSeries),
        "trajectory" => Some(Feature::Trajectory),
        "profile" => Some(Feature::Profile),
        "timeseriesprofile" | "stationprofile" => Some(Feature::TimeSeriesProfile),
        "trajectoryprofile" | "section" => Some(Feature::TrajectoryProfile),
        _ => None,
    }
}

/// One latitude, one longitude, times, and variables with EPIC codes: how moorings were written before CF.
fn is_epic_mooring(description: &Description) -> bool {
    let of = |role| {
        description
            .variables
            .iter()
            .filter(move |v| role_of(v) == role)
    };
    let is_single = |role| of(role).any(|v| v.cell_count() == 1);
    let has_code = |v: &Variable| v.attributes.0.contains_key("epic_code");
    is_single(Role::Latitude)
        && is_single(Role::Longitude)
        && of(Role::Time).any(Variable::is_coordinate)
        && description.variables.iter().any(has_code)
}

/// Values by platform and time, and neither a latitude nor a longitude: nothing says where.
fn is_unplaced(description: &Description) -> bool {
    let is_platform = |name: &str| {
        let name = name.to_ascii_lowercase();
        ["mooring", "buoy", "station", "platform", "site"]
            .iter()
            .any(|word| name.contains(word))
    };
    let by_platform = |v: &Variable| {
        let mut names = v.dimensions.iter().filter_map(|d| d.name.as_deref());
        v.dimensions.len() >= 2 && v.is_numeric() && names.any(is_platform)
    };
    let is_place = |v: &Variable| matches!(role_of(v), Role::Latitude | Role::Longitude);
    description.variables.iter().any(by_platform) && !description.variables.iter().any(is_place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_known_by_its_columns() {
        let kind = |text: &str| recognise_text(text.as_bytes());
        assert_eq!(
            kind("#YY  MM DD hh mm WDIR WSPD GST\n"),
            Some(TextFormat::Ndbc)
        );
        assert_eq!(kind("YY  MM DD hh WD WSPD GST\n"), Some(TextFormat::Ndbc));
        let table = "some words\nExpocode\tyr\tmon\tday\thh\tmm\tss\tlongitude [dec.deg.E]\tlatitude [dec.deg.N]\tSST [deg.C]\n";
        assert_eq!(kind(table), Some(TextFormat::Table));
        let grid = "\"\",\"Grid_lat\",\"Grid_long\",\"1\",\"2\"\n";
        assert_eq!(kind(grid), Some(TextFormat::UndatedGrid));
        for other in [
            "",
            "lat,lon,flux\n1,2,3\n",
            "year\tsst\n2000\t1\n",
            "CDF\u{1}\0\0",
        ] {
            assert_eq!(kind(other), None, "{other:?}");
        }
    }
}
