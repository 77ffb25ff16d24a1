//! Options of what is made of series.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use contract::ContractError;
use contract::analysis::{
    Along, AnalysisOptions, AnalysisPart, AnalysisWishes, BasePeriod, CalendarBins,
};
use contract::earth::Earth;
use contract::grid::LonLatDeg;
use contract::manifest::AskedVersion;
use contract::statistics::MinCoverage;
use contract::time::{TimeMs, TimeStep};

use super::steps::STEPS;

/// Heading of what is made of a series.
const HEADING: &str = "Made of the series";

/// What is made of a series, in place of the series itself; several together.
#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct Analysis {
    /// Mean, spread and count of each part of the year (--bins) over the years of --base. A spread is that of a sample, √(Σ (x - m)² / (n - 1)).
    #[arg(long, help_heading = HEADING)]
    climatology: bool,
    /// How far each step is from that climatology: in the unit, and in spreads of its part of the year.
    #[arg(long, help_heading = HEADING)]
    anomaly: bool,
    /// Least-squares and Theil-Sen slopes with intervals of 95 %, and the test of Mann and Kendall; all allow for
    /// autocorrelation (effective number of values; Hamed and Rao 1998 with that of neighbouring steps). Needs five years.
    #[arg(long, help_heading = HEADING)]
    trend: bool,
    /// Amplitude and phase of the year and the half-year.
    #[arg(long, help_heading = HEADING)]
    season: bool,
    /// Highest and lowest steps with their dates, and percentiles.
    #[arg(long, help_heading = HEADING)]
    extremes: bool,
    /// Years of the climatology, both part of it: 1991/2020. All that the series covers if absent.
    #[arg(long, value_name = "FIRST/LAST", help_heading = HEADING)]
    base: Option<BasePeriod>,
    /// Parts of the year of the climatology; months if absent.
    #[arg(long, value_name = "month|season|day", help_heading = HEADING)]
    bins: Option<CalendarBins>,
    /// Means that the trend is drawn through; steps as they are where those are longer. Months if absent.
    #[arg(long, value_name = STEPS, help_heading = HEADING)]
    trend_step: Option<TimeStep>,
    /// Draw it too: the series (with --statistic mean,std also its spread), its climatology, its anomalies and its trend, those that are asked for one below the other.
    #[arg(long, value_name = "FILE.svg|FILE.png", help_heading = HEADING)]
    pub(crate) plot: Option<PlotFile>,
}

impl Analysis {
    /// What is asked for; none if the series itself is.
    ///
    /// # Errors
    /// An option of what is not asked for.
    pub(crate) fn asked(
        &self,
        min_coverage: Option<MinCoverage>,
    ) -> Result<Option<AnalysisOptions>, ContractError> {
        let asked = [
            (self.climatology, AnalysisPart::Climatology),
            (self.anomaly, AnalysisPart::Anomaly),
            (self.trend, AnalysisPart::Trend),
            (self.season, AnalysisPart::Season),
            (self.extremes, AnalysisPart::Extremes),
        ];
        let parts: Vec<_> = asked
            .into_iter()
            .filter_map(|(is_asked, part)| is_asked.then_some(part))
            .collect();
        let has_option = self.base.is_some() || self.bins.is_some() || self.trend_step.is_some();
        if parts.is_empty() && !has_option {
            return Ok(None);
        }
        let wishes = AnalysisWishes {
            parts,
            base: self.base,
            bins: self.bins,
            trend_step: self.trend_step,
            min_coverage,
        };
        wishes.options().map(Some)
    }
}

/// Where a series is taken: a region, a cell or a line.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub(crate) struct Place {
    /// `global`, a named region, a box WEST,SOUTH,EAST,NORTH, a GeoJSON or WKT file, the text of one, or MASK:CODE, the cells where a
    /// landed mask has a code, or what it means: basins:5, basins:southern.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) region: Option<String>,
    /// The cell that holds a place, degrees east and north, in place of a region.
    #[arg(long, value_name = "LON,LAT", allow_hyphen_values = true)]
    pub(crate) at: Option<LonLatDeg>,
    /// The mean along a line, each cell by the length in it: `LON,LAT;LON,LAT;...`, a GeoJSON or WKT file, or the text of one.
    #[arg(long, value_name = "LINE", allow_hyphen_values = true)]
    pub(crate) line: Option<String>,
}

