//! What there is to see at one instant: two adjacent fields of a product, of its accumulated carbon, its domain, and the
//! terrain below.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use contract::grid::Grid;

use crate::by_domain::ByDomain;
use crate::error::RenderError;
use crate::stages::fill::Filled;
use crate::stages::layout::{COVERED, MISSING, is_missing};

static NEXT_ID: AtomicU64 = AtomicU64::new(0);

/// A column of numbers, one a cell (`[row, col]`), that devices may keep under its id.
#[derive(Debug)]
pub struct Cells<T> {
    id: u64,
    content: Vec<T>,
    /// Blocks of cells, not cells of the product.
    is_joined: bool,
    /// The same in blocks of four.
    coarser: OnceLock<Arc<Cells<T>>>,
}

impl<T> Cells<T> {
    fn new(content: Vec<T>) -> Self {
        Self {
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            content,
            is_joined: false,
            coarser: OnceLock::new(),
        }
    }

    /// Different for every set of cells made by this process.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The same in blocks of four, made by `make` the first time. Who wants it meanwhile waits for it and for nothing
    /// else.
    pub(crate) fn coarser(cells: &Arc<Self>, make: impl FnOnce(&[T]) -> Vec<T>) -> Arc<Self> {
        let coarser = || {
            Arc::new(Self {
                is_joined: true,
                ..Self::new(make(&cells.content))
            })
        };
        Arc::clone(cells.coarser.get_or_init(coarser))
    }

    /// Are these blocks of cells, and not the cells of the product?
    pub fn is_joined(&self) -> bool {
        self.is_joined
    }

    /// The numbers.
    pub fn content(&self) -> &[T] {
        &self.content
    }
}

/// One time step, gaps filled.
#[derive(Debug)]
pub struct Field {
    /// Values; [`MISSING`] where there is no data.
    pub cells: Cells<f32>,
    /// Estimated error (1σ) of every value in its unit: 0 where it was measured, above where a gap was filled; none if
    /// there was no gap. [`MISSING`] where there is no data.
    pub errors: Option<Cells<f32>>,
    /// The largest of them, 0 without any: what a style scales its uncertainty by.
    pub largest_error: f32,
    /// Smallest and largest value, 0 and 0 without data.
    pub range: [f32; 2],
    /// Is it a part of a field, whose range and largest error these are?
    is_part: bool,
    /// Means over blocks of four.
    coarser_mean: ByDomain<Field>,
    /// What keeps the mass of blocks of four.
    coarser_mass: ByDomain<Field>,
    /// Share of the accumulated time that every sum lacks, 0 to 1; none where all sums are complete, where values are
    /// no sums, and where nobody asked.
    lacking: Option<Vec<f32>>,
    /// Made when uncertainty is first drawn.
    uncertainties: OnceLock<Cells<f32>>,
}

/// Uncertainty of a filled cell with next to no estimated error, and of a sum that lacks next to nothing: it is seen that the
/// one was not measured and the other is not complete.
const LEAST_UNCERTAINTY: f32 = 0.4;

impl Field {
    /// A field from values with NaN (or anything not finite) where there is no data.
    pub fn new(mut values: Vec<f32>) -> Self {
        let mut range: Option<[f32; 2]> = None;
        for value in &mut values {
            if !value.is_finite() || is_missing(*value) {
                *value = MISSING;
            } else {
                let [low, high] = range.unwrap_or([*value; 2]);
                range = Some([low.min(*value), high.max(*value)]);
            }
        }
        Self {
            cells: Cells::new(values),
            errors: None,
            largest_error: 0.0,
            range: range.unwrap_or_default(),
            is_part: false,
            coarser_mean: ByDomain::new(),
            coarser_mass: ByDomain::new(),
            lacking: None,
            uncertainties: OnceLock::new(),
        }
    }

    /// The same with the share of its time that every sum lacks, `[row, col]`, 0 to 1.
    #[must_use]
    pub fn with_lacking(mut self, mut lacking: Vec<f32>) -> Self {
        for (lacking, value) in lacking.iter_mut().zip(&self.cells.content) {
            // What is not there lacks nothing, also in the mean of a block.
            if is_missing(*value) {
                *lacking = MISSING;
            }
        }
        self.lacking = lacking
            .iter()
            .any(|lacking| *lacking > 0.0)
            .then_some(lacking);
        self
    }

