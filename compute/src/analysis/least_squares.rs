//! Least squares of a few columns.

/// Smallest pivot, as a share of its column's sum of squares, at which columns still count as different ones.
const LEAST_PIVOT: f64 = 1e-9;

/// The factors of `N` columns whose sum is nearest to the values, and what they leave; none where columns are so alike that
/// more than one answer fits.
///
/// `rows` holds a row of columns for each value; normal equations by Cholesky's factors, for columns of about one size.
pub fn fit<const N: usize>(rows: &[[f64; N]], values: &[f64]) -> Option<([f64; N], Vec<f64>)> {
    let mut normal = [[0.0; N]; N];
    let mut right = [0.0; N];
    for (row, value) in rows.iter().zip(values) {
        for i in 0..N {
            for j in 0..=i {
                normal[i][j] += row[i] * row[j];
            }
            right[i] += row[i] * value;
        }
    }
    let factors = solved(normal, right)?;
    let left = |(row, value): (&[f64; N], &f64)| {
        let sum: f64 = row.iter().zip(factors).map(|(a, b)| a * b).sum();
        value - sum
    };
    let left = rows.iter().zip(values).map(left).collect();
    Some((factors, left))
}

/// Solves a symmetric system whose lower half is given.
fn solved<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> Option<[f64; N]> {
    for j in 0..N {
        let own = a[j][j];
        let pivot = own - (0..j).map(|k| a[j][k] * a[j][k]).sum::<f64>();
        if pivot.is_nan() || pivot <= LEAST_PIVOT * own {
            return None;
        }
        a[j][j] = pivot.sqrt();
        for i in j + 1..N {
            let rest = a[i][j] - (0..j).map(|k| a[i][k] * a[j][k]).sum::<f64>();
            a[i][j] = rest / a[j][j];
        }
    }
    for i in 0..N {
        b[i] = (b[i] - (0..i).map(|k| a[i][k] * b[k]).sum::<f64>()) / a[i][i];
    }
    for i in (0..N).rev() {
        b[i] = (b[i] - (i + 1..N).map(|k| a[k][i] * b[k]).sum::<f64>()) / a[i][i];
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_of_exact_sums_are_found_and_equal_columns_are_not_told_apart() {
        let rows: Vec<[f64; 3]> = (0..7)
            .map(|i| f64::from(i) - 3.0)
            .map(|x| [1.0, x, x * x])
            .collect();
        let values: Vec<f64> = rows.iter().map(|r| 2.0 - 0.5 * r[1] + 3.0 * r[2]).collect();
        let (factors, left) = fit(&rows, &values).unwrap();
        for (found, exact) in factors.iter().zip([2.0, -0.5, 3.0]) {
            assert!((found - exact).abs() < 1e-12, "{factors:?}");
        }
        assert!(left.iter().all(|left| left.abs() < 1e-12));
        let alike: Vec<[f64; 2]> = rows.iter().map(|r| [r[1], 2.0 * r[1]]).collect();
        assert!(fit(&alike, &values).is_none());
        assert!(fit::<2>(&[], &[]).is_none());
    }
}
