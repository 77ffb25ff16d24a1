//! The sea in a region: its rings less the land, exactly, whatever the grid.

use contract::land::LAND;

use super::cut::{bounds_deg, inside, into_the_world};
use super::lattice::{Lattice, difference};
use super::ring::Ring;
use crate::ComputeError;

/// The rings of what is sea inside of some rings; none where all is land.
///
/// # Errors
/// `Region` where edges are too many and too long.
pub(super) fn sea(rings: &[Ring]) -> Result<Vec<Ring>, ComputeError> {
    let rings: Vec<_> = rings
        .iter()
        .flat_map(|ring| into_the_world(ring.corners()))
        .collect();
    let bounds = bounds_deg(rings.iter().flatten());
    let lattice = Lattice::over(bounds);
    let subject: Vec<_> = rings.iter().map(|ring| lattice.contour(ring)).collect();
    let land: Vec<_> = LAND
        .iter()
        .filter(|ring| meets(bounds_deg(*ring), bounds))
        .map(|ring| lattice.contour(&inside(ring.clone(), bounds)))
        .filter(|contour| contour.len() >= 3)
        .collect();
    Ok(lattice.rings(&difference(&subject, &land)?))
}

fn meets([west, south, east, north]: [f64; 4], [w, s, e, n]: [f64; 4]) -> bool {
    west < e && w < east && south < n && s < north
}

#[cfg(test)]
mod tests {
    use contract::earth::Earth;
    use contract::region::Region;

    use super::*;
    use crate::region::area::signed_area_m2;
    use crate::region::rings::rings;

    fn sea_m2(region: &str) -> f64 {
        let region: Region = region.parse().unwrap();
        let area = |ring: &Ring| signed_area_m2(ring, Earth::Wgs84);
        let sea = sea(&rings(&region).unwrap()).unwrap();
        sea.iter().map(area).sum()
    }

    /// The land's area found by shapely 2.2 (its union, cut into pieces of 0.01 degrees) and pyproj 3.7 (equal-area
    /// cylindrical projection on WGS84) from the same packed file.
    const LAND_M2: f64 = 147.133_376_859_428_07e12;

    #[test]
    fn the_sea_of_the_globe_is_what_another_program_finds() {
        let globe_m2 = Earth::Wgs84.cell_area_m2(-90.0, 90.0, 360.0);
        let sea_m2 = sea_m2("global");
        let land_m2 = globe_m2 - sea_m2;
        assert!((land_m2 / LAND_M2 - 1.0).abs() < 1e-6, "{land_m2}");
        // Eakins and Sharman (2010): 361.9e12 m², with other coasts and without the sea below ice shelves.
        assert!((sea_m2 / 361.9e12 - 1.0).abs() < 0.005, "{sea_m2}");
    }

    #[test]
    fn parts_of_the_globe_make_its_sea() {
        let whole = sea_m2("global");
        let parts = sea_m2("150,-90,-110,90") + sea_m2("-110,-90,10,90") + sea_m2("10,-90,150,90");
        assert!((parts / whole - 1.0).abs() < 1e-8, "{parts} {whole}");
    }

    /// Each edge across the world took some seconds.
    #[test]
    fn parts_on_both_sides_of_long_edges_make_the_sea_of_both() {
        let whole = sea_m2("global");
        let parts = sea_m2("POLYGON((-180 -90,180 -90,180 90,-180 -90))")
            + sea_m2("POLYGON((-180 -90,180 90,-180 90,-180 -90))");
        assert!((parts / whole - 1.0).abs() < 1e-8, "{parts} {whole}");
    }

    #[test]
    fn corners_along_straight_edges_change_nothing() {
        let straight = sea_m2("POLYGON((-90 20,90 20,90 80,-90 80,-90 20))");
        let one = sea_m2("POLYGON((-90 20,0 20,90 20,90 80,-90 80,-90 20))");
        assert!((one / straight - 1.0).abs() < 1e-9, "{one} {straight}");
        // One at every cell, as masks have them, at many latitudes.
        for south in (-88..88).step_by(8) {
            let along = |north: i32| (-180..=180).map(move |lon| format!("{lon} {north}"));
            let back = along(90).collect::<Vec<_>>().into_iter().rev();
            let corners: Vec<String> = along(south).chain(back).collect();
            let many = sea_m2(&format!("POLYGON(({},-180 {south}))", corners.join(",")));
            let few = sea_m2(&format!("-180,{south},180,90"));
            assert!((many / few - 1.0).abs() < 1e-9, "{south}: {many} {few}");
        }
    }

    #[test]
    fn open_sea_is_all_sea_and_inland_none() {
        let open = "-40,20,-30,30";
        let region: Region = open.parse().unwrap();
        let own = crate::region::extent::region_area_m2(&region, Earth::Wgs84).unwrap();
        assert!((sea_m2(open) / own - 1.0).abs() < 1e-8);
        // The Sahara, and the Caspian Sea: enclosed waters are land.
        for inland in ["5,20,10,25", "50,38,52,41"] {
            assert!(sea_m2(inland) < 1.0, "{inland}: {}", sea_m2(inland));
        }
    }

    #[test]
    fn a_region_drawn_past_the_date_line_has_the_sea_of_its_two_halves() {
        let past = sea_m2("POLYGON((170 -50,190 -50,190 -10,170 -10,170 -50))");
        let halves = sea_m2("170,-50,180,-10") + sea_m2("-180,-50,-170,-10");
        assert!((past / halves - 1.0).abs() < 1e-8, "{past} {halves}");
    }
}