/// `fluxglobe stats correlate`.
#[derive(Debug, Args)]
pub(crate) struct StatsCorrelate {
    /// The two products, each with its own --product: the first and the second; of each a version if one is given, such as NAME@12.
    #[arg(long = "product", required = true, value_name = "PRODUCT[@VERSION]")]
    pub(crate) products: Vec<AskedVersion>,
    #[command(flatten)]
    pub(crate) place: Place,
    /// Steps that one is moved against the other, at most 400; at lags above zero the first leads. None if absent.
    #[arg(long, value_name = "STEPS")]
    pub(crate) max_lag: Option<u32>,
    /// What they are compared in; `native` needs the same periods of both. Months if absent.
    #[arg(long, value_name = STEPS)]
    pub(crate) step: Option<TimeStep>,
    /// Take the mean of each calendar month off both first: two series with seasons always go together.
    #[arg(long, visible_alias = "deseasonalize")]
    pub(crate) deseasonalise: bool,
    /// Least coverage, percent: steps of either that hold data over less of the region's sea, or of the line, are left out, and how many is
    /// said. 0 if absent.
    #[arg(long, value_name = "PERCENT")]
    pub(crate) min_coverage: Option<MinCoverage>,
    /// First instant: 2000, 2000-03, 2000-03-15 or with a time of day. The products' own if absent. Every step that reaches into the
    /// period counts, and whole: of months --from 2004-08-02 has all of August.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after the period. The products' own if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// Figure of the earth for areas and lengths, of a region or a line: wgs84, sphere (R = 6371 km) or local-radius (as FluxEngine sums).
    /// wgs84 if absent.
    #[arg(long, value_name = "EARTH")]
    pub(crate) earth: Option<Earth>,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe stats difference`.
#[derive(Debug, Args)]
pub(crate) struct StatsDifference {
    /// Product, and which of its versions: NAME, NAME@12 or NAME@12-0a1b2c3d. The newest if none is given.
    #[arg(long, value_name = "PRODUCT[@VERSION]")]
    pub(crate) product: AskedVersion,
    /// Its years, both part of it: 2001/2005. All that it covers if absent. A step that lies partly in them counts by its time inside.
    #[arg(long, value_name = "FIRST/LAST")]
    pub(crate) period: Option<BasePeriod>,
    /// Its version, as answers name it, with or without its digest, where --product names none. The newest if absent.
    #[arg(long, value_name = "VERSION")]
    pub(crate) manifest: Option<AskedVersion>,
    /// Product that is taken off, and which of its versions. The same product, in its newest version, if absent.
    #[arg(long, value_name = "PRODUCT[@VERSION]")]
    pub(crate) minus: Option<AskedVersion>,
    /// Years that are taken off. The same ones if absent. Steps count as with --period.
    #[arg(long, value_name = "FIRST/LAST")]
    pub(crate) minus_period: Option<BasePeriod>,
    /// Version that is taken off, as --manifest has it, where --minus names none. The newest if absent.
    #[arg(long, value_name = "VERSION")]
    pub(crate) minus_manifest: Option<AskedVersion>,
    #[command(flatten)]
    pub(crate) place: Place,
    /// Least coverage, percent: steps of either that hold data over less of the region's sea, or of the line, are left out, and how many is
    /// said. 0 if absent.
    #[arg(long, value_name = "PERCENT")]
    pub(crate) min_coverage: Option<MinCoverage>,
    /// Figure of the earth for areas and lengths, of a region or a line: wgs84, sphere (R = 6371 km) or local-radius (as FluxEngine sums).
    /// wgs84 if absent.
    #[arg(long, value_name = "EARTH")]
    pub(crate) earth: Option<Earth>,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `fluxglobe stats hovmoller`.
#[derive(Debug, Args)]
pub(crate) struct StatsHovmoller {
    /// Product, and which of its versions: NAME, NAME@12 or NAME@12-0a1b2c3d. The newest if none is given.
    #[arg(long, value_name = "PRODUCT[@VERSION]")]
    pub(crate) product: AskedVersion,
    /// What bands lie along: `lat`, means over longitude, or `lon`, means over latitude.
    #[arg(long, value_name = "lat|lon")]
    pub(crate) along: Along,
    /// Height or width of a band, degrees, no less than a cell. The least of 1, 2, 5, 10 that is no less than a cell if absent.
    #[arg(long, value_name = "DEGREES")]
    pub(crate) band: Option<f64>,
    /// What a row covers; months if absent. `total` is the profile of the bands over all the period.
    #[arg(long, value_name = STEPS)]
    pub(crate) step: Option<TimeStep>,
    /// `global`, a named region, a box WEST,SOUTH,EAST,NORTH, a GeoJSON or WKT file, the text of one, or MASK:CODE, the cells where a
    /// landed mask has a code, or what it means: basins:5, basins:southern. Of a box the cells count whose middles lie in it, of all else
    /// every cell by its share. All of the grid if absent.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) region: Option<String>,
    /// Least coverage, percent: means of bands with less are left out, and how many is said; of a box a share of the band's cells that ever
    /// hold data, of all else of the region's sea in the band. 0 if absent.
    #[arg(long, value_name = "PERCENT")]
    pub(crate) min_coverage: Option<MinCoverage>,
    /// First instant: 2000, 2000-03, 2000-03-15 or with a time of day. The product's first if absent. A step
    /// that lies partly in the period counts by its time inside.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after the period. The product's end if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// Figure of the earth for areas: wgs84, sphere (R = 6371 km) or local-radius (as FluxEngine sums).
    #[arg(long, default_value = "wgs84")]
    pub(crate) earth: Earth,
    /// JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
    /// Draw it too.
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    pub(crate) plot: Option<PlotFile>,
}

/// A file of a plot, and what it is written as.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PlotFile {
    pub(crate) path: PathBuf,
    pub(crate) form: PlotForm,
}

/// What a plot is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PlotForm {
    Svg,
    Png,
}

impl FromStr for PlotFile {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let path = PathBuf::from(text);
        let ending = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
        let form = match ending.as_ref().and_then(|ending| ending.to_str()) {
            Some("svg") => PlotForm::Svg,
            Some("png") => PlotForm::Png,
            _ => return Err("a plot is written to a file that ends in .svg or .png".to_owned()),
        };
        Ok(Self { path, form })
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        analysis: Analysis,
    }

    #[test]
    fn options_of_what_is_not_asked_for_are_refused() {
        let asked = |words: &str| {
            let words = ["stats"].into_iter().chain(words.split_whitespace());
            Line::parse_from(words).analysis.asked(None)
        };
        assert_eq!(asked("").unwrap(), None);
        for right in [
            "--trend --trend-step year",
            "--anomaly --bins season --base 1991/2020",
        ] {
            assert!(asked(right).unwrap().is_some(), "{right}");
        }
        for (words, said) in [
            ("--base 1991/2020", "the climatology and the anomaly"),
            ("--bins season", "the climatology and the anomaly"),
            (
                "--trend --base 1991/2020",
                "the climatology and the anomaly",
            ),
            ("--trend-step year", "the trend"),
            ("--climatology --trend-step year", "the trend"),
        ] {
            let refused = asked(words).unwrap_err().to_string();
            assert!(refused.contains(said), "{words}: {refused}");
        }
    }

    #[test]
    fn plots_are_told_by_the_ending_of_their_file() {
        let form = |text: &str| text.parse::<PlotFile>().map(|file| file.form);
        assert_eq!(form("a/b.svg"), Ok(PlotForm::Svg));
        assert_eq!(form("B.PNG"), Ok(PlotForm::Png));
        assert!(form("a.pdf").is_err() && form("svg").is_err());
    }
}
