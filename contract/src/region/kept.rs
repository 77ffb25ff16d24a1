//! A region as manifests keep it: every number as text, which is read as the very number that was written.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::text::checked;
use super::{AskedRegion, Polygon, Region};
use crate::ContractError;

/// Most corners that are kept: some 400 kB of a manifest, which is read whenever products are listed.
pub const MAX_KEPT_CORNERS: usize = 10_000;

/// A region that something was asked of, kept to ask it again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptRegion {
    /// What answers call it.
    pub name: String,
    /// Absent where it has more than [`MAX_KEPT_CORNERS`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shape: Option<Shape>,
}

/// Degrees; shortest decimals that are read as the same numbers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Shape {
    Global,
    /// `west,south,east,north`
    Box(String),
    /// Of each its rings, the outer one first: `lon lat,lon lat,...`
    Polygons(Vec<Vec<String>>),
}

impl KeptRegion {
    /// What is kept of a region.
    pub fn of(asked: &AskedRegion) -> Self {
        let rings = |polygon: &Polygon| {
            let rings = std::iter::once(&polygon.outer).chain(&polygon.holes);
            rings.map(|ring| ring_text(ring)).collect()
        };
        let shape = match &asked.region {
            Region::Global => Some(Shape::Global),
            Region::Box {
                west,
                south,
                east,
                north,
            } => Some(Shape::Box(format!("{west},{south},{east},{north}"))),
            Region::Polygons(polygons) => (corners(polygons) <= MAX_KEPT_CORNERS)
                .then(|| Shape::Polygons(polygons.iter().map(rings).collect())),
        };
        Self {
            name: asked.name.clone(),
            shape,
        }
    }

    /// Can it be asked for again?
    pub fn is_whole(&self) -> bool {
        self.shape.is_some()
    }

    /// The region that was asked for, bit for bit.
    ///
    /// # Errors
    /// It has too many corners to have been kept; what is kept is none.
    pub fn asked(&self) -> Result<AskedRegion, ContractError> {
        let bad = |reason: &str| ContractError::invalid("kept region", &self.name, reason);
        let numbers = |text: &str, by: char| -> Result<Vec<f64>, ContractError> {
            let all: Vec<f64> = text.split(by).map_while(|one| one.parse().ok()).collect();
            let is_whole = all.len() == text.split(by).count();
            let is_finite = all.iter().all(|one| one.is_finite());
            let read = (is_whole && is_finite).then_some(all);
            read.ok_or_else(|| bad("its numbers cannot be read"))
        };
        let ring = |text: &String| -> Result<Vec<[f64; 2]>, ContractError> {
            let corners = text.split(',').map(|corner| {
                let both = numbers(corner, ' ')?;
                <[f64; 2]>::try_from(both).map_err(|_count| bad("a corner is two numbers"))
            });
            corners.collect()
        };
        let polygon = |rings: &Vec<String>| -> Result<Polygon, ContractError> {
            let (outer, holes) = rings.split_first().ok_or_else(|| bad("it has no ring"))?;
            let holes = holes.iter().map(ring).collect::<Result<_, _>>()?;
            Ok(Polygon {
                outer: ring(outer)?,
                holes,
            })
        };
        let region = match &self.shape {
            None => return Err(bad("it has too many corners to be kept")),
            Some(Shape::Global) => Region::Global,
            Some(Shape::Box(edges)) => {
                let edges = <[f64; 4]>::try_from(numbers(edges, ',')?);
                let [west, south, east, north] =
                    edges.map_err(|_count| bad("a box has four edges"))?;
                // Checked, and kept as it was: edges that are wrapped again may move by a bit.
                Region::new_box(west, south, east, north)?;
                Region::Box {
                    west,
                    south,
                    east,
                    north,
                }
            }
            Some(Shape::Polygons(polygons)) => {
                let polygons: Result<Vec<Polygon>, ContractError> =
                    polygons.iter().map(polygon).collect();
                Region::Polygons(checked(polygons?).map_err(|reason| bad(&reason))?)
            }
        };
        Ok(AskedRegion {
            region,
            name: self.name.clone(),
        })
    }
}

fn corners(polygons: &[Polygon]) -> usize {
    let of =
        |polygon: &Polygon| polygon.outer.len() + polygon.holes.iter().map(Vec::len).sum::<usize>();
    polygons.iter().map(of).sum()
}

