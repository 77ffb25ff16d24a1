//! Steps and edges of an axis as they follow from its labels in; the round numbers that they stand for out, as far as the labels leave room
//! for these: labels that are off by nothing say where their cells are.

use contract::grid::Grid;

use super::single::are_single;

/// Edges and steps closer than this (in cells) to a round fraction of a degree may be taken to be that. Labels that are farther from
/// their places are told of.
pub(super) const SNAP_CELLS: f64 = 2e-3;
/// A longitude axis that misses the whole turn by less than this (in cells) was meant to make one: labels of single
/// precision that were summed up drift so far.
const TURN_CELLS: f64 = 0.05;
/// Noise of the double precision that labels were worked out in, degrees: 0.1 mm.
const NOISE_DEG: f64 = 1e-9;
/// The same of what is written with so few digits that these are counted.
const DIGIT_NOISE: f64 = 1e-10;
/// Most decimals that are counted.
const MOST_DECIMALS: i32 = 8;
/// How many fractions of one denominator may be expected within the last digit of a step by chance, for one that lies there to be meant.
const CHANCE: f64 = 0.1;

/// How far the labels of an axis leave open where its cells are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slack {
    /// How far an edge may be off, degrees.
    pub(super) edge_deg: f64,
    /// How far the step may lead astray over all of the axis, degrees.
    drift_deg: f64,
    /// Half of the last digit that the step is written with, degrees; 0 where it has many.
    half_digit: f64,
}

impl Slack {
    /// Nothing says how exact labels are.
    pub(super) const UNKNOWN: Self = Self {
        edge_deg: f64::INFINITY,
        drift_deg: f64::INFINITY,
        half_digit: 0.0,
    };

    /// That of labels, degrees, which are off by so much from even places `step_deg` apart: a label that was rounded stands as
    /// unevenly as it was rounded. Steps and offsets that labels are worked out with are of single precision at times.
    pub(super) fn of(labels: &[f64], step_deg: f64, uneven_deg: f64) -> Self {
        // The width of one cell alone is told beside its label, and what it is off by would count as often as it goes into the way from 0.
        if labels.len() == 1 {
            return Self {
                edge_deg: DIGIT_NOISE,
                drift_deg: DIGIT_NOISE,
                half_digit: 0.0,
            };
        }
        let farthest = labels
            .iter()
            .fold(0.0, |most: f64, label| most.max(label.abs()));
        let rounding_deg = 0.5 * f64::from(f32::EPSILON) * farthest + NOISE_DEG;
        // The even places begin and end at labels that may be off themselves.
        let off_deg = rounding_deg.max(2.0 * uneven_deg);
        // Labels that were summed up in single precision may be rounded the same way at every step.
        let summed_deg = if are_single(labels) {
            labels.len() as f64 * rounding_deg
        } else {
            0.0
        };
        Self {
            edge_deg: off_deg.max(half_digit(labels)),
            drift_deg: summed_deg.max(2.0 * off_deg),
            half_digit: half_digit(&[step_deg]),
        }
    }
}

/// Half of the last digit of numbers of few decimals; 0 of others.
fn half_digit(numbers: &[f64]) -> f64 {
    let has_all = |unit: &f64| {
        let off = |number: &f64| (number - (number * unit).round() / unit).abs();
        numbers.iter().all(|number| off(number) < DIGIT_NOISE)
    };
    let mut units = (0..=MOST_DECIMALS).map(|digits| 10_f64.powi(digits));
    let unit = units.find(has_all);
    unit.map_or(0.0, |unit| 0.5 / unit + DIGIT_NOISE)
}

/// A step (positive) of so many labels as the round fraction (1/60) or multiple (2.5) of a degree it was meant to be, if it is close to one.
pub(super) fn snapped_step(step: f64, count: u32, slack: Slack) -> f64 {
    for denominator in [
        1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 20.0, 24.0, 60.0, 100.0, 120.0,
    ] {
        let numerator = (step * denominator).round();
        let round = numerator / denominator;
        let off_deg = (step - round).abs();
        let is_its_digits =
            off_deg <= slack.half_digit && 2.0 * slack.half_digit * denominator < CHANCE;
        let is_open = is_its_digits || off_deg * f64::from(count) <= slack.drift_deg;
        // Over the whole axis the round step may not drift by more than this.
        if numerator >= 1.0 && is_open && (step / round - 1.0).abs() * f64::from(count) < SNAP_CELLS
        {
            return round;
        }
    }
    step
}

/// A step of longitudes: the part of a turn that it was meant to be, if it is close to one.
pub(super) fn closed_step(step: f64, count: u32, slack: Slack) -> f64 {
    let missed = (step * f64::from(count) - 360.0).abs();
    if missed < TURN_CELLS * step {
        return 360.0 / f64::from(count);
    }
    snapped_step(step, count, slack)
}

