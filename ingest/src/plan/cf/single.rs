//! Labels of single precision to the even axis that they stand for: 20.1 is stored as 20.10000038.

/// How many numbers of so many parts of a degree may be expected between two by chance alone, for one that lies there to be meant.
const CHANCE: f64 = 0.2;
/// Most parts of a degree that a step or a place is: seconds of arc.
const MOST_PARTS: u32 = 3600;
/// Most decimals that one is written with: a metre.
const MOST_DECIMALS: i32 = 5;
/// Noise of the double precision that labels were worked out in, degrees: 0.1 mm.
const NOISE_DEG: f64 = 1e-9;
/// The lowest bits of a number of double precision that those of single precision, and halves of their sums, do not use.
const UNUSED_BITS: u32 = 27;

/// First place and step, degrees, of the even axis that labels of single precision stand for: numbers of few parts of a degree, or
/// of few decimals, that lie within the rounding of every label. None where there are no such numbers, and of labels of double precision.
///
/// - `labels`: as the file has them
/// - `places`: the same without jumps by a turn, at least two
/// - `fitted_deg`: the step from the first of these to the last, signed; not 0
/// - `round_deg`: the step where it is known, signed
pub(super) fn meant(
    labels: &[f64],
    places: &[f64],
    fitted_deg: f64,
    round_deg: Option<f64>,
) -> Option<[f64; 2]> {
    if !are_single(labels) {
        return None;
    }
    // Each label may be rounded by itself, or worked out in single precision from numbers as large as the largest.
    let farthest = labels
        .iter()
        .fold(0.0, |most: f64, label| most.max(label.abs()));
    let own: Vec<f64> = labels.iter().map(|label| half_unit(*label)).collect();
    let worked_out = vec![f64::from(f32::EPSILON) * farthest; labels.len()];
    [own, worked_out].into_iter().find_map(|rounding_deg| {
        let rounded = Rounded {
            places,
            rounding_deg,
        };
        rounded.meant(fitted_deg, round_deg)
    })
}

/// Places that are known but for their rounding.
struct Rounded<'a> {
    places: &'a [f64],
    /// How far each may be off, degrees.
    rounding_deg: Vec<f64>,
}

impl Rounded<'_> {
    fn meant(&self, fitted_deg: f64, round_deg: Option<f64>) -> Option<[f64; 2]> {
        let step = match round_deg {
            Some(step) => step,
            None => self.step(fitted_deg)?,
        };
        let firsts = self.firsts(step)?;
        let half = 0.5 * step;
        // What is round may be the middle of a cell or its edge.
        let middle = round_numbers(firsts).next();
        let edge = round_numbers(firsts.map(|first| first - half)).next();
        let first = match (middle, edge) {
            (Some((middle, parts)), Some((_, of_edge))) if parts <= of_edge => middle,
            (_, Some((edge, _))) => edge + half,
            (Some((middle, _)), None) => middle,
            (None, None) => return None,
        };
        Some([first, step])
    }

    /// The roundest step that all places allow.
    fn step(&self, fitted_deg: f64) -> Option<f64> {
        let [first, last] = [self.rounding_deg.first()?, self.rounding_deg.last()?];
        let reach_deg = (first + last) / (self.places.len() - 1) as f64;
        if reach_deg >= fitted_deg.abs() {
            return None;
        }
        let mut steps = round_numbers([fitted_deg - reach_deg, fitted_deg + reach_deg]);
        let found = steps.find(|(step, _)| self.firsts(*step).is_some());
        found.map(|(step, _)| step)
    }

    /// The least and the greatest first place that all places allow with a step.
    fn firsts(&self, step: f64) -> Option<[f64; 2]> {
        let places = self.places.iter().zip(&self.rounding_deg).enumerate();
        let [low, high] = places.fold(
            [f64::NEG_INFINITY, f64::INFINITY],
            |[low, high], (index, (place, rounding_deg))| {
                let first = place - step * index as f64;
                [
                    low.max(first - rounding_deg),
                    high.min(first + rounding_deg),
                ]
            },
        );
        (low <= high).then_some([low, high])
    }
}

/// Numbers of few parts of a degree between two, those of the fewest first, each with its parts; none that may lie there by chance.
fn round_numbers([low, high]: [f64; 2]) -> impl Iterator<Item = (f64, f64)> {
    let (width, middle) = (high - low, f64::midpoint(low, high));
    // Of fractions there are about as many below 1 as the square of the most parts.
    let fractions = (1..=MOST_PARTS)
        .map(f64::from)
        .take_while(move |parts| parts * parts * width < CHANCE);
    let decimals = (1..=MOST_DECIMALS)
        .map(|digits| 10_f64.powi(digits))
        .take_while(move |parts| parts * width < CHANCE);
    let numbers = fractions.chain(decimals);
    let numbers = numbers.map(move |parts| ((middle * parts).round() / parts, parts));
    numbers.filter(move |(number, _)| (low..=high).contains(number))
}

