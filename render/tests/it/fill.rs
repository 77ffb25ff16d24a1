//! Gap filling: every form against all pairs in float64, the device against the twins bit for bit, and what must hold
//! of filled fields.

use std::borrow::Cow;

use contract::grid::Grid;
use render::stages::fill::scaled::holds;
use render::stages::fill::{self, Fill, Filled, Form, Sources, exact};
use render::stages::layout::{MISSING, is_missing};
use render_proof::fill::all_pairs::answers_at;
use render_proof::fill::hold_out::{HoldOut, Score};

use crate::device::{checked_gpu, gpu};
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE};

/// A sea of 1/60 degree, rows and columns that no power of two divides.
const SEA: Grid = Grid {
    rows: 101,
    cols: 147,
    north_deg: 41.0,
    west_deg: 100.0,
    dlat_deg: 1.0 / 60.0,
    dlon_deg: 1.0 / 60.0,
};

/// A smooth field with a wide gap, small gaps and land, in tiny numbers round a large mean; and the domain.
fn field(grid: &Grid) -> (Vec<f32>, Vec<u32>) {
    let cell = |index: usize| {
        let (row, col) = (index / grid.cols as usize, index % grid.cols as usize);
        let (y, x) = (
            row as f64 / f64::from(grid.rows),
            col as f64 / f64::from(grid.cols),
        );
        let is_land = (x - 0.1).powi(2) + (y - 0.8).powi(2) < 0.02;
        let wide = (x - 0.6).powi(2) + (y - 0.45).powi(2) < 0.06;
        let small = index.is_multiple_of(7) || (row % 13 < 2 && col % 11 < 3);
        let value = 1e-9 * (3.0 + (9.0 * x).sin() + (7.0 * y + 4.0 * x).cos());
        let value = if is_land || wide || small {
            f32::NAN
        } else {
            value as f32
        };
        (value, u32::from(!is_land))
    };
    (0..grid.cell_count()).map(cell).unzip()
}

fn gaps(values: &[f32], domain: &[u32]) -> Vec<usize> {
    (0..values.len())
        .filter(|cell| !holds(values[*cell]) && domain[*cell] != 0)
        .collect()
}

/// Largest difference from all pairs in float64, as a share of the values' range.
fn from_all_pairs(grid: &Grid, values: &[f32], domain: &[u32], filled: &Filled) -> f64 {
    let cells: Vec<usize> = gaps(values, domain).into_iter().step_by(7).collect();
    let held = || values.iter().copied().filter(|value| holds(*value));
    let range = held().fold(f32::MIN, f32::max) - held().fold(f32::MAX, f32::min);
    let answers = answers_at(grid, values, &cells);
    let apart = cells
        .iter()
        .zip(answers)
        .map(|(cell, answer)| (f64::from(filled.values[*cell]) - answer).abs());
    apart.fold(0.0, f64::max) / f64::from(range)
}

#[test]
fn multilevel_summation_gives_the_answer_of_all_pairs_within_its_tolerance() {
    let all_round = Grid {
        rows: 120,
        cols: 240,
        north_deg: 60.0,
        west_deg: -180.0,
        dlat_deg: 1.0,
        dlon_deg: 1.5,
    };
    for grid in [SEA, all_round, FIVE_DEGREES, ONE_DEGREE] {
        let (values, domain) = field(&grid);
        let filled = fill::on_cpu(Form::Exact, &grid, &values, &domain).unwrap();
        let apart = from_all_pairs(&grid, &values, &domain, &filled);
        assert!(apart < f64::from(exact::TOLERANCE), "{apart}");
        let window = fill::on_cpu(Form::Window, &grid, &values, &domain).unwrap();
        let apart = from_all_pairs(&grid, &values, &domain, &window);
        assert!(
            apart > 100.0 * f64::from(exact::TOLERANCE),
            "another form is told apart: {apart}"
        );
        // The same cells at the equator, where they are wider: another place on the sphere would be seen.
        let flat = Grid {
            north_deg: 0.5 * f64::from(grid.rows) * grid.dlat_deg,
            ..grid
        };
        if flat.north_deg < 2.0 {
            let apart = from_all_pairs(&flat, &values, &domain, &filled);
            assert!(apart > 10.0 * f64::from(exact::TOLERANCE), "{apart}");
        }
    }
}

