//! Sums against the same taken pair by pair, and against their limits.

use super::*;

/// Every pair by itself, its distance by the angle between two directions.
fn pair_by_pair(plane: &Plane, length_km: f64, form: &Form) -> f64 {
    let direction = |at: usize| {
        let lat = plane.lats_deg[at / plane.cols].to_radians();
        let lon = ((at % plane.cols) as f64 * plane.dlon_deg).to_radians();
        [lat.cos() * lon.cos(), lat.cos() * lon.sin(), lat.sin()]
    };
    let mut sum = 0.0;
    for (i, x) in form.x.iter().enumerate() {
        for (j, y) in form.y.iter().enumerate() {
            let (a, b) = (direction(i), direction(j));
            let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            let cross = [
                a[1] * b[2] - a[2] * b[1],
                a[2] * b[0] - a[0] * b[2],
                a[0] * b[1] - a[1] * b[0],
            ];
            let sine = cross.iter().map(|c| c * c).sum::<f64>().sqrt();
            let distance_km = SPHERE_RADIUS_KM * sine.atan2(dot);
            sum += x * (-distance_km / length_km).exp() * y;
        }
    }
    sum
}

fn len(plane: &Plane) -> usize {
    plane.lats_deg.len() * plane.cols
}

fn form(cells: usize, turn: f64) -> Form {
    let wave = |i: usize, turn: f64| {
        // Some cells hold nothing, as land does.
        if i % 7 == 3 {
            0.0
        } else {
            1.5 + (i as f64 * turn).sin()
        }
    };
    Form {
        x: (0..cells).map(|i| wave(i, turn)).collect(),
        y: (0..cells).map(|i| wave(i, turn * 1.7)).collect(),
    }
}

fn planes() -> [Plane; 4] {
    let lats = |first: f64, step: f64, count: usize| -> Vec<f64> {
        (0..count).map(|row| first - step * row as f64).collect()
    };
    [
        Plane {
            lats_deg: lats(87.5, 5.0, 36),
            dlon_deg: 10.0,
            cols: 36,
            is_ring: true,
        },
        Plane {
            lats_deg: lats(40.5, 1.0, 7),
            dlon_deg: 1.0,
            cols: 23,
            is_ring: false,
        },
        // Wider than half a turn, an odd number of columns.
        Plane {
            lats_deg: lats(10.0, 4.0, 6),
            dlon_deg: 8.0,
            cols: 31,
            is_ring: false,
        },
        Plane {
            lats_deg: vec![-60.0],
            dlon_deg: 0.25,
            cols: 1,
            is_ring: false,
        },
    ]
}

#[test]
fn sums_are_those_of_all_pairs() {
    for plane in planes() {
        for length_km in [50.0, 700.0, 20_000.0] {
            let forms = [form(len(&plane), 0.7), form(len(&plane), 0.11)];
            let pairs = Pairs::new(plane.clone(), length_km);
            let spectra: Vec<_> = forms.iter().map(|form| pairs.spectrum(form)).collect();
            for (sum, form) in pairs.sums(&spectra).iter().zip(&forms) {
                let expected = pair_by_pair(&plane, length_km, form);
                assert!(
                    (sum / expected - 1.0).abs() < 1e-11,
                    "{} x {} at {length_km} km: {sum} {expected}",
                    plane.lats_deg.len(),
                    plane.cols
                );
            }
        }
    }
}

#[test]
fn errors_that_do_not_go_together_add_by_squares_and_those_that_do_by_size() {
    for plane in planes() {
        let own = form(len(&plane), 0.3);
        let at = |length_km: f64| {
            let pairs = Pairs::new(plane.clone(), length_km);
            pairs.sums(&[pairs.spectrum(&own)])[0]
        };
        let by_squares: f64 = own.x.iter().zip(&own.y).map(|(x, y)| x * y).sum();
        let by_size = own.x.iter().sum::<f64>() * own.y.iter().sum::<f64>();
        assert!((at(0.01) / by_squares - 1.0).abs() < 1e-11);
        assert!((at(1e13) / by_size - 1.0).abs() < 1e-8);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let plane = planes()[0].clone();
    let pairs = Pairs::new(plane.clone(), 900.0);
    let spectra = [pairs.spectrum(&form(len(&plane), 0.4))];
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| pairs.sums(&spectra))[0].to_bits()
    };
    assert_eq!(with(1), with(7));
}
