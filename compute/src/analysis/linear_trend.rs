//! The trend by least squares, with the uncertainty that autocorrelated residuals leave.

use contract::analysis::LeastSquaresTrend;

use super::autocorrelation::{autocorrelation, effective_count};
use super::climatology::Seasonless;
use super::distribution::{student_quantile, student_two_sided};

/// Years in a decade.
const DECADE: f64 = 10.0;

/// The trend of values by least squares; none where fewer than three have data or all lie at one time.
///
/// `years` are the times of the steps, `values` one beside each, NaN no data, any unit; steps at equal distances, for
/// residuals are compared with their next ones. Effective number of values, and degrees of freedom two less: Santer et al.
/// (2000), doi:10.1029/1999JD901105, equations 3 to 6. Where means of months were found together with the line, so many effective values more
/// are taken up, and times vary by what is left of them beside these.
pub fn least_squares(
    years: &[f64],
    values: &[f64],
    season: Option<&Seasonless>,
) -> Option<LeastSquaresTrend> {
    let present = || years.iter().zip(values).filter(|(_, v)| !v.is_nan());
    let count = present().count();
    if count < 3 {
        return None;
    }
    let n = count as f64;
    let mean_x = present().map(|(x, _)| x).sum::<f64>() / n;
    let mean_y = present().map(|(_, y)| y).sum::<f64>() / n;
    let (mut xx, mut xy) = (0.0, 0.0);
    for (x, y) in present() {
        xx += (x - mean_x).powi(2);
        xy += (x - mean_x) * (y - mean_y);
    }
    if xx <= 0.0 {
        return None;
    }
    let slope = xy / xx;
    let left = |(x, y): (&f64, &f64)| y - mean_y - slope * (x - mean_x);
    let residuals: Vec<f64> = years.iter().zip(values).map(left).collect();
    let squares: f64 = residuals
        .iter()
        .filter(|r| !r.is_nan())
        .map(|r| r * r)
        .sum();
    let r = autocorrelation(&residuals, 1);
    let effective = effective_count(count, r);
    let means = season.map_or(1, |season| season.part_count.max(1));
    let freedom = effective - 2.0 - (means - 1) as f64 * effective / n;
    let known = season.map_or(xx, |season| season.squared_years);
    let error = (freedom > 0.0 && known > 0.0).then(|| (squares / freedom / known).sqrt());
    let reach = error.zip(student_quantile(freedom)).map(|(e, q)| e * q);
    let p_value = error.and_then(|error| {
        if error > 0.0 {
            return student_two_sided(slope / error, freedom);
        }
        // Every value lies on the line.
        Some(if slope.abs() > 0.0 { 0.0 } else { 1.0 })
    });
    Some(LeastSquaresTrend {
        slope_per_decade: slope * DECADE,
        standard_error_per_decade: error.map(|error| error * DECADE),
        lower_per_decade: reach.map(|reach| (slope - reach) * DECADE),
        upper_per_decade: reach.map(|reach| (slope + reach) * DECADE),
        p_value,
        lag1_autocorrelation: r,
        effective_count: effective,
    })
}

#[cfg(test)]
mod tests;
