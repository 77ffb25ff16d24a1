//! Kernels beside sums that are written down plainly, and what must not matter.

use contract::quantity::Quantity;

use super::*;

const STEPS: usize = 5;

fn cells() -> Vec<CellWeight> {
    let weight = |weight, covered| CellWeight { weight, covered };
    vec![
        weight(1 << 36, 1 << 36),
        weight(1 << 36, 1 << 36),
        weight(0, 0),
        weight(7, 3),
        weight(1 << 35, 0),
    ]
}

fn values() -> Vec<f32> {
    let value = |at: usize| match at % 7 {
        3 => f32::NAN,
        _ => ((at * 7919 % 1009) as f32 - 504.0) * 1.7e-11,
    };
    (0..cells().len() * STEPS).map(value).collect()
}

fn block(values: &[f32]) -> Values<'_> {
    Values {
        of: values,
        step_count: STEPS,
        first: 1,
    }
}

fn sums(values: &[f32], cells: &[CellWeight]) -> Result<Vec<StepSums>, OutOfRange> {
    let scale = Scale::of(Quantity::CarbonFlux).unwrap();
    let mut summing = Summing::new(3, scale, [true; 2]);
    summing.add(block(values), cells, 0..3)?;
    Ok(summing.finish())
}

#[test]
fn blocks_side_by_side_and_runs_in_pieces_have_the_sums_of_their_cells() {
    let weight = |cell: usize| match cell % 8 {
        7 => 1 << 30,
        _ => 1000 + (cell / 8) as i64,
    };
    let cells: Vec<CellWeight> = (0..64)
        .map(|cell| CellWeight {
            weight: weight(cell),
            covered: weight(cell) / 2,
        })
        .collect();
    let values = |block: usize| -> Vec<f32> {
        let value = |at: usize| ((at * 7919 + block * 31) % 1009) as f32 * 1e-11;
        (0..64 * STEPS).map(value).collect()
    };
    let scale = Scale::of(Quantity::CarbonFlux).unwrap();
    let mut together = Summing::new(4, scale, [true; 2]);
    let mut one_by_one = vec![StepSums::default(); 4];
    for number in 0..5 {
        let values = values(number);
        let from = |first: usize| Values {
            first,
            ..block(&values)
        };
        // The first step stands elsewhere in the run than the other three.
        together.add(from(4), &cells, 0..1).unwrap();
        together.add(from(1), &cells, 1..4).unwrap();
        for (cell, weight) in cells.iter().enumerate() {
            let mut alone = Summing::new(4, scale, [true; 2]);
            let own = Values {
                of: &values[cell * STEPS..][..STEPS],
                step_count: STEPS,
                first: 4,
            };
            alone.add(own, &[*weight], 0..1).unwrap();
            alone
                .add(Values { first: 1, ..own }, &[*weight], 1..4)
                .unwrap();
            for (sum, more) in one_by_one.iter_mut().zip(alone.finish()) {
                sum.merge(&more).unwrap();
            }
        }
    }
    assert_eq!(together.finish(), one_by_one);
}

