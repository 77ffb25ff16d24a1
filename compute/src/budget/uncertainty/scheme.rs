//! How the sum over pairs is taken so that it ends: of cells, or where these are too many of blocks of them.

use contract::grid::Grid;

use super::pairs::transform_size;
use super::plane::Window;
use crate::ComputeError;

/// Work of one question, ns of one processor: some 20 seconds.
const MOST_WORK_NS: f64 = 2e10;
/// One number of the table of two rows, and its share of a transform.
const KERNEL_NS: f64 = 45.0;
/// The same number times those of one form.
const FORM_NS: f64 = 2.0;
/// Transformed forms that are held at a time, bytes.
const HELD_BYTES: usize = 128 << 20;
/// Longest side of a block, cells.
const MAX_BLOCK: usize = 120;
/// A correlation length must hold so many blocks.
const BLOCKS_IN_LENGTH: f64 = 2.0;

/// Blocks of a region that sums are taken of.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scheme {
    pub(super) window: Window,
    /// Forms that are summed at a time: the same on any machine, since it is part of what the bits follow from.
    pub(super) at_once: usize,
    /// For people.
    pub(super) words: String,
}

impl Scheme {
    /// The one with the smallest blocks that ends in time, for so many forms.
    ///
    /// # Errors
    /// `Uncertainty` where blocks would be longer than errors go together.
    pub(super) fn of(
        grid: &Grid,
        window: &Window,
        length_km: f64,
        form_count: usize,
    ) -> Result<Self, ComputeError> {
        if length_km <= 0.0 {
            return Ok(Self {
                window: window.clone(),
                at_once: 1,
                words: "each cell by itself: its error is its own".to_owned(),
            });
        }
        let windows = (1..=MAX_BLOCK).filter_map(|block| window.with_blocks(block));
        let found = windows
            .map(|window| (cost(grid, &window, form_count), window))
            .find(|((work_ns, _), _)| *work_ns <= MOST_WORK_NS);
        let Some(((_, at_once), window)) = found else {
            return Err(ComputeError::Uncertainty {
                reason: "the region has too many cells and steps: ask for a smaller one, a shorter period, or a coarser grid \
                         (fluxglobe derive regrid)"
                    .to_owned(),
            });
        };
        let (rows, cols) = window.size();
        if window.block == 1 {
            let words =
                format!("all pairs of {rows} x {cols} cells, by Fourier transforms of rows");
            return Ok(Self {
                window,
                at_once,
                words,
            });
        }
        let (block, block_km) = (window.block, window.block_km(grid));
        if length_km < BLOCKS_IN_LENGTH * block_km {
            return Err(ComputeError::Uncertainty {
                reason: format!(
                    "so many cells and steps are summed in blocks of {block} x {block} cells, {block_km:.0} km long, and a \
                     correlation length of {length_km} km does not hold {BLOCKS_IN_LENGTH} of them: ask for a smaller region, a \
                     shorter period, a longer length, or 0 where each cell's error is its own"
                ),
            });
        }
        let words = format!(
            "all pairs of {rows} x {cols} blocks of {block} x {block} cells, at most {block_km:.0} km long, whose errors are \
             taken as one; by Fourier transforms of rows"
        );
        Ok(Self {
            window,
            at_once,
            words,
        })
    }
}

/// Blocks of which errors are drawn for so many steps, so that it ends in time.
///
/// # Errors
/// `Uncertainty` where nothing is to be drawn, or blocks would be longer than errors go together.
pub(super) fn of_draws(
    grid: &Grid,
    window: &Window,
    length_km: f64,
    step_count: usize,
    draws: u32,
) -> Result<Window, ComputeError> {
    let refused = |reason: &str| ComputeError::Uncertainty {
        reason: format!("Monte Carlo: {reason}"),
    };
    if length_km <= 0.0 {
        return Err(refused(
            "nothing is drawn where the error of each cell is its own; the sum of squares is exact",
        ));
    }
    let windows = (1..=MAX_BLOCK).filter_map(|block| window.with_blocks(block));
    let mut windows = windows.filter(|window| window.round(grid).is_some());
    let ends = |window: &Window| draws_cost(grid, window, step_count, draws) <= MOST_WORK_NS;
    let found = windows.find(|window| ends(window)).ok_or_else(|| {
        refused("too many cells, steps and draws, or a grid whose cells do not go evenly round the earth; ask for fewer")
    })?;
    if found.block > 1 && length_km < BLOCKS_IN_LENGTH * found.block_km(grid) {
        return Err(refused(&format!(
            "so many cells, steps and draws are taken in blocks of {} cells a side, {:.0} km long, and a correlation length of \
             {length_km} km does not hold {BLOCKS_IN_LENGTH} of them; ask for fewer",
            found.block,
            found.block_km(grid)
        )));
    }
    Ok(found)
}

