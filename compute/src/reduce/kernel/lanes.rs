//! Loops over the steps of cells: values in, whole numbers added to sums out. They are compiled for any processor and for those
//! that take four numbers at a time (AVX2) or eight (AVX-512); all add the same integers.

use cube::scale::{Scale, nearest};

use crate::reduce::values::EqualCells;

/// How values become steps of a scale, worked out once.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps {
    zero: f64,
    per_value: f64,
    squares_per_step: f64,
    /// Steps of the largest distance from the zero that can be summed.
    most: f64,
}

impl Steps {
    pub(super) fn of(scale: Scale) -> Self {
        Self {
            zero: scale.zero(),
            per_value: scale.steps_per_value(),
            squares_per_step: Scale::squares_per_step(),
            most: Scale::most_steps(),
        }
    }

    #[expect(
        clippy::inline_always,
        reason = "a part of loops that are compiled several times"
    )]
    #[inline(always)]
    fn distance(self, value: f32) -> f64 {
        (f64::from(value) - self.zero) * self.per_value
    }
}

/// Sums by step, all of one length.
pub(super) struct ByStep<'a> {
    /// Values that are there.
    pub(super) counts: &'a mut [i64],
    /// They, in steps.
    pub(super) steps: &'a mut [i64],
    /// Their squares; nothing where they are not wanted.
    pub(super) squares: &'a mut [i64],
}

/// How many numbers a processor takes at a time.
#[cfg(target_arch = "x86_64")]
#[derive(Debug, Clone, Copy, PartialEq)]
enum Lanes {
    Any,
    /// AVX2.
    Four,
    /// AVX-512 with products of 64 bits.
    Eight,
}

#[cfg(target_arch = "x86_64")]
impl Lanes {
    /// The library asks the processor once.
    fn of_this_processor() -> Self {
        let is_eight = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl");
        match (is_eight, is_x86_feature_detected!("avx2")) {
            (true, _) => Self::Eight,
            (false, true) => Self::Four,
            (false, false) => Self::Any,
        }
    }
}

