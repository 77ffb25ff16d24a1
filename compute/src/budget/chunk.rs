//! Array kernels of budgets: one chunk of a field and the region's areas in, exact sums out.

use super::fixed::{AREA_DECIMALS, MASS_DECIMALS, OutOfRange, to_steps};

pub(crate) const MASS_STEPS_PER_KG: f64 = 10u64.pow(MASS_DECIMALS) as f64;
pub(crate) const AREA_STEPS_PER_M2: f64 = 10u64.pow(AREA_DECIMALS) as f64;

/// Mass that leaves the sea through a chunk: the sum over cells of flux x area x seconds.
///
/// - `flux_kg_m2_s`: `[cell]`, kg m⁻² s⁻¹, positive out of the sea; NaN is no data and adds nothing
/// - `area_m2`: `[cell]`, m², the region's share of each cell
/// - result: kg in steps of 10⁻⁹
///
/// Each cell's mass is rounded once to a step and summed as an integer, so that the order of summing cannot matter.
/// The rounding is below 0.5 µg a cell: 3e-5 kg for all 64,800 cells of a 1-degree globe.
pub fn mass_steps(flux_kg_m2_s: &[f32], area_m2: &[f64], seconds: f64) -> Result<i128, OutOfRange> {
    let mut sum = 0;
    for (&flux, &area) in flux_kg_m2_s.iter().zip(area_m2) {
        if !flux.is_nan() && area != 0.0 {
            sum += to_steps(f64::from(flux) * area * seconds * MASS_STEPS_PER_KG)?;
        }
    }
    Ok(sum)
}

/// The same for values that are masses per area already (accumulated carbon): the sum of column x area.
pub fn column_mass_steps(column_kg_m2: &[f32], area_m2: &[f64]) -> Result<i128, OutOfRange> {
    mass_steps(column_kg_m2, area_m2, 1.0)
}

/// Area of the cells of a chunk that hold data, m² in steps of 10⁻⁶; `values` and `area_m2` are `[cell]`.
pub fn valid_area_steps(values: &[f32], area_m2: &[f64]) -> Result<i128, OutOfRange> {
    let held = values
        .iter()
        .zip(area_m2)
        .filter(|(value, _)| !value.is_nan());
    total_steps(held.map(|(_, &area)| area))
}

/// Both sums of a chunk.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ChunkSums {
    /// As [`mass_steps`] gives it.
    pub mass_steps: i128,
    /// As [`valid_area_steps`] gives it.
    pub area_steps: i128,
}

/// [`mass_steps`] and [`valid_area_steps`] in one walk over the cells.
pub fn chunk_sums(values: &[f32], area_m2: &[f64], seconds: f64) -> Result<ChunkSums, OutOfRange> {
    let mut sums = ChunkSums::default();
    for (&value, &area) in values.iter().zip(area_m2) {
        if !value.is_nan() && area != 0.0 {
            sums.mass_steps += to_steps(f64::from(value) * area * seconds * MASS_STEPS_PER_KG)?;
            sums.area_steps += to_steps(area * AREA_STEPS_PER_M2)?;
        }
    }
    Ok(sums)
}

/// Area of all cells of a chunk, m² in steps of 10⁻⁶.
pub fn total_area_steps(area_m2: &[f64]) -> Result<i128, OutOfRange> {
    total_steps(area_m2.iter().copied())
}

fn total_steps(areas_m2: impl Iterator<Item = f64>) -> Result<i128, OutOfRange> {
    areas_m2
        .map(|area| to_steps(area * AREA_STEPS_PER_M2))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_made_chunk_has_its_mass() {
        let flux = [1e-9f32, f32::NAN, -2e-9];
        let area = [1e10, 1e10, 5e9];
        // 1e-9 * 1e10 * 100 = 1000 kg, -2e-9 * 5e9 * 100 = -1000 kg, each to the 24 bits of an f32
        let mass = mass_steps(&flux, &area, 100.0).unwrap();
        let expected =
            1000.0 * (f64::from(1e-9f32) / 1e-9) - 1000.0 * (f64::from(-2e-9f32) / -2e-9);
        assert!((mass as f64 * 1e-9 - expected).abs() < 1e-8, "{mass}");
        assert_eq!(
            valid_area_steps(&flux, &area).unwrap(),
            15_000_000_000_000_000
        );
        assert_eq!(total_area_steps(&area).unwrap(), 25_000_000_000_000_000);
    }

    #[test]
    fn one_walk_gives_both_sums() {
        let (mut flux, mut area) = values();
        flux[3..40].fill(f32::NAN);
        area[30..90].fill(0.0);
        let sums = chunk_sums(&flux, &area, 3600.0).unwrap();
        assert_eq!(Ok(sums.mass_steps), mass_steps(&flux, &area, 3600.0));
        assert_eq!(Ok(sums.area_steps), valid_area_steps(&flux, &area));
        assert!(chunk_sums(&[f32::INFINITY], &[1.0], 1.0).is_err());
    }

    #[test]
    fn an_infinite_flux_is_refused_rather_than_summed() {
        assert!(mass_steps(&[f32::INFINITY], &[1.0], 1.0).is_err());
    }

    /// A thousand values whose float sum depends on the order.
    fn values() -> (Vec<f32>, Vec<f64>) {
        let flux = (0..1000u32).map(|i| ((i * 7919 % 1009) as f32 - 504.0) * 1.7e-11);
        (
            flux.collect(),
            (0..1000u32).map(|i| 1.1e10 / f64::from(i + 1)).collect(),
        )
    }

    fn in_order<T: Copy>(values: &[T], stride: usize) -> Vec<T> {
        (0..values.len())
            .map(|i| values[i * stride % values.len()])
            .collect()
    }

    fn float_sum(flux: &[f32], area: &[f64]) -> u64 {
        flux.iter()
            .zip(area)
            .map(|(&f, &a)| f64::from(f) * a * 3600.0)
            .sum::<f64>()
            .to_bits()
    }

    #[test]
    fn the_order_of_cells_does_not_change_one_bit_but_would_in_floats() {
        let (flux, area) = values();
        let mut float_sums = vec![];
        for stride in [1, 3, 7, 999] {
            let (flux, area) = (in_order(&flux, stride), in_order(&area, stride));
            assert_eq!(
                mass_steps(&flux, &area, 3600.0),
                mass_steps(&values().0, &values().1, 3600.0)
            );
            float_sums.push(float_sum(&flux, &area));
        }
        float_sums.dedup();
        assert!(
            float_sums.len() > 1,
            "the planted fault, a sum of floats, is not seen"
        );
    }
}
