use std::io::Cursor;

use contract::quantity::Quantity;
use tiff::encoder::{Compression, colortype};

use super::*;

/// Several strips, the last one short.
const GRID: Grid = Grid {
    rows: 2100,
    cols: 300,
    north_deg: 70.0,
    west_deg: 0.0,
    dlat_deg: 0.05,
    dlon_deg: 0.05,
};

fn description() -> Description {
    Description {
        product: "some-product".parse().unwrap(),
        title: "Flux".to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        source: "Somebody et al. (2000)".to_owned(),
        grid: GRID,
        version: None,
        statistic: None,
    }
}

#[test]
fn strip_by_strip_a_file_has_the_bytes_that_the_library_gives_to_a_whole_image() {
    let value = |cell: usize| match cell % 101 {
        0 => f32::NAN,
        n => n as f32 * 1e-9,
    };
    let values: Vec<f32> = (0..GRID.cell_count()).map(value).collect();
    let (description, january) = (description(), Period::month(2000, 1).unwrap());
    let mut expected = Cursor::new(vec![]);
    let mut tiff = TiffEncoder::new(&mut expected)
        .unwrap()
        .with_compression(Compression::Deflate(DeflateLevel::Balanced));
    let image = tiff.new_image::<colortype::Gray32Float>(GRID.cols, GRID.rows);
    let mut image = image.unwrap();
    describe(image.encoder(), &description, january).unwrap();
    image.write_data(&values).unwrap();
    for band_rows in [7, 600, 2100] {
        let mut found = Cursor::new(vec![]);
        let mut bands = values.chunks(band_rows * 300).map(<[f32]>::to_vec);
        let step = (&description, january, Cells::new(&mut bands, &GRID));
        let tiff = TiffEncoder::new(&mut found).unwrap();
        write(tiff, step, |e| panic!("{e}")).unwrap();
        assert!(found.get_ref() == expected.get_ref(), "{band_rows}");
    }
}