#[test]
fn sums_are_those_of_a_plain_loop() {
    let (values, cells, scale) = (values(), cells(), Scale::of(Quantity::CarbonFlux).unwrap());
    let found = sums(&values, &cells).unwrap();
    for (step, own) in found.iter().enumerate() {
        let at = |cell: usize| values[cell * STEPS + 1 + step];
        let there: Vec<usize> = (0..cells.len())
            .filter(|cell| cells[*cell].weight > 0 && !at(*cell).is_nan())
            .collect();
        let total = |of: &dyn Fn(usize) -> f64| there.iter().map(|cell| of(*cell)).sum::<f64>();
        let weight = |cell: usize| cells[cell].weight as f64;
        assert_eq!(own.count, there.len() as u64);
        assert!((own.weight as f64 - total(&weight)).abs() < 1.0);
        let covered = total(&|cell| cells[cell].covered as f64);
        assert!((own.covered as f64 - covered).abs() < 1.0);
        let mean = total(&|cell| weight(cell) * f64::from(at(cell))) / total(&weight);
        assert!((scale.mean(own.sum, own.weight) - mean).abs() < 1e-18);
        let variance =
            total(&|cell| weight(cell) * (f64::from(at(cell)) - mean).powi(2)) / total(&weight);
        let std = scale.std(own.squares, own.sum, own.weight);
        assert!((std - variance.sqrt()).abs() < 1e-6 * variance.sqrt());
        let extremes = there.iter().map(|cell| at(*cell));
        let (min, max) = (
            extremes.clone().fold(f32::INFINITY, f32::min),
            extremes.fold(f32::NEG_INFINITY, f32::max),
        );
        assert_eq!(own.min.to_bits(), min.to_bits());
        assert_eq!(own.max.to_bits(), max.to_bits());
    }
}

#[test]
fn the_order_of_cells_does_not_change_one_bit_but_would_in_floats() {
    let (values, cells) = (values(), cells());
    let right = sums(&values, &cells).unwrap();
    let mut float_sums = vec![];
    for turn in 0..cells.len() {
        let order: Vec<usize> = (0..cells.len()).map(|i| (i + turn) % cells.len()).collect();
        let turned: Vec<CellWeight> = order.iter().map(|cell| cells[*cell]).collect();
        let runs = order
            .iter()
            .flat_map(|cell| &values[cell * STEPS..][..STEPS]);
        let runs: Vec<f32> = runs.copied().collect();
        assert_eq!(sums(&runs, &turned).unwrap(), right);
        let weighed = order.iter().map(|cell| {
            let value = values[cell * STEPS + 1];
            if value.is_nan() {
                0.0
            } else {
                value * cells[*cell].weight as f32
            }
        });
        float_sums.push(weighed.sum::<f32>().to_bits());
    }
    float_sums.dedup();
    assert!(float_sums.len() > 1, "a sum of floats would be found out");
}

#[test]
fn what_is_beyond_anything_physical_is_refused() {
    for bad in [f32::INFINITY, f32::NEG_INFINITY, 1e30, -1.0] {
        let mut values = values();
        values[1] = bad;
        assert!(sums(&values, &cells()).is_err(), "{bad}");
        // A cell without weight is none of the region's.
        values[1] = 0.0;
        values[2 * STEPS + 1] = bad;
        assert!(sums(&values, &cells()).is_ok(), "{bad}");
    }
}

#[test]
fn histograms_hold_the_weight_of_every_value_in_their_range() {
    let (values, cells) = (values(), cells());
    let all = Buckets::new(0, u32::MAX, 12);
    let positive = Buckets::new(crate::reduce::order::number_of(1e-12), u32::MAX, 8);
    let targets = [
        Target {
            step: 0,
            ranges: vec![(0, 2)],
        },
        Target {
            step: 2,
            ranges: vec![(0, 3), (1, 1)],
        },
    ];
    let mut out = Histograms::default();
    let ranges = [all, positive];
    add_weights(block(&values), &cells, &targets, &ranges, &mut out).unwrap();
    let weight = |step: usize, is_in: &dyn Fn(f32) -> bool| -> i128 {
        let at = |cell: usize| values[cell * STEPS + 1 + step];
        let own = (0..cells.len()).filter(|cell| is_in(at(*cell)));
        own.map(|cell| i128::from(cells[cell].weight)).sum()
    };
    let there = |value: f32| !value.is_nan();
    let expected = 2 * weight(0, &there) + 3 * weight(2, &there);
    assert_eq!(out.of(0).iter().sum::<i128>(), expected);
    let expected = weight(2, &|value| value >= 1e-12);
    assert!(expected > 0);
    assert_eq!(out.of(1).iter().sum::<i128>(), expected);
}
