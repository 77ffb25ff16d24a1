//! What is asked: globe views or tiles of one product, each at an instant of its own.

use anyhow::{Result, ensure};
use contract::tile::Tile;

use crate::bench::listed::{Listed, Span};
use crate::cli::BenchServe;

/// Pixels a side of a tile.
pub(super) const TILE_PX: u32 = 256;
/// Fraction of the golden section, in units of 2^-64: its multiples fill an interval evenly, none twice.
pub(super) const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// Addresses by number.
pub(super) struct Questions {
    /// What the answers must measure, pixels.
    pub(super) size_px: [u32; 2],
    /// Addresses without their instant.
    places: Vec<String>,
    span: Span,
    /// Where in the span the first instant lies, in units of 2^-64: another place in every run.
    seed: u64,
}

impl Questions {
    /// `seed` is another one in every run.
    pub(super) fn about(product: &Listed, options: &BenchServe, seed: u64) -> Result<Self> {
        let places = match options.tiles {
            Some(zoom) => tiles_on(product, zoom)?
                .into_iter()
                .map(|tile| tile_address(product, options, tile))
                .collect(),
            None => vec![view(product, options)],
        };
        Ok(Self {
            size_px: match options.tiles {
                Some(_zoom) => [TILE_PX, TILE_PX],
                None => [options.width, options.height],
            },
            places,
            span: product.span()?,
            seed,
        })
    }

    /// The address of a picture that nobody asked for before.
    pub(super) fn address(&self, number: u64) -> String {
        let place = &self.places[(number % self.places.len() as u64) as usize];
        let share = number.wrapping_mul(GOLDEN).wrapping_add(self.seed);
        let time = self.span.at_share(share);
        format!("{place}time={time}")
    }
}

fn view(product: &Listed, options: &BenchServe) -> String {
    format!(
        "{}/globe/{}/{}.png?lon={}&lat={}&height_km={}&tilt={}&width={}&height={}&",
        options.url,
        product.product,
        options.mode,
        options.lon,
        options.lat,
        options.height_km,
        options.tilt,
        options.width,
        options.height
    )
}

/// The tiles of a zoom level that lie on the product.
pub(super) fn tiles_on(product: &Listed, zoom: u8) -> Result<Vec<Tile>> {
    let side = 1u32 << zoom;
    let mut tiles = vec![];
    for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y, x))) {
        let tile = Tile::new(zoom, x, y)?;
        if overlap(tile.bounds_deg(), product.bounds_deg) {
            tiles.push(tile);
        }
    }
    ensure!(
        !tiles.is_empty(),
        "no tile of zoom {zoom} lies on {}",
        product.product
    );
    Ok(tiles)
}

/// The address of a tile without its instant.
pub(super) fn tile_address(product: &Listed, options: &BenchServe, tile: Tile) -> String {
    let (Tile { z, x, y }, mode) = (tile, options.mode);
    format!(
        "{}/tiles/{}/{mode}/{z}/{x}/{y}.png?",
        options.url, product.product
    )
}

/// Do two boxes of west, south, east and north share an area, one of them perhaps a turn further east?
fn overlap(a: [f64; 4], b: [f64; 4]) -> bool {
    let is_level = a[1] < b[3] && b[1] < a[3];
    let meets = |turn_deg: f64| a[0] < b[2] + turn_deg && b[0] + turn_deg < a[2];
    is_level && [-360.0, 0.0, 360.0].into_iter().any(meets)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::Parser as _;

    use super::*;
    use crate::bench::listed::tests::product;

    #[derive(clap::Parser)]
    struct Program {
        #[command(flatten)]
        options: BenchServe,
    }

    fn options(words: &[&str]) -> BenchServe {
        Program::parse_from([&["bench"], words].concat()).options
    }

    fn times(questions: &Questions, count: u64) -> BTreeSet<String> {
        let time = |number| {
            questions
                .address(number)
                .split("time=")
                .nth(1)
                .unwrap()
                .to_owned()
        };
        (0..count).map(time).collect()
    }

    #[test]
    fn instants_are_all_different_in_one_run_and_from_run_to_run() {
        let about = |seed| Questions::about(&product(), &options(&[]), seed).unwrap();
        let (first, second) = (times(&about(1), 5000), times(&about(u64::MAX / 3), 5000));
        assert_eq!((first.len(), second.len()), (5000, 5000));
        assert!(first.is_disjoint(&second));
        let all = first.union(&second);
        assert!(
            all.clone()
                .all(|time| time.starts_with("2000-01") || time.starts_with("2000-02"))
        );
    }

    #[test]
    fn views_have_the_size_asked_for_and_tiles_lie_on_the_product() {
        let words = ["--width", "1920", "--height", "1080", "--lon", "115"];
        let views = Questions::about(&product(), &options(&words), 0).unwrap();
        assert_eq!(views.size_px, [1920, 1080]);
        assert!(views.address(0).contains("/globe/p/volume.png?lon=115&"));
        assert!(
            views
                .address(0)
                .contains("&width=1920&height=1080&time=2000-01-16")
        );
        let tiles = Questions::about(&product(), &options(&["--tiles", "3"]), 0).unwrap();
        // 90 to 135 E is column 6; the equator to 40.98 N is row 3.
        assert_eq!(tiles.places.len(), 1);
        assert!(tiles.address(7).contains("/tiles/p/volume/3/6/3.png?time="));
    }
}
