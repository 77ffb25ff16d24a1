//! The part of the earth that a question is about, cut at the date line once for every kind of store.

use contract::ContractError;
use contract::region::{Polygon, Region};

/// Most corners of a question's polygons together: they travel with every question.
const MAX_CORNERS: usize = 10_000;
/// Westernmost and easternmost longitude of stored places.
const WORLD_DEG: [f64; 2] = [-180.0, 180.0];

/// West, south, east, north, degrees; edges belong to it.
pub(crate) type Bounds = [f64; 4];

/// An area in longitudes of [-180, 180]; its edges belong to it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Area {
    Everywhere,
    Boxes(Vec<Bounds>),
    /// With a copy a turn to the west or east of what reaches past the date line. Rings are closed.
    Polygons(Vec<Polygon>),
}

/// Where a place lies to a ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Outside,
    Edge,
    Inside,
}

impl Area {
    /// The area of a region.
    ///
    /// # Errors
    /// A polygon with too few or too many corners, or with corners that are no places.
    pub(crate) fn new(region: &Region) -> Result<Self, ContractError> {
        match region {
            Region::Global => Ok(Self::Everywhere),
            Region::Box {
                west,
                south,
                east,
                north,
            } => {
                if !(south <= north && west <= east) {
                    let text = format!("{west},{south},{east},{north}");
                    let reason = "west,south,east,north, rising";
                    return Err(ContractError::invalid("box", &text, reason));
                }
                let copies = turns([*west, *south, *east, *north]).into_iter();
                Ok(Self::Boxes(copies.map(|(_, bounds)| bounds).collect()))
            }
            Region::Polygons(polygons) => {
                check(polygons)?;
                let copies = polygons.iter().flat_map(|polygon| {
                    let whole = turns(bounds(&polygon.outer)).into_iter();
                    whole.map(|(turn_deg, _)| turned(polygon, turn_deg))
                });
                Ok(Self::Polygons(copies.collect()))
            }
        }
    }

    /// Does a place with a longitude of [-180, 180) lie in it or on its edge?
    pub(crate) fn contains(&self, lon: f64, lat: f64) -> bool {
        match self {
            Self::Everywhere => true,
            Self::Boxes(boxes) => boxes.iter().any(|&[west, south, east, north]| {
                west <= lon && lon <= east && south <= lat && lat <= north
            }),
            Self::Polygons(polygons) => polygons.iter().any(|p| polygon_contains(p, [lon, lat])),
        }
    }

    /// Boxes that hold it, none for everywhere.
    pub(crate) fn boxes(&self) -> Vec<Bounds> {
        match self {
            Self::Everywhere => vec![],
            Self::Boxes(boxes) => boxes.clone(),
            Self::Polygons(polygons) => polygons.iter().map(|p| bounds(&p.outer)).collect(),
        }
    }

    /// May a place within these bounds lie in it?
    pub(crate) fn touches(&self, [w, s, e, n]: Bounds) -> bool {
        let meets = |&[west, south, east, north]: &Bounds| {
            west <= e && w <= east && south <= n && s <= north
        };
        *self == Self::Everywhere || self.boxes().iter().any(meets)
    }

    /// Its polygons as well-known binary (OGC 06-103r4), little-endian; none unless it is made of polygons.
    pub(crate) fn polygons_wkb(&self) -> Option<Vec<u8>> {
        let Self::Polygons(polygons) = self else {
            return None;
        };
        let mut wkb = header(6, polygons.len());
        for polygon in polygons {
            wkb.extend(header(3, 1 + polygon.holes.len()));
            for ring in std::iter::once(&polygon.outer).chain(&polygon.holes) {
                wkb.extend((ring.len() as u32).to_le_bytes());
                wkb.extend(
                    ring.iter()
                        .flatten()
                        .flat_map(|number| number.to_le_bytes()),
                );
            }
        }
        Some(wkb)
    }
}

/// Byte order, type and count of a well-known binary geometry.
fn header(kind: u32, count: usize) -> Vec<u8> {
    let mut bytes = vec![1];
    bytes.extend(kind.to_le_bytes());
    bytes.extend((count as u32).to_le_bytes());
    bytes
}

fn check(polygons: &[Polygon]) -> Result<(), ContractError> {
    let bad = |reason: String| Err(ContractError::invalid("polygon", "", reason));
    let rings = || {
        polygons
            .iter()
            .flat_map(|p| std::iter::once(&p.outer).chain(&p.holes))
    };
    let corners: usize = rings().map(Vec::len).sum();
    if polygons.is_empty() || corners > MAX_CORNERS {
        return bad(format!("1 to {MAX_CORNERS} corners, it has {corners}"));
    }
    if rings().any(|ring| ring.len() < 3) {
        return bad("a ring has at least three corners".to_owned());
    }
    let is_place = |&[lon, lat]: &[f64; 2]| lon.abs() <= 720.0 && lat.abs() <= 90.0;
    if !rings().flatten().all(is_place) {
        return bad("corners are longitude, latitude in degrees, latitude -90 to 90".to_owned());
    }
    Ok(())
}

/// The turns by which something with these bounds reaches into stored longitudes, with its bounds then.
fn turns([west, south, east, north]: Bounds) -> Vec<(f64, Bounds)> {
    let copies = [-720.0, -360.0, 0.0, 360.0, 720.0].into_iter();
    copies
        .map(|turn_deg| (turn_deg, [west + turn_deg, south, east + turn_deg, north]))
        .filter(|(_, [w, _, e, _])| *w <= WORLD_DEG[1] && *e >= WORLD_DEG[0])
        .collect()
}

