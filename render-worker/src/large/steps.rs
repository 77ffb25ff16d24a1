//! Fields of very large products by windows of their levels: from the product's cube, or where that has none from the field itself.

use contract::chunk::Window;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::quantity::Quantity;
use cube::Bands as _;
use cube::{
    At, Cube, CubeError, FieldBands, LevelWindow, Repository, joined_window, range_of_field,
};
use quick_cache::sync::Cache;
use storage::{Store, manifests};

use super::choice::Choice;
use crate::error::DrawError;

/// Products whose cubes are kept open.
const MOST_CUBES: usize = 16;

/// Reads fields.
pub(super) struct Steps {
    store: Store,
    /// By product; a state of a cube does not change.
    cubes: Cache<String, Cube>,
}

impl Steps {
    pub(super) fn new(store: Store) -> Self {
        Self {
            store,
            cubes: Cache::new(MOST_CUBES),
        }
    }

    /// Values of a window of a level of a field, and how much of each cell holds data.
    pub(super) async fn window(
        &self,
        grid: &Grid,
        field: &ObjectKey,
        choice: &Choice,
    ) -> Result<LevelWindow, DrawError> {
        let mut parts = vec![];
        for window in choice.windows() {
            let found = self.of_cube(grid, field, (choice.level, window)).await?;
            let part = if let Some(part) = found {
                part
            } else {
                self.of_field(grid, field, (choice.level, window)).await?
            };
            parts.push((window.cols as usize, part));
        }
        Ok(side_by_side(parts))
    }

    /// A window of a level of a field from the product's cube, if it is there.
    async fn of_cube(
        &self,
        grid: &Grid,
        field: &ObjectKey,
        (level, window): (u32, Window),
    ) -> Result<Option<LevelWindow>, DrawError> {
        let Some((cube, step)) = self.in_cube(grid, field).await? else {
            return Ok(None);
        };
        match cube.window_at(level, window, step).await {
            Ok(found) => Ok(found),
            // Clean-up may have taken what names the chunks of a state that was opened long ago: the newest names them too.
            Err(first) => {
                self.cubes.remove(product_of(field));
                let Some((cube, step)) = self.in_cube(grid, field).await? else {
                    return Err(failed(field, first));
                };
                let again = cube.window_at(level, window, step).await;
                again.map_err(|e| failed(field, e))
            }
        }
    }

    /// The same of a field that is in no cube, or has no levels there.
    async fn of_field(
        &self,
        grid: &Grid,
        field: &ObjectKey,
        (level, window): (u32, Window),
    ) -> Result<LevelWindow, DrawError> {
        let mut bands = FieldBands::new(&self.store, field, grid);
        if level > 0 {
            let of = (grid, self.quantity(field).await?);
            let joined = joined_window(of, level, window, &mut bands).await;
            return joined.map_err(|e| failed(field, e));
        }
        let rows = bands.rows(window.row..window.row + window.rows).await;
        let rows = rows.map_err(|e| failed(field, e))?;
        let cols = window.col as usize..(window.col + window.cols) as usize;
        let rows = rows.chunks_exact(grid.cols as usize);
        let values = rows.flat_map(|row| row[cols.clone()].iter().copied());
        Ok(LevelWindow::of_cells(values.collect()))
    }

    /// Smallest and largest value of a field.
    pub(super) async fn range(
        &self,
        grid: &Grid,
        field: &ObjectKey,
    ) -> Result<[f32; 2], DrawError> {
        let found = self.in_cube(grid, field).await?;
        if let Some(range) = found.and_then(|(cube, step)| cube.range_of(step)) {
            return Ok(range);
        }
        let mut bands = FieldBands::new(&self.store, field, grid);
        let range = range_of_field(grid, &mut bands).await;
        range.map_err(|e| failed(field, e))
    }

    /// The step of the product's cube that holds a field's values, if it is there.
    async fn in_cube(
        &self,
        grid: &Grid,
        field: &ObjectKey,
    ) -> Result<Option<(Cube, usize)>, DrawError> {
        let Vouched::Values(digest) = field.vouches() else {
            return Ok(None);
        };
        let product = product_of(field);
        if let Some(cube) = self.cubes.get(product)
            && let Some(step) = step_of(&cube, grid, &digest)
        {
            return Ok(Some((cube, step)));
        }
        let folder = match product.parse() {
            Ok(product) => cube::folder(&product),
            Err(_no_product) => return Ok(None),
        };
        let newest = async {
            let repository = Repository::open(&self.store, &folder).await?;
            repository.at(&At::Newest).await
        };
        let cube = match newest.await {
            Ok(cube) => cube,
            Err(CubeError::Missing { .. }) => return Ok(None),
            Err(error) => return Err(failed(field, error)),
        };
        self.cubes.insert(product.to_owned(), cube.clone());
        Ok(step_of(&cube, grid, &digest).map(|step| (cube, step)))
    }

    /// What a field is of, for who has only the field.
    async fn quantity(&self, field: &ObjectKey) -> Result<Quantity, DrawError> {
        let product = product_of(field);
        if let Some(cube) = self.cubes.get(product) {
            return Ok(cube.description().quantity);
        }
        let newest = match product.parse() {
            Ok(product) => manifests::latest(&self.store, &product).await,
            Err(_no_product) => Ok(None),
        };
        let newest = newest.map_err(|e| failed(field, e.into()))?;
        newest.map(|newest| newest.quantity).ok_or_else(|| DrawError::Large {
            product: product.to_owned(),
            reason: "it has no cube and no version is published, so that nobody knows how its cells are joined: land it again"
                .to_owned(),
        })
    }
}

fn step_of(cube: &Cube, grid: &Grid, digest: &Digest) -> Option<usize> {
    let own = &cube.description().grid;
    let is_same = (own.rows, own.cols) == (grid.rows, grid.cols);
    cube.step_of(digest).filter(|_step| is_same)
}

/// Windows next to one another as one.
fn side_by_side(mut parts: Vec<(usize, LevelWindow)>) -> LevelWindow {
    if parts.len() == 1
        && let Some((_cols, only)) = parts.pop()
    {
        return only;
    }
    let rows = parts.first().map_or(0, |(cols, it)| it.values.len() / cols);
    let mut all = LevelWindow {
        values: vec![],
        coverage: vec![],
    };
    for row in 0..rows {
        for (cols, part) in &parts {
            all.values
                .extend(&part.values[row * cols..(row + 1) * cols]);
            all.coverage
                .extend(&part.coverage[row * cols..(row + 1) * cols]);
        }
    }
    all
}

pub(super) fn product_of(key: &ObjectKey) -> &str {
    key.as_str().split('/').nth(1).unwrap_or_default()
}

fn failed(field: &ObjectKey, source: CubeError) -> DrawError {
    DrawError::Cube {
        product: product_of(field).to_owned(),
        source: Box::new(source),
    }
}
