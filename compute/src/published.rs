//! What others found: the budgets that Takahashi et al. (2009) print, and an integration of their grid by another program.

use std::sync::LazyLock;

use contract::check::Stated;
use contract::earth::Earth;
use serde::Deserialize;

/// Where the printed values come from.
pub const CITATION: &str = "Takahashi, T., et al. (2009), Climatological mean and decadal change in surface ocean pCO2, \
and net sea-air CO2 flux over the global oceans, Deep-Sea Research II 56, 554-577, doi:10.1016/j.dsr2.2008.12.009";

/// Where the independent values come from.
pub const METHOD: &str = "Independent: the same 1-degree grids, as FluxEngine 4.2.1 ships them, integrated in Python by \
tests/reference/takahashi09_integral.py, which shares no code with Fluxglobe. The grid differs from the paper's tables by \
its 1-degree coast lines.";

/// A year's budget of one region as the paper prints it, Pg C a year; positive out of the sea.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Annual {
    /// Name of the region.
    pub region: &'static str,
    /// Figure of the earth that the grid is integrated on: the paper names none.
    pub earth: Earth,
    /// As printed.
    pub paper: Stated,
}

/// The paper's annual budgets, reference year 2000. It states an uncertainty of the global value alone, and no months.
pub const ANNUAL: [Annual; 6] = [
    global(Earth::Wgs84),
    global(Earth::Sphere),
    band("14n-50n", -0.70),
    band("14s-50s", -1.05),
    band("50s-62s", -0.06),
    band("equatorial-pacific", 0.48),
];

const fn global(earth: Earth) -> Annual {
    Annual {
        region: "global",
        earth,
        paper: Stated {
            value: -1.4,
            decimals: 1,
            uncertainty: Some(0.7),
        },
    }
}

const fn band(region: &'static str, value: f64) -> Annual {
    Annual {
        region,
        earth: Earth::Wgs84,
        paper: Stated {
            value,
            decimals: 2,
            uncertainty: None,
        },
    }
}

/// The grid integrated by another program.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Integrals {
    /// The year.
    pub years: Vec<YearIntegral>,
    /// January to December, the globe on WGS84, Tg C.
    pub months_tg: Vec<f64>,
}

/// A year of one region.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct YearIntegral {
    /// Name of the region.
    pub region: String,
    /// Figure of the earth.
    pub earth: Earth,
    /// Pg C.
    pub pg: f64,
}

/// What `tests/reference/takahashi09_integral.py` printed; a test runs it and compares.
pub const INTEGRALS_JSON: &str = include_str!("published/takahashi09.json");

/// The same, read.
pub static INTEGRALS: LazyLock<Integrals> = LazyLock::new(|| {
    serde_json::from_str(INTEGRALS_JSON).expect("the shipped file is read by a test")
});

impl Integrals {
    /// A region's year, Pg C.
    pub fn year_pg(&self, region: &str, earth: Earth) -> Option<f64> {
        let mut years = self.years.iter();
        let found = years.find(|year| year.region == region && year.earth == earth);
        found.map(|year| year.pg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_printed_value_has_its_integral_and_the_months_make_the_year() {
        for annual in &ANNUAL {
            let integral = INTEGRALS.year_pg(annual.region, annual.earth);
            assert!(integral.is_some(), "{annual:?}");
        }
        assert_eq!(INTEGRALS.months_tg.len(), 12);
        let year_pg: f64 = INTEGRALS.months_tg.iter().sum::<f64>() / 1000.0;
        let whole = INTEGRALS.year_pg("global", Earth::Wgs84).unwrap();
        assert!((year_pg - whole).abs() < 1e-5, "{year_pg} {whole}");
    }
}