#[test]
fn every_form_has_the_same_bits_on_the_device_and_on_the_processor() {
    let Some(gpu) = gpu("fill forms") else { return };
    let fill = Fill::new(gpu, Sources::default());
    let all_round = Grid {
        rows: 60,
        cols: 180,
        north_deg: 60.0,
        west_deg: -180.0,
        dlat_deg: 2.0,
        dlon_deg: 2.0,
    };
    for grid in [SEA, all_round, FIVE_DEGREES] {
        let (values, domain) = field(&grid);
        for form in Form::ALL {
            let drawn = fill.run(gpu, form, &grid, &values, &domain).unwrap();
            let twin = fill::on_cpu(form, &grid, &values, &domain).unwrap();
            let differ = drawn
                .values
                .iter()
                .zip(&twin.values)
                .filter(|(a, b)| a.to_bits() != b.to_bits())
                .count();
            assert_eq!(differ, 0, "{} on {} rows", form.name(), grid.rows);
            assert!(drawn == twin, "errors of {}", form.name());
        }
    }
}

#[test]
fn a_wrong_shader_of_any_form_is_seen() {
    type Shader = fn(&mut Sources) -> &mut Cow<'static, str>;
    let Some(gpu) = checked_gpu("fill faults") else {
        return;
    };
    let (values, domain) = field(&SEA);
    let (window, exact): (Shader, Shader) = (|all| &mut all.window, |all| &mut all.exact);
    let stencil: Shader = |all| &mut all.stencil;
    let faults = [
        (Form::Window, window, "0.1875, sides", "0.1874, sides"),
        (Form::Window, window, "dy <= 2", "dy <= 1"),
        (Form::Window, stencil, "center + dx", "center - dx"),
        (
            Form::Exact,
            stencil,
            "dx = 0u; dx < span",
            "dx = 1u; dx < span",
        ),
        (Form::Exact, exact, "0.5859375", "0.5859374"),
        (Form::Exact, exact, "at.y % 2u == 0u", "at.y % 2u == 1u"),
    ];
    for (form, shader, right, wrong) in faults {
        let mut sources = Sources::default();
        let shader = shader(&mut sources);
        let faulty = shader.replacen(right, wrong, 1);
        assert_ne!(faulty, **shader, "the fault was planted");
        *shader = faulty.into();
        let fill = Fill::new(gpu, sources);
        let drawn = fill.run(gpu, form, &SEA, &values, &domain).unwrap();
        let twin = fill::on_cpu(form, &SEA, &values, &domain).unwrap();
        assert!(drawn != twin, "{wrong} in {} stays unseen", form.name());
    }
}

#[test]
fn no_gap_stays_empty_however_wide_and_land_stays_land() {
    let grid = Grid {
        rows: 600,
        cols: 500,
        ..SEA
    };
    // Data in one corner only; land in another.
    let mut values = vec![f32::NAN; grid.cell_count()];
    values[0] = 1.0;
    values[1] = 3.0;
    let mut domain = vec![1; values.len()];
    domain[grid.cell_count() - 1] = 0;
    let filled = fill::on_cpu(Form::Window, &grid, &values, &domain).unwrap();
    assert_eq!(filled.values[..2], [1.0, 3.0], "data are left as they are");
    assert_eq!(filled.errors[..2], [0.0, 0.0]);
    assert!(
        is_missing(*filled.values.last().unwrap()) && is_missing(*filled.errors.last().unwrap())
    );
    for (cell, value) in filled
        .values
        .iter()
        .enumerate()
        .skip(2)
        .take(grid.cell_count() - 3)
    {
        assert!((1.0..=3.0).contains(value), "cell {cell}: {value}");
        assert!(filled.errors[cell] > 0.0);
    }
    // Far away only their mean is known, and their spread of 1 is all that may be said of its error.
    let far = grid.cell_count() - 2;
    assert!((filled.values[far] - 2.0).abs() < 0.01 && (filled.errors[far] - 1.0).abs() < 0.01);
}

#[test]
fn a_gap_beside_data_is_the_mean_weighted_by_inverse_squared_distance() {
    // On the equator: 1, gap, land, 4. The gap lies 1 from the 1 and 2 from the 4: (1/1 * 1 + 1/4 * 4) / (1/1 + 1/4) = 1.6.
    let grid = Grid {
        rows: 1,
        cols: 4,
        north_deg: 0.005,
        west_deg: 0.0,
        dlat_deg: 0.01,
        dlon_deg: 0.01,
    };
    let values = [1.0, MISSING, MISSING, 4.0];
    for form in Form::ALL {
        let filled = fill::on_cpu(form, &grid, &values, &[1, 1, 0, 1]).unwrap();
        assert!(
            (filled.values[1] - 1.6).abs() < 1e-6,
            "{}: {}",
            form.name(),
            filled.values[1]
        );
        assert!(is_missing(filled.values[2]), "land stays land");
        assert_eq!((filled.values[0], filled.values[3]), (1.0, 4.0));
        // Weighted variance: (1 * 0.6² + 1/4 * 2.4²) / 1.25 = 1.44.
        assert!(
            (filled.errors[1] - 1.2).abs() < 1e-5,
            "{}: {}",
            form.name(),
            filled.errors[1]
        );
    }
}

