//! What others found: the published budgets of the Takahashi et al. (2009) climatology, and the integral of its grid.

use contract::earth::Earth;

/// Where the published values come from.
pub const CITATION: &str = "Takahashi, T., et al. (2009), Climatological mean and decadal change in surface ocean pCO2, \
and net sea-air CO2 flux over the global oceans, Deep-Sea Research II 56, 554-577, doi:10.1016/j.dsr2.2008.12.009";

/// A year's budget of one region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnnualBudget {
    /// Name of the region.
    pub region: &'static str,
    /// Figure of the earth that the grid was integrated on.
    pub earth: Earth,
    /// As published, Pg C a year; positive out of the sea. The authors give 0.7 Pg C as the global value's uncertainty.
    pub published_pg: f64,
    /// Integral of the 1-degree grid that the FluxEngine package ships, found outside this program, Pg C a year.
    pub grid_pg: f64,
    /// How far our integral of the same grid may be from that, Pg C a year.
    pub tolerance_pg: f64,
}

/// Bands are held to what three decimals and fractional cells leave open.
const BAND_TOLERANCE_PG: f64 = 0.005;

/// Annual budgets, reference year 2000. The grid differs from the paper's table by its 1-degree coast lines.
pub const ANNUAL: [AnnualBudget; 6] = [
    global(Earth::Wgs84, -1.404),
    global(Earth::Sphere, -1.398),
    band("14n-50n", -0.70, -0.694),
    band("14s-50s", -1.05, -1.021),
    band("50s-62s", -0.06, -0.066),
    band("equatorial-pacific", 0.48, 0.466),
];

/// Global budgets of the months January to December of the same grid on WGS84, Tg C, found outside this program. The
/// paper gives no months.
pub const MONTHLY_GRID_TG: [f64; 12] = [
    -176.1, -155.7, -141.5, -128.6, -125.7, -101.7, -52.3, -31.0, -36.1, -99.5, -160.4, -195.8,
];

/// How far a month may be off, as a share.
pub const MONTHLY_TOLERANCE: f64 = 0.005;
/// How far the globe's year may be off, as a share.
const GLOBAL_TOLERANCE: f64 = 0.002;

const fn global(earth: Earth, grid_pg: f64) -> AnnualBudget {
    let tolerance_pg = GLOBAL_TOLERANCE * grid_pg.abs();
    AnnualBudget {
        region: "global",
        earth,
        published_pg: -1.4,
        grid_pg,
        tolerance_pg,
    }
}

const fn band(region: &'static str, published_pg: f64, grid_pg: f64) -> AnnualBudget {
    AnnualBudget {
        region,
        earth: Earth::Wgs84,
        published_pg,
        grid_pg,
        tolerance_pg: BAND_TOLERANCE_PG,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_months_make_the_year() {
        let year_pg: f64 = MONTHLY_GRID_TG.iter().sum::<f64>() / 1000.0;
        assert!((year_pg - ANNUAL[0].grid_pg).abs() < 0.001, "{year_pg}");
    }
}
