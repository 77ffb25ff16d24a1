//! How long each form of filling takes on a device: sizes and forms in, seconds with a check of the answers out.

use std::time::{Duration, Instant};

use contract::digest::Digest;
use contract::grid::Grid;
use render::RenderError;
use render::gpu::Gpu;
use render::stages::fill::scaled::holds;
use render::stages::fill::{self, Fill, Filled, Form, Prepared, Task};

use super::all_pairs;
use super::hold_out::{HoldOut, Score};

/// Work is repeated within one submission until that takes so long: what a submission costs itself then hardly shows.
const LEAST_SUBMISSION: Duration = Duration::from_millis(20);
/// Most repetitions within one submission.
const MOST_REPEATS: u32 = 32;
/// Gaps compared with the float64 reference.
const CHECKED: usize = 48;

/// What is filled: a made-up sea of 1/60 degree south of 41 N, blocks of it hidden.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    pub rows: u32,
    pub cols: u32,
    /// What is missing, and in blocks of which side.
    pub missing: HoldOut,
}

/// What one form took.
#[derive(Debug, Clone)]
pub struct Timing {
    pub form: Form,
    pub case: Case,
    /// Cells missing.
    pub gaps: usize,
    /// Seconds of each run of the whole field, shortest first: on the device, without upload and read-back.
    pub seconds: Vec<f64>,
    /// Largest difference from all pairs in float64 among some gaps, as a share of the values' range; none without gaps.
    pub from_all_pairs: Option<f64>,
    /// The filled values, so that two devices can be compared: equal bits, equal digests. None without gaps.
    pub values_digest: Option<Digest>,
    /// Against the values that were hidden, in units of their standard deviation.
    pub rmse_of_hidden: Option<f64>,
}

impl Timing {
    /// The run in the middle, seconds.
    pub fn median_s(&self) -> f64 {
        self.seconds[self.seconds.len() / 2]
    }
}

impl Case {
    /// The grid.
    pub fn grid(&self) -> Grid {
        let step = 1.0 / 60.0;
        Grid {
            rows: self.rows,
            cols: self.cols,
            north_deg: 41.0,
            west_deg: 100.0,
            dlat_deg: step,
            dlon_deg: step,
        }
    }

    /// Waves of many lengths.
    fn truth(&self) -> Vec<f32> {
        let value = |row: u32, col: u32| {
            let (y, x) = (f64::from(row), f64::from(col));
            let long = (y / 173.0).sin() + (x / 211.0 + y / 407.0).cos();
            let short = 0.3 * ((x + 2.0 * y) / 37.0).sin() + 0.1 * ((3.0 * x - y) / 11.0).cos();
            (long + short) as f32
        };
        (0..self.rows)
            .flat_map(|row| (0..self.cols).map(move |col| value(row, col)))
            .collect()
    }
}

/// A case's field, and what was hidden of it.
struct Made {
    grid: Grid,
    truth: Vec<f32>,
    values: Vec<f32>,
    hidden: Vec<usize>,
    domain: Vec<u32>,
}

impl Made {
    fn of(case: &Case) -> Self {
        let truth = case.truth();
        let (values, hidden) = case.missing.hide(&truth, case.cols);
        let domain = vec![1; values.len()];
        Self {
            grid: case.grid(),
            truth,
            values,
            hidden,
            domain,
        }
    }

    fn timing(&self, case: Case, form: Form) -> Timing {
        Timing {
            form,
            case,
            gaps: self.hidden.len(),
            seconds: vec![0.0],
            from_all_pairs: None,
            values_digest: None,
            rmse_of_hidden: None,
        }
    }

    fn check(&self, filled: &Filled, timing: &mut Timing) {
        let score = Score::of(&self.truth, &filled.values, &filled.errors, &self.hidden);
        timing.rmse_of_hidden = score
            .rmse()
            .zip(score.spread())
            .map(|(rmse, spread)| rmse / spread);
        timing.values_digest = Some(Digest::of(bytemuck::cast_slice(&filled.values)));
        timing.from_all_pairs = Some(self.distance_to_all_pairs(&filled.values));
    }

