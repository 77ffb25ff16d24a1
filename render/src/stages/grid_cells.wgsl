// Cells of the grid as stages find them that see the ground through a pixel.

// Cells that are not there.
const NO_CELL = 0xffffffffu;

fn cell_at(row: i32, col: i32) -> u32 {
    var x = col;
    let cols = i32(grid.cols);
    if (feature(IS_PERIODIC, grid.periodic == 1u)) { x = wrapped(x, cols); }
    if (x < 0 || x >= cols || row < 0 || row >= i32(grid.rows)) { return NO_CELL; }
    let cell = u32(row) * grid.cols + u32(x);
    if (cell < grid.held_first_cell || cell >= grid.held_end_cell) { return NO_CELL; }
    return cell - grid.held_first_cell;
}

fn axis_at(place: f32) -> Axis {
    let index = floor(place);
    return Axis(i32(index), place - index);
}

// Where a longitude and a latitude fall between centres of cells.
fn col_of(lon: f32) -> Axis {
    let east = lon - grid.west_rad;
    return axis_at((east - floor(east / TURN) * TURN) * grid.cols_per_rad - 0.5);
}

fn row_of(lat: f32) -> Axis {
    return axis_at((grid.north_rad - lat) * grid.rows_per_rad - 0.5);
}
