//! `fluxglobe bench`: figures measured, never asserted.

pub(crate) mod budget;
pub(crate) mod compare;
pub(crate) mod fill;
pub(crate) mod fly;
pub(crate) mod landing;
mod listed;
pub(crate) mod quality;
pub(crate) mod render;
pub(crate) mod serve;
pub(crate) mod stream;
pub(crate) mod window_size;

/// The smallest value that a share of all values does not exceed; `values` are sorted and there is one.
fn quantile(values: &[f64], share: f64) -> f64 {
    let rank = (share * values.len() as f64).ceil() as usize;
    values[rank.clamp(1, values.len()) - 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_were_measured() {
        let values: Vec<f64> = (1..=20).map(f64::from).collect();
        assert_eq!(
            (quantile(&values, 0.5), quantile(&values, 0.95)),
            (10.0, 19.0)
        );
        assert_eq!(quantile(&[7.0], 0.95).to_bits(), 7.0_f64.to_bits());
    }
}