/// Makes a function of what this processor can run of three compilations of a body that is inlined into each.
macro_rules! by_processor {
    (
        $(#[$said:meta])*
        fn $name:ident($($given:ident: $of:ty),* $(,)?) $(-> $told:ty)? = $any:ident, $avx2:ident, $avx512:ident
    ) => {
        $(#[$said])*
        pub(super) fn $name($($given: $of),*) $(-> $told)? {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "the processor has what it is compiled for")]
            match Lanes::of_this_processor() {
                // SAFETY: the processor was asked.
                Lanes::Eight => return unsafe { $avx512($($given),*) },
                // SAFETY: as above.
                Lanes::Four => return unsafe { $avx2($($given),*) },
                Lanes::Any => {}
            }
            $any($($given),*)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512dq,avx512vl")]
        fn $avx512($($given: $of),*) $(-> $told)? {
            $any($($given),*)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn $avx2($($given: $of),*) $(-> $told)? {
            $any($($given),*)
        }
    };
}

by_processor! {
    /// Adds the values of cells; is one among them that cannot be summed? Then the sums say nothing.
    fn add(cells: EqualCells<'_>, steps: Steps, to: &mut ByStep<'_>) -> bool = add_any, add_avx2, add_avx512
}

/// Steps that are added at once: their sums are in registers while cell after cell comes.
const AT_ONCE: usize = 8;

#[expect(clippy::inline_always, reason = "it is compiled several times")]
#[inline(always)]
fn add_any(cells: EqualCells<'_>, steps: Steps, to: &mut ByStep<'_>) -> bool {
    let (all, mut is_beyond) = (to.counts.len(), false);
    let whole = all - all % AT_ONCE;
    for first in (0..whole).step_by(AT_ONCE) {
        is_beyond |= add_lanes::<AT_ONCE>(cells, steps, first, to);
    }
    for first in whole..all {
        is_beyond |= add_lanes::<1>(cells, steps, first, to);
    }
    is_beyond
}

#[expect(clippy::inline_always, reason = "it is compiled several times")]
#[inline(always)]
fn add_lanes<const N: usize>(
    cells: EqualCells<'_>,
    steps: Steps,
    first: usize,
    to: &mut ByStep<'_>,
) -> bool {
    let (mut counts, mut sums, mut beyond) = ([0; N], [0i64; N], [0; N]);
    for values in cells.lanes::<N>(first) {
        for lane in 0..N {
            let is_there = !values[lane].is_nan();
            let own = steps.distance(values[lane]);
            // Of what is beyond anything physical this is some number.
            sums[lane] = sums[lane].wrapping_add(if is_there { nearest(own) } else { 0 });
            counts[lane] += i64::from(is_there);
            beyond[lane] |= i64::from(own.abs() > steps.most);
        }
    }
    for lane in 0..N {
        to.counts[first + lane] += counts[lane];
        to.steps[first + lane] = to.steps[first + lane].wrapping_add(sums[lane]);
    }
    if !to.squares.is_empty() {
        let mut squares = [0i64; N];
        for values in cells.lanes::<N>(first) {
            for lane in 0..N {
                let own = steps.distance(values[lane]);
                let square = nearest(own * own * steps.squares_per_step);
                let is_there = !values[lane].is_nan();
                squares[lane] = squares[lane].wrapping_add(if is_there { square } else { 0 });
            }
        }
        for (own, square) in to.squares[first..first + N].iter_mut().zip(squares) {
            *own = own.wrapping_add(square);
        }
    }
    beyond.iter().any(|lane| *lane != 0)
}

/// Sums by step times the weights of cells, all of one length.
pub(super) struct Weighed<'a> {
    pub(super) counts: &'a mut [i64],
    pub(super) weights: &'a mut [i64],
    /// What coverage counts besides the weight.
    pub(super) extra: &'a mut [i64],
}

/// What a cell weighs, and what coverage counts besides that.
pub(super) type WeightExtra = [i64; 2];

by_processor! {
    /// Adds how many values there are times what each of them weighs, and what coverage counts besides.
    fn add_counts(counts: &[i64], own: WeightExtra, to: &mut Weighed<'_>) = add_counts_any, add_counts_avx2, add_counts_avx512
}

#[expect(clippy::inline_always, reason = "it is compiled several times")]
#[inline(always)]
fn add_counts_any(counts: &[i64], [weight, extra]: WeightExtra, to: &mut Weighed<'_>) {
    for (own, count) in to.counts.iter_mut().zip(counts) {
        *own += count;
    }
    for (own, count) in to.weights.iter_mut().zip(counts) {
        *own += count * weight;
    }
    if extra != 0 {
        for (own, count) in to.extra.iter_mut().zip(counts) {
            *own += count * extra;
        }
    }
}

/// Bits of a value's steps that are multiplied apart from the others.
pub(super) const LOW_BITS: u32 = 22;
/// Products that fit into 64 bits together: a value is below 2⁴⁵ steps, a weight below 2³⁸.
pub(super) const MOST_PRODUCTS: usize = 4;

/// Sums of products by step, all of one length: their low parts, and their high ones in units of 2²².
pub(super) struct Products<'a> {
    pub(super) low: &'a mut [i64],
    pub(super) high: &'a mut [i64],
}

by_processor! {
    /// Adds the values of one cell times its weight; is one among them that cannot be summed? Then the sums say nothing.
    fn add_products(
        values: &[f32],
        steps: Steps,
        own: WeightExtra,
        to: (&mut Weighed<'_>, &mut Products<'_>),
    ) -> bool = add_products_any, add_products_avx2, add_products_avx512
}

#[expect(clippy::inline_always, reason = "it is compiled several times")]
#[inline(always)]
fn add_products_any(
    values: &[f32],
    steps: Steps,
    [weight, extra]: WeightExtra,
    (weighed, products): (&mut Weighed<'_>, &mut Products<'_>),
) -> bool {
    let mut beyond = 0;
    let sums = products.low.iter_mut().zip(&mut *products.high);
    for ((low, high), value) in sums.zip(values) {
        let distance = steps.distance(*value);
        // Of what is beyond anything physical this is some number.
        let own = if value.is_nan() { 0 } else { nearest(distance) };
        *low = low.wrapping_add((own & ((1 << LOW_BITS) - 1)).wrapping_mul(weight));
        *high = high.wrapping_add((own >> LOW_BITS).wrapping_mul(weight));
        beyond |= i64::from(distance.abs() > steps.most);
    }
    for ((count, sum), value) in weighed
        .counts
        .iter_mut()
        .zip(&mut *weighed.weights)
        .zip(values)
    {
        let is_there = !value.is_nan();
        *count += i64::from(is_there);
        *sum += if is_there { weight } else { 0 };
    }
    if extra != 0 {
        for (sum, value) in weighed.extra.iter_mut().zip(values) {
            *sum += if value.is_nan() { 0 } else { extra };
        }
    }
    beyond != 0
}

#[cfg(test)]
mod tests {
    use contract::quantity::Quantity;

    use super::*;

    type Add = dyn Fn(EqualCells<'_>, Steps, &mut ByStep<'_>) -> bool;

    fn one_cell(values: &[f32]) -> EqualCells<'_> {
        EqualCells {
            of: values,
            stride: values.len(),
            count: 1,
        }
    }

    /// Those that this processor can run.
    fn compilations() -> Vec<&'static Add> {
        let mut all: Vec<&Add> = vec![&add, &add_any];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            #[expect(unsafe_code, reason = "the processor was asked")]
            // SAFETY: the line before.
            all.push(&|cells, steps, to| unsafe { add_avx2(cells, steps, to) });
        }
        all
    }

    #[test]
    fn cells_that_are_added_together_add_what_they_would_one_by_one() {
        let scale = Scale::of(Quantity::CarbonFlux).unwrap();
        let steps = Steps::of(scale);
        for (stride, length, count) in [(128, 128, 8), (128, 53, 3), (20, 13, 1), (9, 1, 5)] {
            let value = |at: usize| match at % 5 {
                2 => f32::NAN,
                part => (part as f32 - 1.5) * 1e-9 * (at % 17) as f32,
            };
            let all: Vec<f32> = (0..stride * count).map(value).collect();
            let sums = |parts: &[EqualCells<'_>], add: &Add| {
                let mut own = [vec![1; length], vec![2; length], vec![3; length]];
                let [counts, steps_, squares] = &mut own;
                let mut to = ByStep {
                    counts,
                    steps: steps_,
                    squares,
                };
                for part in parts {
                    assert!(!add(*part, steps, &mut to));
                }
                own
            };
            let cells = |first: usize, count: usize| EqualCells {
                of: &all[first * stride..],
                stride,
                count,
            };
            let each: Vec<EqualCells<'_>> = (0..count).map(|cell| cells(cell, 1)).collect();
            let expected = sums(&each, &add_any);
            for compiled in compilations() {
                assert_eq!(sums(&[cells(0, count)], compiled), expected);
            }
        }
    }

    /// The heaviest cell that there is, and less of it for coverage.
    const OWN: WeightExtra = [(1 << 38) - 1, -(1 << 37)];

    /// Each compilation's products of the same values, as often as they fit: what was beyond, counts, weights, extra, low and high.
    fn products_of(values: &[f32], steps: Steps) -> Vec<(bool, [Vec<i64>; 5])> {
        type Add = dyn Fn(&[f32], Steps, (&mut Weighed<'_>, &mut Products<'_>)) -> bool;
        let mut all: Vec<&Add> = vec![
            &|values, steps, to| add_products(values, steps, OWN, to),
            &|values, steps, to| add_products_any(values, steps, OWN, to),
        ];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            #[expect(unsafe_code, reason = "the processor was asked")]
            // SAFETY: the line before.
            all.push(&|values, steps, to| unsafe { add_products_avx2(values, steps, OWN, to) });
        }
        let of = |add: &&Add| {
            let mut sums: [Vec<i64>; 5] = std::array::from_fn(|_| vec![0; values.len()]);
            let mut is_beyond = false;
            for _ in 0..MOST_PRODUCTS {
                let [counts, weights, extra, low, high] = &mut sums;
                let mut weighed = Weighed {
                    counts,
                    weights,
                    extra,
                };
                let mut products = Products { low, high };
                is_beyond |= add(values, steps, (&mut weighed, &mut products));
            }
            (is_beyond, sums)
        };
        all.iter().map(of).collect()
    }

    #[test]
    fn all_compilations_add_the_same_integers() {
        for quantity in [Quantity::CarbonFlux, Quantity::SeaSurfaceTemperature] {
            let scale = Scale::of(quantity).unwrap();
            let (low, high) = quantity.plausible().into_inner();
            for count in [0, 1, 3, 4, 7, 128] {
                let value = |at: usize| match at * 7919 % 11 {
                    3 => f32::NAN,
                    part => (low + (high - low) * part as f64 / 11.0) as f32,
                };
                let mut values: Vec<f32> = (0..count).map(value).collect();
                let of = |add: &Add, values: &[f32]| {
                    let mut all = [vec![3; count], vec![-5; count], vec![9; count]];
                    let [counts, steps, squares] = &mut all;
                    let mut to = ByStep {
                        counts,
                        steps,
                        squares,
                    };
                    let is_beyond = add(one_cell(values), Steps::of(scale), &mut to);
                    (is_beyond, all)
                };
                let found = of(&add_any, &values);
                for compiled in compilations() {
                    assert_eq!(found, of(compiled, &values));
                }
                assert!(!found.0);
                for (at, value) in values.iter().enumerate() {
                    let is_there = !value.is_nan();
                    let steps = if is_there { scale.steps(*value) } else { 0 };
                    let square = if is_there {
                        scale.square_steps(*value)
                    } else {
                        0
                    };
                    let own = found.1.each_ref().map(|own| own[at]);
                    assert_eq!(own, [3 + i64::from(is_there), steps - 5, square + 9]);
                }
                let products = products_of(&values, Steps::of(scale));
                for (compiled, lanes) in products.iter().enumerate() {
                    assert_eq!(lanes, &products[0], "compilation {compiled}");
                }
                for (at, value) in values.iter().enumerate() {
                    let is_there = i64::from(!value.is_nan());
                    let steps = is_there * if is_there > 0 { scale.steps(*value) } else { 0 };
                    let [counts, weights, extra, low, high] = &products[0].1;
                    let sum = i128::from(low[at]) + (i128::from(high[at]) << LOW_BITS);
                    assert_eq!(sum, 4 * i128::from(steps) * i128::from(OWN[0]));
                    let found = [counts[at], weights[at], extra[at]];
                    let once = [1, OWN[0], OWN[1]];
                    assert_eq!(found, once.map(|one| 4 * is_there * one));
                }
                for bad in [
                    f32::INFINITY,
                    f32::NEG_INFINITY,
                    3.0 * high.abs().max(1.0) as f32 * 1e6,
                ] {
                    if let Some(last) = values.last_mut() {
                        *last = bad;
                        for compiled in compilations() {
                            assert!(of(compiled, &values).0, "{bad}");
                        }
                        for (is_beyond, _) in products_of(&values, Steps::of(scale)) {
                            assert!(is_beyond, "{bad}");
                        }
                    }
                }
            }
        }
    }
}