    /// A field of filled values and their estimated errors.
    pub fn filled(filled: Filled) -> Self {
        Self::new(filled.values).with_errors(filled.errors)
    }

    /// The same as a part of a field whose values lie in a range: slices and light are laid out for all of it.
    #[must_use]
    pub fn over(mut self, range: [f32; 2]) -> Self {
        self.range = range;
        self.is_part = true;
        self
    }

    /// The same in coarser cells, as a part of the same field.
    fn of_the_same(mut self, finer: &Self) -> Self {
        if finer.is_part {
            self.range = finer.range;
            self.largest_error = finer.largest_error;
            self.is_part = true;
        }
        self
    }

    /// The same with estimated errors of its values, as a part of a field whose largest one is known.
    #[must_use]
    pub fn with_errors_of(self, errors: Vec<f32>, largest_error: f32) -> Self {
        let mut own = self.with_errors(errors);
        own.largest_error = largest_error;
        own.is_part = true;
        own
    }

    fn with_errors(mut self, errors: Vec<f32>) -> Self {
        let errors = Self::new(errors);
        self.largest_error = errors.range[1];
        self.errors = Some(errors.cells);
        self
    }

    /// How much each cell is to be uncertain: 0 where it was measured and complete, else rising to 1 with its estimated
    /// error or with what its sum lacks.
    pub fn uncertainties(&self) -> &Cells<f32> {
        // The root, because a few cells are far worse than most.
        let uncertainty = |share: f32| LEAST_UNCERTAINTY + (1.0 - LEAST_UNCERTAINTY) * share.sqrt();
        self.uncertainties.get_or_init(|| {
            let mut uncertainties = vec![0.0_f32; self.cells.content.len()];
            let errors = self.errors.iter().flat_map(|errors| &errors.content);
            for (own, error) in uncertainties.iter_mut().zip(errors) {
                if *error > 0.0 {
                    *own = uncertainty(error / self.largest_error);
                }
            }
            let lacking = self.lacking.iter().flatten();
            for (own, lacking) in uncertainties.iter_mut().zip(lacking) {
                if *lacking > 0.0 {
                    *own = own.max(uncertainty(*lacking));
                }
            }
            Cells::new(uncertainties)
        })
    }

    /// Is there anything to uncertainty?
    fn has_uncertainty(&self) -> bool {
        self.largest_error > 0.0 || self.lacking.is_some()
    }

    /// Blocks of four, weighed by a domain; an error becomes the mean of the four, as if they were wrong together, and so does what they
    /// lack.
    pub(crate) fn coarser_mean(&self, domain: u64, make: impl Fn(&[f32]) -> Vec<f32>) -> Arc<Self> {
        let coarser = || {
            let mut coarser = Self::new(make(&self.cells.content));
            if let Some(errors) = &self.errors {
                coarser = coarser.with_errors(make(&errors.content));
            }
            if let Some(lacking) = &self.lacking {
                coarser = coarser.with_lacking(make(lacking));
            }
            Arc::new(coarser.of_the_same(self))
        };
        self.coarser_mean.get_or_init(domain, coarser)
    }

    pub(crate) fn coarser_mass(
        &self,
        domain: u64,
        make: impl FnOnce(&[f32]) -> Vec<f32>,
    ) -> Arc<Self> {
        let coarser = || Arc::new(Self::new(make(&self.cells.content)).of_the_same(self));
        self.coarser_mass.get_or_init(domain, coarser)
    }

    /// Bytes held, coarser versions left out: they add a third at most.
    pub fn size_bytes(&self) -> u64 {
        let cells = self.cells.content.len()
            + self
                .errors
                .as_ref()
                .map_or(0, |errors| errors.content.len())
            + self.lacking.as_ref().map_or(0, Vec::len)
            + self
                .uncertainties
                .get()
                .map_or(0, |uncertainties| uncertainties.content.len());
        (cells * size_of::<f32>()) as u64
    }
}

/// Two adjacent steps and the weight of the second (eq. 3 in docs/method.md).
#[derive(Debug, Clone)]
pub struct Interval {
    /// The step before the instant.
    pub before: Arc<Field>,
    /// The step after it.
    pub after: Arc<Field>,
    /// 0 at `before`, 1 at `after`.
    pub weight: f64,
}