/// An edge as the multiple of half a cell it was meant to be, if it is close to one and may be off by so much.
pub(super) fn snapped_edge(edge: f64, step: f64, slack_deg: f64) -> f64 {
    let halves = (edge / step * 2.0).round();
    let round = halves * step / 2.0;
    let is_close = (edge / step * 2.0 - halves).abs() < 2.0 * SNAP_CELLS;
    if is_close && (round - edge).abs() <= slack_deg {
        round
    } else {
        edge
    }
}

/// A grid as its labels, which are the middles of its cells, made it before they were taken at their word: products that landed then lie so.
pub(crate) fn evened(grid: &Grid) -> Grid {
    let dlat_deg = snapped_step(grid.dlat_deg, grid.rows, Slack::UNKNOWN);
    let dlon_deg = closed_step(grid.dlon_deg, grid.cols, Slack::UNKNOWN);
    let northernmost = grid.north_deg - 0.5 * grid.dlat_deg;
    let westernmost = grid.west_deg + 0.5 * grid.dlon_deg;
    let edge = |edge: f64, step: f64| snapped_edge(edge, step, f64::INFINITY);
    let west_deg = edge(westernmost - 0.5 * dlon_deg, dlon_deg);
    Grid {
        north_deg: edge(northernmost + 0.5 * dlat_deg, dlat_deg),
        west_deg: if west_deg >= 180.0 {
            west_deg - 360.0
        } else {
            west_deg
        },
        dlat_deg,
        dlon_deg,
        ..*grid
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these numbers are exact")]
mod tests {
    use super::*;

    /// The step of even labels from 10 degrees on, as it is taken.
    fn taken(step: f64, count: u32) -> f64 {
        let labels: Vec<f64> = (0..count).map(|at| 10.0 + step * f64::from(at)).collect();
        snapped_step(step, count, Slack::of(&labels, step, 0.0))
    }

    #[test]
    fn steps_of_few_digits_are_the_fractions_that_they_stand_for_and_others_what_they_say() {
        for (step, count, wanted) in [
            (0.25, 720, 0.25),
            (0.33333, 100, 1.0 / 3.0),
            (0.0833333, 2160, 1.0 / 12.0),
            (f64::from(0.05_f32), 3600, 0.05),
            // A seventh of the way from pole to pole, with all digits, with five, and with as many as any fraction has.
            (180.0 / 7.0, 7, 180.0 / 7.0),
            (25.71429, 7, 25.71429),
            (25.71, 7, 25.71),
            // A thousandth more than a quarter, over few cells.
            (0.2501, 4, 0.2501),
        ] {
            assert_eq!(taken(step, count), wanted, "{step}");
        }
    }

    #[test]
    fn steps_that_were_summed_up_in_single_precision_are_the_fractions_that_they_stand_for() {
        let summed = |first: f32, step: f32, count: u32| {
            let mut next = first;
            let labels = (0..count).map(|_| {
                let label = next;
                next += step;
                f64::from(label)
            });
            let labels: Vec<f64> = labels.collect();
            let fitted = (labels[labels.len() - 1] - labels[0]) / f64::from(count - 1);
            snapped_step(fitted, count, Slack::of(&labels, fitted, 0.0))
        };
        assert_eq!(summed(-73.41, 0.05, 20), 0.05);
        assert_eq!(summed(-26.74, 1.0 / 60.0, 100), 1.0 / 60.0);
        // Exact in single precision.
        assert_eq!(summed(-40.0, 20.015_625, 5), 20.015_625);
    }

    #[test]
    fn edges_are_moved_by_no_more_than_their_labels_leave_open() {
        // A thousandth of a cell from 5 degrees on.
        assert_eq!(snapped_edge(5.0025, 2.5, 1e-3), 5.0025);
        assert_eq!(snapped_edge(5.0025, 2.5, 0.01), 5.0);
        assert_eq!(snapped_edge(5.025, 2.5, 1.0), 5.025);
        let exact = Slack::of(&[6.2525, 8.7525, 11.2525], 2.5, 0.0);
        assert!((1e-9..1e-3).contains(&exact.edge_deg), "{exact:?}");
    }

    #[test]
    fn a_grid_is_evened_as_it_was_before_labels_were_taken_at_their_word() {
        let exact = Grid {
            rows: 7,
            cols: 36,
            north_deg: 90.0,
            west_deg: 179.998,
            dlat_deg: 180.0 / 7.0,
            dlon_deg: 2.5,
        };
        let old = evened(&exact);
        assert_eq!((old.west_deg, old.dlon_deg), (-180.0, 2.5));
        assert_eq!(old.dlat_deg, 617.0 / 24.0);
        assert!((0.02..0.03).contains(&(90.0 - old.north_deg)), "{old:?}");
        assert_eq!(evened(&old), old);
    }
}
