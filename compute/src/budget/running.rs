//! Carbon accumulated in every cell: fluxes of one step after another in, exact running sums out.

use super::fixed::{COLUMN_STEPS_PER_KG_M2, OutOfRange, to_steps};

/// Largest running sum, in steps of 10⁻¹⁵ kg m⁻²: 9,000 kg m⁻², nine times what a product may hold.
const LIMIT_STEPS: i64 = 9_000_000_000_000_000_000;

/// Adds a step's flux to the running sums.
///
/// - `sums`: `[cell]`, kg m⁻² in steps of 10⁻¹⁵
/// - `flux_kg_m2_s`: `[cell]`, kg m⁻² s⁻¹; NaN adds nothing, so that a gap in time leaves the cell as it was
///
/// Each step's share is rounded once, so that adding runs of steps in any grouping gives the same bits.
pub fn add_step(sums: &mut [i64], flux_kg_m2_s: &[f32], seconds: f64) -> Result<(), OutOfRange> {
    for (sum, &flux) in sums.iter_mut().zip(flux_kg_m2_s) {
        if !flux.is_nan() {
            let column_kg_m2 = f64::from(flux) * seconds;
            let share = to_steps(column_kg_m2 * COLUMN_STEPS_PER_KG_M2)?;
            *sum = checked_sum(*sum, share).ok_or(OutOfRange(column_kg_m2))?;
        }
    }
    Ok(())
}

/// Adds other running sums, `[cell]`, such as those of the steps before.
pub fn add_sums(sums: &mut [i64], others: &[i64]) -> Result<(), OutOfRange> {
    for (sum, &other) in sums.iter_mut().zip(others) {
        *sum = checked_sum(*sum, i128::from(other)).ok_or(OutOfRange(other as f64))?;
    }
    Ok(())
}

fn checked_sum(a: i64, b: i128) -> Option<i64> {
    let sum = i64::try_from(i128::from(a) + b).ok()?;
    (-LIMIT_STEPS..=LIMIT_STEPS).contains(&sum).then_some(sum)
}

/// A running sum as a stored value, kg m⁻².
pub fn column_kg_m2(sum: i64) -> f32 {
    (sum as f64 / COLUMN_STEPS_PER_KG_M2) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_leaves_a_cell_as_it_was() {
        let mut sums = [0, 0];
        add_step(&mut sums, &[1e-8, f32::NAN], 1000.0).unwrap();
        add_step(&mut sums, &[f32::NAN, -2e-8], 500.0).unwrap();
        assert!((column_kg_m2(sums[0]) / 1e-5 - 1.0).abs() < 1e-6);
        assert!((column_kg_m2(sums[1]) / -1e-5 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn grouping_does_not_change_one_bit() {
        let steps: Vec<[f32; 1]> = (0..50).map(|i| [(i as f32 - 20.3) * 1.3e-10]).collect();
        let run = |steps: &[[f32; 1]]| {
            let mut sums = [0];
            for step in steps {
                add_step(&mut sums, step, 2_678_400.0).unwrap();
            }
            sums
        };
        let mut halves = run(&steps[17..]);
        add_sums(&mut halves, &run(&steps[..17])).unwrap();
        assert_eq!(halves, run(&steps));
    }

    #[test]
    fn sums_beyond_anything_physical_are_refused() {
        assert!(add_step(&mut [0], &[1.0], 1e7).is_err());
        assert!(add_step(&mut [0], &[f32::INFINITY], 1.0).is_err());
        assert!(add_sums(&mut [LIMIT_STEPS], &[1]).is_err());
    }
}