fn ring_text(ring: &[[f64; 2]]) -> String {
    let mut text = String::new();
    for [lon, lat] in ring {
        let comma = if text.is_empty() { "" } else { "," };
        write!(text, "{comma}{lon} {lat}").expect("text takes everything");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::NAMED_REGIONS;

    fn again(asked: &AskedRegion) -> (String, AskedRegion) {
        let json = serde_json::to_string(&KeptRegion::of(asked)).unwrap();
        let kept: KeptRegion = serde_json::from_str(&json).unwrap();
        (json, kept.asked().unwrap())
    }

    /// Bytes that are stored in manifests.
    #[test]
    fn what_is_kept_is_asked_again_bit_for_bit() {
        for (text, stored) in [
            ("global", r#"{"name":"global","shape":"global"}"#),
            (
                "170,-10,-170,10",
                r#"{"name":"170,-10,190,10","shape":{"box":"170,-10,190,10"}}"#,
            ),
            (
                "POLYGON((0 0,9 0,9 9.5,0 0),(1 1,2 1,2 2,1 1))",
                r#"{"name":"POLYGON((0 0,9 0,9 9.5,0 0),(1 1,2 1,2 2,1 1))","shape":{"polygons":[["0 0,9 0,9 9.5,0 0","1 1,2 1,2 2,1 1"]]}}"#,
            ),
        ] {
            let asked: AskedRegion = text.parse().unwrap();
            assert_eq!(again(&asked), (stored.to_owned(), asked), "{text}");
        }
        for named in NAMED_REGIONS {
            let asked: AskedRegion = named.name.parse().unwrap();
            assert_eq!(again(&asked).1, asked, "{}", named.name);
        }
        // Numbers that JSON would be read a bit beside of.
        let mut bits = 0x3ff0_0000_0000_0001_u64;
        let mut number = || {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (bits >> 11) as f64 / 1e14
        };
        let outer: Vec<[f64; 2]> = (0..1000).map(|_| [number(), number()]).collect();
        let asked = AskedRegion {
            region: Region::Polygons(vec![Polygon {
                outer,
                holes: vec![],
            }]),
            name: "drawn.geojson".to_owned(),
        };
        assert_eq!(again(&asked).1, asked);
        let box_of = |west: f64| AskedRegion {
            region: Region::new_box(west, -0.1, west + 0.7, 0.2).unwrap(),
            name: "box".to_owned(),
        };
        for _ in 0..1000 {
            let asked = box_of(number().rem_euclid(360.0));
            assert_eq!(again(&asked).1, asked);
        }
    }

    #[test]
    fn a_region_of_too_many_corners_is_named_and_not_kept() {
        let of = |count: usize| AskedRegion {
            region: Region::Polygons(vec![Polygon {
                outer: vec![[0.5, 1.5]; count - 3],
                holes: vec![vec![[0.25, 1.25]; 3]],
            }]),
            name: "many.geojson".to_owned(),
        };
        assert!(KeptRegion::of(&of(MAX_KEPT_CORNERS)).is_whole());
        let kept = KeptRegion::of(&of(MAX_KEPT_CORNERS + 1));
        assert!(!kept.is_whole());
        let json = serde_json::to_string(&kept).unwrap();
        assert_eq!(json, r#"{"name":"many.geojson"}"#);
        let refused = kept.asked().unwrap_err().to_string();
        assert!(refused.contains("too many corners"), "{refused}");
    }

    #[test]
    fn what_is_no_region_is_refused() {
        for shape in [
            r#"{"box":"1,2,3"}"#,
            r#"{"box":"0,10,10,0"}"#,
            r#"{"box":"0,0,inf,1"}"#,
            r#"{"polygons":[]}"#,
            r#"{"polygons":[[]]}"#,
            r#"{"polygons":[["0 0,1 0,1"]]}"#,
            r#"{"polygons":[["0 0,x 0,1 1"]]}"#,
            r#"{"polygons":[[""]]}"#,
        ] {
            let json = format!(r#"{{"name":"bad","shape":{shape}}}"#);
            let kept: KeptRegion = serde_json::from_str(&json).unwrap();
            assert!(kept.asked().is_err(), "{shape}");
        }
    }
}