/// Are labels of single precision, or half-way between two such numbers?
pub(super) fn are_single(labels: &[f64]) -> bool {
    labels.iter().all(|label| is_single(*label))
}

/// Is it a number of single precision, or half of the sum of two?
fn is_single(label: f64) -> bool {
    label.to_bits().trailing_zeros() >= UNUSED_BITS
}

/// How far a number may be from the one of single precision that it is stored as.
fn half_unit(label: f64) -> f64 {
    let single = label.abs() as f32;
    0.5 * (f64::from(single.next_up()) - f64::from(single)) + NOISE_DEG
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Labels as they are stored in single precision.
    fn stored(first: f64, step: f64, count: u32) -> Vec<f64> {
        let label = |index: u32| f64::from((first + step * f64::from(index)) as f32);
        (0..count).map(label).collect()
    }

    fn meant_by(labels: &[f64]) -> Option<[f64; 2]> {
        let gaps = (labels.len() - 1) as f64;
        let fitted_deg = (labels[labels.len() - 1] - labels[0]) / gaps;
        meant(labels, labels, fitted_deg, None)
    }

    #[track_caller]
    fn assert_near(found: Option<[f64; 2]>, wanted: [f64; 2]) {
        let found = found.unwrap_or([f64::NAN; 2]);
        let is_near = |at: usize| (found[at] - wanted[at]).abs() < 1e-12;
        assert!(is_near(0) && is_near(1), "{found:?} {wanted:?}");
    }

    #[test]
    fn numbers_that_were_rounded_are_found() {
        for (first, step) in [
            (20.1, 0.25),
            (100.1, 0.25),
            (-179.95, 0.1),
            (12.34, 0.07),
            (-33.3, -0.05),
            (45.0 / 2048.0, 45.0 / 1024.0),
            (20.0 + 1.0 / 3.0, 1.0 / 12.0),
        ] {
            assert_near(meant_by(&stored(first, step, 40)), [first, step]);
        }
        // Edges at tenths of a degree, and so middles at 1/120.
        let first = 20.1 + 1.0 / 24.0;
        assert_near(
            meant_by(&stored(first, 1.0 / 12.0, 60)),
            [first, 1.0 / 12.0],
        );
    }

    #[test]
    fn places_that_were_worked_out_in_single_precision_are_found() {
        let added: Vec<f64> = (0..100_u16)
            .map(|index| f64::from(20.1_f32 + 0.1_f32 * f32::from(index)))
            .collect();
        assert_near(meant_by(&added), [20.1, 0.1]);
        // From 0 to 360 degrees first, and turned then.
        let turned: Vec<f64> = (0..700_u16)
            .map(|index| {
                let lon = 0.1_f32 + 0.25_f32 * f32::from(index);
                f64::from((lon + 180.0) % 360.0 - 180.0)
            })
            .collect();
        assert_near(meant_by(&turned), [0.1, 0.25]);
    }

    #[test]
    fn middles_between_edges_of_single_precision_are_found() {
        let edges = stored(20.1, 0.25, 41);
        let middles: Vec<f64> = edges
            .windows(2)
            .map(|two| f64::midpoint(two[0], two[1]))
            .collect();
        assert_near(meant_by(&middles), [20.225, 0.25]);
    }

    #[test]
    fn what_is_not_round_or_not_rounded_stays_as_it_is() {
        // As many decimals as single precision does not hold.
        assert_eq!(meant_by(&stored(20.271_828_1, 0.031_415_9, 50)), None);
        // Double precision says what it means.
        let double: Vec<f64> = (0..40)
            .map(|index| f64::from(20.1_f32) + 0.25 * f64::from(index) + 1e-8)
            .collect();
        assert_eq!(meant_by(&double), None);
        // Parts of a degree by powers of two are exact in both.
        let exact: Vec<f64> = (0..50)
            .map(|index| 100.0 + 1.0 / 256.0 + f64::from(index) / 128.0)
            .collect();
        assert_eq!(meant_by(&exact), Some([100.0 + 1.0 / 256.0, 1.0 / 128.0]));
        // One label is off by more than its rounding.
        let mut uneven = stored(20.1, 0.25, 40);
        uneven[7] = f64::from(uneven[7] as f32 + 1e-4);
        assert_eq!(meant_by(&uneven), None);
        // A step that is known, and that these do not have.
        let labels = stored(20.1, 0.25, 40);
        assert_eq!(meant(&labels, &labels, 0.25, Some(0.2501)), None);
    }
}
