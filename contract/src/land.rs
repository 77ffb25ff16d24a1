//! The land of Natural Earth, 1:50 million (public domain), as rings: what is no sea, to those who count and those who draw.
//!
//! `land/pack.py` packs it from the npm package `world-atlas` and checks it. Waters that land encloses are land here: lakes,
//! and the Caspian Sea. Ice shelves are sea: the coast is that of the ground below.

pub mod packed;

use std::sync::LazyLock;

/// The packed rings.
const PACKED: &[u8] = include_bytes!("land/land.bin");

/// Outlines of all land, `[lon, lat]` in degrees, longitudes -180 to 180; what they go round at all is land.
pub static LAND: LazyLock<Vec<Vec<[f64; 2]>>> =
    LazyLock::new(|| unpacked(PACKED).expect("the packed land is whole; a test reads it"));

fn unpacked(mut bytes: &[u8]) -> Option<Vec<Vec<[f64; 2]>>> {
    let rings = packed::take_lines(&mut bytes)?;
    let degrees = |place: [i64; 2]| place.map(|parts| parts as f64 / packed::PARTS_PER_DEG);
    let in_degrees = |ring: Vec<[i64; 2]>| ring.into_iter().map(degrees).collect();
    bytes
        .is_empty()
        .then(|| rings.into_iter().map(in_degrees).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_packed_land_is_whole_and_lies_in_the_world() {
        let corners: usize = LAND.iter().map(Vec::len).sum();
        assert_eq!((LAND.len(), corners), (1420, 58_566));
        let bounds = |axis: usize| {
            let numbers = LAND.iter().flatten().map(|place| place[axis]);
            numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
                [low.min(at), high.max(at)]
            })
        };
        // Whole numbers of thousandths.
        assert_eq!(bounds(0).map(|lon| lon.round() as i32), [-180, 180]);
        let [south, north] = bounds(1);
        assert!(
            (-90.0..-89.9).contains(&south) && (83.5..83.7).contains(&north),
            "{south} {north}"
        );
    }

    #[test]
    fn what_is_cut_short_is_none() {
        for end in [0, 1, 100, PACKED.len() - 1] {
            assert_eq!(unpacked(&PACKED[..end]), None, "{end}");
        }
    }
}