impl Interval {
    /// Was any gap filled in either step, or is any sum not complete?
    pub fn has_uncertainty(&self) -> bool {
        [&self.before, &self.after]
            .iter()
            .any(|field| field.has_uncertainty())
    }

    /// Smallest and largest value that any instant between the two steps can have.
    pub fn range(&self) -> [f32; 2] {
        let ([low1, high1], [low2, high2]) = (self.before.range, self.after.range);
        [low1.min(low2), high1.max(high2)]
    }
}

/// Land and sea floor, on a grid of their own.
#[derive(Debug, Clone)]
pub struct Terrain {
    /// The grid.
    pub grid: Grid,
    /// Height above the level of the sea, m; [`MISSING`] where it is not known.
    pub elevation: Arc<Field>,
}

impl Terrain {
    /// Height of every cell, m.
    pub fn heights_m(&self) -> &[f32] {
        self.elevation.cells.content()
    }
}

/// Everything a picture is drawn from, apart from its job.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The grid of all fields.
    pub grid: Grid,
    /// How much of every cell's area holds data in some step: 0 of none, [`COVERED`] of all, which cells of a product are;
    /// blocks of cells may lie between.
    pub domain: Arc<Cells<u32>>,
    /// The product drawn.
    pub value: Interval,
    /// Accumulated carbon, kg m⁻².
    pub accumulated: Option<Interval>,
    /// What lies below.
    pub terrain: Option<Terrain>,
    /// Northward part of the vector of which `value` is the eastward part, m s⁻¹.
    pub northward: Option<Interval>,
    /// What the trails on the sea surface are drawn from: a flow on a grid of its own.
    pub trails: Option<Arc<Scene>>,
    /// What the grid is a window of; none if it is all that the product has.
    pub whole: Option<Whole>,
}

/// A grid that is too large to be held, and where a window of it begins. What must not depend on the window goes by it: random
/// numbers, which blocks of cells are joined, and where a region ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whole {
    /// All of it.
    pub grid: Grid,
    /// First row of the window.
    pub row: u32,
    /// Its first column; the window may go on beyond the last one where the grid goes all the way round.
    pub col: u32,
}

impl Scene {
    /// A grid without content whose accumulated carbon lies in a range, to plan pictures of before anything is read.
    pub(crate) fn unread(grid: Grid, carbon: Option<[f32; 2]>, whole: Option<Whole>) -> Self {
        let still = |range| {
            let field = Arc::new(Field::new(vec![]).over(range));
            Interval {
                before: Arc::clone(&field),
                after: field,
                weight: 0.0,
            }
        };
        Self {
            grid,
            domain: Self::domain_of([]),
            value: still([0.0; 2]),
            accumulated: carbon.map(still),
            terrain: None,
            northward: None,
            trails: None,
            whole,
        }
    }

    /// A domain of blocks of cells from how much of each holds data, of [`COVERED`].
    pub fn domain_of_blocks(shares: Vec<u32>) -> Arc<Cells<u32>> {
        let mut cells = Cells::new(shares);
        cells.is_joined = true;
        Arc::new(cells)
    }

    /// A domain from one flag a cell.
    pub fn domain_of(cells: impl IntoIterator<Item = bool>) -> Arc<Cells<u32>> {
        let covered = |holds_data: bool| u32::from(holds_data) * COVERED;
        Arc::new(Cells::new(cells.into_iter().map(covered).collect()))
    }

    /// Checks that all parts have one number a cell.
    pub fn validate(&self) -> Result<(), RenderError> {
        let fields = [
            Some(&self.value),
            self.accumulated.as_ref(),
            self.northward.as_ref(),
        ];
        if let Some(trails) = &self.trails {
            trails.validate()?;
        }
        let fits = fields
            .into_iter()
            .flatten()
            .flat_map(|interval| [&interval.before, &interval.after])
            .all(|field| field.cells.content.len() == self.grid.cell_count());
        if let Some(Terrain { grid, elevation }) = &self.terrain {
            grid.validate()?;
            if elevation.cells.content.len() != grid.cell_count() {
                return Err(RenderError::GridMismatch {
                    product: "the relief".into(),
                    accumulated: "its field".into(),
                });
            }
        }
        if fits && self.domain.content.len() == self.grid.cell_count() {
            self.grid.validate()?;
            return Ok(());
        }
        Err(RenderError::GridMismatch {
            product: "the product".into(),
            accumulated: "a field or the domain".into(),
        })
    }
}