fn turned(polygon: &Polygon, turn_deg: f64) -> Polygon {
    let ring = |ring: &Vec<[f64; 2]>| {
        let mut corners: Vec<_> = ring
            .iter()
            .map(|&[lon, lat]| [lon + turn_deg, lat])
            .collect();
        if corners.first() != corners.last() {
            corners.extend(corners.first().copied());
        }
        corners
    };
    Polygon {
        outer: ring(&polygon.outer),
        holes: polygon.holes.iter().map(ring).collect(),
    }
}

fn bounds(ring: &[[f64; 2]]) -> Bounds {
    let start = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    ring.iter().fold(start, |[w, s, e, n], &[lon, lat]| {
        [w.min(lon), s.min(lat), e.max(lon), n.max(lat)]
    })
}

fn polygon_contains(polygon: &Polygon, place: [f64; 2]) -> bool {
    let in_hole = || {
        polygon
            .holes
            .iter()
            .any(|hole| side(hole, place) == Side::Inside)
    };
    let on_hole = || {
        polygon
            .holes
            .iter()
            .any(|hole| side(hole, place) == Side::Edge)
    };
    match side(&polygon.outer, place) {
        Side::Outside => false,
        Side::Edge => true,
        Side::Inside => on_hole() || !in_hole(),
    }
}

/// Side of a closed ring by its winding number around the place; straight edges in longitude and latitude.
fn side(ring: &[[f64; 2]], [x, y]: [f64; 2]) -> Side {
    let mut winding = 0i32;
    for pair in ring.windows(2) {
        let ([x1, y1], [x2, y2]) = (pair[0], pair[1]);
        // Positive where the place lies to the left of the edge.
        let left = (x2 - x1) * (y - y1) - (x - x1) * (y2 - y1);
        let beside = x1.min(x2) <= x && x <= x1.max(x2) && y1.min(y2) <= y && y <= y1.max(y2);
        if left == 0.0 && beside {
            return Side::Edge;
        }
        if y1 <= y && y < y2 && left > 0.0 {
            winding += 1;
        } else if y2 <= y && y < y1 && left < 0.0 {
            winding -= 1;
        }
    }
    if winding == 0 {
        Side::Outside
    } else {
        Side::Inside
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(text: &str) -> Area {
        Area::new(&text.parse().unwrap()).unwrap()
    }

    fn square(west: f64, east: f64) -> Vec<[f64; 2]> {
        vec![[west, -10.0], [east, -10.0], [east, 10.0], [west, 10.0]]
    }

    #[test]
    fn a_box_across_the_date_line_holds_both_sides() {
        let area = area("170,-10,-170,10");
        for lon in [170.0, 175.0, -180.0, -170.0] {
            assert!(area.contains(lon, 10.0), "{lon}");
        }
        assert!(!area.contains(169.9, 0.0) && !area.contains(-169.9, 0.0));
        assert!(!area.contains(175.0, 10.1));
        assert!(area.touches([-179.0, 0.0, -178.0, 1.0]) && !area.touches([0.0, 0.0, 9.0, 9.0]));
    }

    #[test]
    fn a_whole_turn_is_everywhere() {
        let area = area("0,-90,360,90");
        assert!(
            [-180.0, -0.5, 0.0, 179.9]
                .iter()
                .all(|lon| area.contains(*lon, 45.0))
        );
    }

    #[test]
    fn a_polygon_across_the_date_line_has_its_hole_on_both_sides() {
        let polygon = Polygon {
            outer: square(170.0, 200.0),
            holes: vec![
                square(178.0, 182.0)
                    .into_iter()
                    .map(|[x, y]| [x, y / 2.0])
                    .collect(),
            ],
        };
        let area = Area::new(&Region::Polygons(vec![polygon])).unwrap();
        let inside = [
            [171.0, 0.0],
            [-165.0, 0.0],
            [-160.0, 10.0],
            [178.0, 0.0],
            [179.0, 6.0],
        ];
        let outside = [
            [179.0, 0.0],
            [-179.0, 0.0],
            [-159.9, 0.0],
            [169.9, 0.0],
            [0.0, 0.0],
        ];
        assert!(inside.iter().all(|[x, y]| area.contains(*x, *y)));
        assert!(!outside.iter().any(|[x, y]| area.contains(*x, *y)));
    }

    #[test]
    fn well_known_binary_has_the_length_of_its_corners() {
        let polygon = Polygon {
            outer: square(0.0, 1.0),
            holes: vec![],
        };
        let wkb = Area::new(&Region::Polygons(vec![polygon]))
            .unwrap()
            .polygons_wkb()
            .unwrap();
        assert_eq!(wkb.len(), 9 + 9 + 4 + 5 * 16);
        assert_eq!(area("global").polygons_wkb(), None);
    }

    #[test]
    fn hostile_polygons_are_refused() {
        let region = |outer| {
            Region::Polygons(vec![Polygon {
                outer,
                holes: vec![],
            }])
        };
        for outer in [
            vec![],
            vec![[0.0, 0.0], [1.0, 1.0]],
            vec![[0.0, 0.0], [f64::NAN, 1.0], [1.0, 0.0]],
            vec![[0.0, 0.0], [1e300, 1.0], [1.0, 0.0]],
            vec![[0.0, 0.0]; MAX_CORNERS + 1],
        ] {
            assert!(Area::new(&region(outer)).is_err());
        }
    }
}