#[test]
fn distance_is_measured_on_the_sphere() {
    // At 60 N a degree of longitude is half a degree of latitude: the gap is twice as far from 0 (north) as from 1 (west).
    let grid = Grid {
        rows: 3,
        cols: 3,
        north_deg: 61.5,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };
    let mut values = [MISSING; 9];
    (values[1], values[3]) = (0.0, 1.0);
    let mut domain = [0; 9];
    domain[4] = 1;
    for form in Form::ALL {
        let filled = fill::on_cpu(form, &grid, &values, &domain).unwrap();
        assert!(
            (filled.values[4] - 0.8).abs() < 2e-3,
            "{}: {}",
            form.name(),
            filled.values[4]
        );
    }
    // A grid that goes all the way round has no edge: across the date line lies the next cell.
    let ring = Grid {
        rows: 1,
        cols: 36,
        north_deg: 5.0,
        west_deg: -180.0,
        dlat_deg: 10.0,
        dlon_deg: 10.0,
    };
    let mut values = [MISSING; 36];
    (values[35], values[18]) = (5.0, 1.0);
    let mut domain = [0; 36];
    domain[0] = 1;
    for form in Form::ALL {
        let filled = fill::on_cpu(form, &ring, &values, &domain).unwrap();
        assert!(
            filled.values[0] > 4.9,
            "{}: {}",
            form.name(),
            filled.values[0]
        );
    }
}

#[test]
fn fields_without_data_or_without_gaps_are_left_alone() {
    let grid = Grid {
        rows: 2,
        cols: 2,
        ..SEA
    };
    for form in Form::ALL {
        let empty = fill::on_cpu(
            form,
            &grid,
            &[f32::NAN, f32::INFINITY, MISSING, f32::NAN],
            &[1; 4],
        )
        .unwrap();
        assert!(
            empty
                .values
                .iter()
                .chain(&empty.errors)
                .all(|value| is_missing(*value))
        );
        let full = fill::on_cpu(form, &grid, &[1.0, 2.0, 3.0, 4.0], &[1; 4]).unwrap();
        assert_eq!(
            (full.values, full.errors),
            (vec![1.0, 2.0, 3.0, 4.0], vec![0.0; 4])
        );
        let alike = fill::on_cpu(form, &grid, &[7.25, f32::NAN, 7.25, 7.25], &[1; 4]).unwrap();
        assert_eq!((alike.values[1], alike.errors[1]), (7.25, 0.0));
    }
    // Rows without a domain change nothing, wherever they lie: a climatology has data nowhere near the poles.
    let (values, domain) = field(&FIVE_DEGREES);
    let polar = |cell: usize| !(3..32).contains(&(cell / 72));
    let domain: Vec<u32> = domain
        .iter()
        .enumerate()
        .map(|(cell, domain)| if polar(cell) { 0 } else { *domain })
        .collect();
    let values: Vec<f32> = values
        .iter()
        .enumerate()
        .map(|(cell, value)| if polar(cell) { f32::NAN } else { *value })
        .collect();
    let filled = fill::on_cpu(Form::Exact, &FIVE_DEGREES, &values, &domain).unwrap();
    let apart = from_all_pairs(&FIVE_DEGREES, &values, &domain, &filled);
    assert!(apart < f64::from(exact::TOLERANCE), "{apart}");
}

#[test]
fn hidden_cells_are_filled_better_than_with_their_mean_and_the_error_is_known() {
    let grid = Grid {
        rows: 180,
        cols: 160,
        ..SEA
    };
    let (values, domain) = field(&grid);
    let hold_out = HoldOut {
        share: 0.1,
        side_cells: 4,
        seed: 3,
    };
    let (kept, hidden) = hold_out.hide(&values, grid.cols);
    let filled = fill::on_cpu(Form::Window, &grid, &kept, &domain).unwrap();
    let score = Score::of(&values, &filled.values, &filled.errors, &hidden);
    let (rmse, spread) = (score.rmse().unwrap(), score.spread().unwrap());
    assert_eq!(score.cells, hidden.len() as u64);
    assert!(rmse < 0.15 * spread, "{rmse} of {spread}");
    assert!(score.bias().unwrap().abs() < 0.3 * rmse);
    let share = score.within_two_sigma().unwrap();
    assert!(share > 0.9, "{share} within twice the estimated error");
}