    fn distance_to_all_pairs(&self, filled: &[f32]) -> f64 {
        let step = self.hidden.len().div_ceil(CHECKED).max(1);
        let some: Vec<usize> = self.hidden.iter().copied().step_by(step).collect();
        let held = self
            .values
            .iter()
            .filter(|value| holds(**value))
            .map(|value| f64::from(*value));
        let (low, high) = held.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        let answers = all_pairs::answers_at(&self.grid, &self.values, &some);
        let apart = some
            .iter()
            .zip(answers)
            .map(|(cell, answer)| (f64::from(filled[*cell]) - answer).abs());
        apart.fold(0.0, f64::max) / (high - low)
    }
}

/// Fills one case with the twin of one form `runs` times, or fewer if that takes longer than `limit`.
pub fn bench_twin(
    case: Case,
    form: Form,
    runs: usize,
    limit: Duration,
) -> Result<Timing, RenderError> {
    let made = Made::of(&case);
    let mut timing = made.timing(case, form);
    timing.seconds.clear();
    let started = Instant::now();
    while timing.seconds.is_empty() || (timing.seconds.len() < runs && started.elapsed() < limit) {
        let run = Instant::now();
        let filled = fill::on_cpu(form, &made.grid, &made.values, &made.domain)?;
        timing.seconds.push(run.elapsed().as_secs_f64());
        if timing.values_digest.is_none() {
            made.check(&filled, &mut timing);
        }
    }
    timing.seconds.sort_by(f64::total_cmp);
    Ok(timing)
}

/// Fills one case with one form `runs` times, or fewer if that takes longer than `limit`.
pub fn bench_fill(
    gpu: &Gpu,
    fill: &Fill,
    case: Case,
    form: Form,
    runs: usize,
    limit: Duration,
) -> Result<Timing, RenderError> {
    let started = Instant::now();
    let made = Made::of(&case);
    let mut timing = made.timing(case, form);
    let Some(task) = Task::of(&made.values, &made.domain) else {
        return Ok(timing);
    };
    let prepared = fill.prepared(gpu, form, &made.grid, &task)?;
    // The first run also clears buffers and warms the device up.
    submitted(gpu, &prepared, 1)?;
    let once = submitted(gpu, &prepared, 1)?;
    let repeats = (LEAST_SUBMISSION.as_secs_f64() / once.as_secs_f64())
        .clamp(1.0, f64::from(MOST_REPEATS)) as u32;
    timing.seconds.clear();
    while timing.seconds.is_empty() || (timing.seconds.len() < runs && started.elapsed() < limit) {
        let took = submitted(gpu, &prepared, repeats)?;
        timing.seconds.push(took.as_secs_f64() / f64::from(repeats));
    }
    timing.seconds.sort_by(f64::total_cmp);
    let answers = gpu
        .recorder()
        .download(prepared.answers(), 2 * made.values.len())?;
    made.check(&task.filled(&made.values, &answers), &mut timing);
    Ok(timing)
}

fn submitted(gpu: &Gpu, prepared: &Prepared<'_>, repeats: u32) -> Result<Duration, RenderError> {
    let mut recorder = gpu.recorder();
    for _ in 0..repeats {
        prepared.record(&mut recorder);
    }
    let started = Instant::now();
    // A few bytes come back, so that the end of the work is known.
    let _: Vec<f32> = recorder.download(prepared.answers(), 1)?;
    Ok(started.elapsed())
}

/// The cases of the table: up to `largest` rows and columns, small ones first, a share of the cells missing in blocks.
pub fn cases(largest: [u32; 2], share: f64) -> Vec<Case> {
    let [rows, cols] = largest;
    let case = |part: u32, side_cells: u32| Case {
        rows: rows.div_ceil(part).max(1),
        cols: cols.div_ceil(part).max(1),
        missing: HoldOut {
            share,
            side_cells,
            seed: 1,
        },
    };
    vec![
        case(16, 1),
        case(16, 32),
        case(4, 1),
        case(4, 32),
        case(1, 1),
        case(1, 32),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_grow_up_to_the_largest() {
        let cases = cases([2460, 1800], 0.2);
        let cells = |case: &Case| u64::from(case.rows) * u64::from(case.cols);
        assert!(
            cases
                .windows(2)
                .all(|pair| cells(&pair[0]) <= cells(&pair[1]))
        );
        assert_eq!(
            cases.last().map(|case| (case.rows, case.cols)),
            Some((2460, 1800))
        );
    }
}
