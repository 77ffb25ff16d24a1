//! Codes have nothing between two of them: a map of them has their colours and no others, near and from far away.

use std::collections::BTreeSet;
use std::sync::Arc;

use contract::grid::Grid;
use contract::job::Mode;
use render::{Backend, Field, Image, Renderer, Scene};

use crate::scenes::{FIVE_DEGREES, job, ocean, tile};

/// Cells are smaller than pixels of the whole world.
const QUARTER_DEGREES: Grid = Grid {
    rows: 720,
    cols: 1440,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 0.25,
    dlon_deg: 0.25,
};

/// Colours of pixels that show anything.
fn colours(image: &Image) -> BTreeSet<[u8; 4]> {
    let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    let pixels = pixels.map(|(x, y)| image.pixel(x, y));
    pixels.filter(|[.., alpha]| *alpha > 0).collect()
}

#[test]
fn a_map_of_codes_has_their_colours_and_no_others() {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    for (grid, view) in [
        (FIVE_DEGREES, tile(2, 0, 1, 256)),
        (QUARTER_DEGREES, tile(0, 0, 0, 256)),
    ] {
        // Two codes in stripes across both axes, the highest and the lowest of the colours.
        let code = |cell: usize| {
            let (row, col) = (cell / grid.cols as usize, cell % grid.cols as usize);
            if (row / 3 + col / 5).is_multiple_of(2) {
                1.0
            } else {
                5.0
            }
        };
        let mut scene = ocean(grid);
        let values: Vec<f32> = (0..grid.cell_count()).map(code).collect();
        scene.domain = Scene::domain_of(values.iter().map(|_| true));
        let field = Arc::new(Field::new(values));
        (scene.value.before, scene.value.after) = (Arc::clone(&field), field);
        let mut job = job(Mode::Map, view);
        job.grid = grid;
        (job.style.transfer.low, job.style.transfer.high) = (1.0, 5.0);
        let mut drawn = |nearest| {
            job.style.nearest = nearest;
            colours(&renderer.render(&job, &scene).unwrap())
        };
        let of_codes = drawn(true);
        assert_eq!(
            of_codes.len(),
            2,
            "{:?}",
            of_codes.iter().take(9).collect::<Vec<_>>()
        );
        // Else the borders of a quantity are soft.
        assert!(drawn(false).len() > 20);
    }
}