/// Work of draws, ns; without end where they take too much memory.
fn draws_cost(grid: &Grid, window: &Window, step_count: usize, draws: u32) -> f64 {
    /// A product of a factor and a number, one of a transform with its wave, and a normal number, ns.
    const PRODUCT_NS: f64 = 1.2;
    const TRANSFORM_NS: f64 = 30.0;
    const NORMAL_NS: f64 = 15.0;
    let rows = window.size().0 as f64;
    let round = window.round(grid).unwrap_or(usize::MAX) as f64;
    let (waves, triangle) = (round / 2.0 + 1.0, rows * rows / 2.0);
    if waves * triangle * size_of::<f64>() as f64 > HELD_BYTES as f64 {
        return f64::INFINITY;
    }
    let setting_up = triangle * round * KERNEL_NS + waves * rows * triangle / 3.0 * PRODUCT_NS;
    let a_step = waves * triangle * 2.0 * PRODUCT_NS
        + rows * round * TRANSFORM_NS
        + waves * rows * 2.0 * NORMAL_NS;
    setting_up + f64::from(draws) * step_count as f64 * a_step
}

/// Work in ns, and forms that are summed at a time.
fn cost(grid: &Grid, window: &Window, form_count: usize) -> (f64, usize) {
    let plane = window.plane(grid);
    let (rows, waves) = (plane.lats_deg.len(), transform_size(&plane) / 2 + 1);
    let at_once = (HELD_BYTES / (rows * waves * size_of::<[f64; 4]>())).max(1);
    let numbers = (rows * (rows + 1) / 2) as f64 * waves as f64;
    let tables = form_count.div_ceil(at_once) as f64;
    (
        numbers * (tables * KERNEL_NS + form_count as f64 * FORM_NS),
        at_once,
    )
}

#[cfg(test)]
mod tests {
    use super::super::pairs::{Form, Pairs};
    use super::*;
    use crate::region::loaded::RegionWeights;
    use contract::chunk::field_chunks;

    fn globe(cells_a_degree: u32) -> (Grid, Window) {
        let grid = Grid {
            rows: 180 * cells_a_degree,
            cols: 360 * cells_a_degree,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 1.0 / f64::from(cells_a_degree),
            dlon_deg: 1.0 / f64::from(cells_a_degree),
        };
        let chunks = (0..).zip(field_chunks(&grid));
        let areas = chunks.map(|(chunk, window)| (chunk, vec![1.0; window.cell_count()]));
        let window = Window::of(&grid, &RegionWeights::new(areas.collect())).unwrap();
        (grid, window)
    }

    #[test]
    fn a_year_of_months_is_summed_by_cells_and_years_of_days_by_blocks() {
        let (grid, window) = globe(1);
        let of = |length_km, forms| Scheme::of(&grid, &window, length_km, forms);
        assert_eq!(of(500.0, 12).unwrap().window.block, 1);
        let days = of(2000.0, 5844).unwrap();
        assert!(
            days.window.block > 1 && days.words.contains("blocks"),
            "{}",
            days.words
        );
        let refused = of(150.0, 5844).unwrap_err().to_string();
        assert!(refused.contains("does not hold 2"), "{refused}");
        assert_eq!(of(0.0, 5844).unwrap().window.block, 1);
    }

    #[test]
    fn a_quarter_of_a_degree_ends_in_time_too() {
        let (grid, window) = globe(4);
        let scheme = Scheme::of(&grid, &window, 1000.0, 12).unwrap();
        assert!(scheme.window.block <= 2, "{}", scheme.words);
        let refused = Scheme::of(&grid, &window, 1000.0, 1 << 40).unwrap_err();
        assert!(refused.to_string().contains("smaller one"), "{refused}");
    }

    #[test]
    fn blocks_that_the_length_holds_twice_change_an_error_by_less_than_a_hundredth() {
        let grid = Grid {
            rows: 42,
            cols: 60,
            north_deg: 50.0,
            west_deg: 0.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        };
        let chunks = (0..).zip(field_chunks(&grid));
        let areas = chunks.map(|(chunk, window)| (chunk, vec![1.0; window.cell_count()]));
        let cells = Window::of(&grid, &RegionWeights::new(areas.collect())).unwrap();
        // Three cells of four hold something.
        let share = |cell: usize| match cell % 4 {
            0 => 0.0,
            _ => 1.0 + 0.5 * (cell as f64 / 50.0).sin(),
        };
        for block in [2, 3, 6] {
            let blocks = cells.with_blocks(block).unwrap();
            let length_km = BLOCKS_IN_LENGTH * blocks.block_km(&grid);
            let sigma = |window: &Window| {
                let (rows, cols) = window.size();
                let mut x = vec![0.0; rows * cols];
                (0..grid.cell_count()).for_each(|cell| x[window.block_of(cell)] += share(cell));
                let pairs = Pairs::new(window.plane(&grid), length_km);
                let form = Form { y: x.clone(), x };
                pairs.sums(&[pairs.spectrum(&form)])[0].sqrt()
            };
            let ratio = sigma(&blocks) / sigma(&cells);
            assert!((ratio - 1.0).abs() < 0.01, "{block}: {ratio}");
        }
    }
}
