//! Where the cells of an axis are by its bounds (CF 7.1): nothing new where its labels are their middles, else these; of one label
//! alone nothing else says how wide its cell is.

use contract::event::RejectReason;
use contract::grid::wrap_lon_deg;

use super::pairs::Layout;
use super::{Planning, no_bounds};
use crate::error::{Rejection, Stop};
use crate::inspect::file::description::Part;
use crate::plan::cf::coordinate;
use crate::plan::cf::packing::Packing;

/// How far bounds may be off, in cells: those of single precision are.
const TOLERANCE_CELLS: f64 = 0.02;

/// What a profile can state where bounds cannot be read.
const INSTEAD: &str = "the grid";

/// What an axis is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Along {
    Latitude,
    Longitude,
}

/// Where the cells of an axis are.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cells {
    /// Their middles, or what else its labels name.
    pub(super) labels: Vec<f64>,
    /// The width of the one cell of one label, degrees.
    pub(super) only_deg: Option<f64>,
}

impl Cells {
    /// Cells of which nothing is known but the labels.
    pub(super) fn of(labels: Vec<f64>) -> Self {
        Self {
            labels,
            only_deg: None,
        }
    }
}

/// The middles of the cells of an axis: its labels, unless its bounds say otherwise.
///
/// # Errors
/// Bounds that are there and cannot be read, or are no cells side by side as the labels are.
pub(super) async fn cells(
    planning: &mut Planning<'_>,
    (name, labels): (&str, Vec<f64>),
    along: Along,
) -> Result<Cells, Stop> {
    let bounds = planning.file.variable(name);
    let bounds = bounds.and_then(|axis| axis.attributes.text("bounds"));
    let Some(bounds) = bounds.map(str::to_owned) else {
        return Ok(Cells::of(labels));
    };
    let Some(edges) = read(planning, (name, labels.len() as u64), &bounds).await? else {
        planning.assume(format!(
            "{name}: names bounds {bounds:?}, which are not there; its labels are taken for the middles of cells"
        ));
        return Ok(Cells::of(labels));
    };
    let wrong = |reason: String| {
        let detail = format!("{reason}; correct them, or state the grid in a profile");
        Rejection::new(RejectReason::Grid, &bounds, detail)
    };
    let told = format!(
        "{name}: its labels are not the middles of its cells, which lie where its bounds {bounds:?} say"
    );
    if let ([label], [pair]) = (&labels[..], &edges[..]) {
        let (middle, width_deg) = only(*label, *pair, along).map_err(wrong)?;
        if (middle - label).abs() > TOLERANCE_CELLS * width_deg {
            planning.assume(told);
        }
        return Ok(Cells {
            labels: vec![middle],
            only_deg: Some(width_deg),
        });
    }
    let Some(found) = otherwise(&labels, &edges, along).map_err(wrong)? else {
        return Ok(Cells::of(labels));
    };
    planning.assume(told);
    Ok(Cells::of(found))
}

/// Two edges for each of so many labels; none if the bounds are not there.
async fn read(
    planning: &mut Planning<'_>,
    (name, count): (&str, u64),
    bounds: &str,
) -> Result<Option<Vec<[f64; 2]>>, Stop> {
    let Some(held) = planning.bounds_of((name, bounds), INSTEAD)? else {
        return Ok(None);
    };
    let lens: Vec<u64> = held.dimensions.iter().map(|own| own.len).collect();
    // Programs that put files one behind the other give bounds a time, as they do the values.
    let is_repeated = lens.ends_with(&[count, 2]) && !lens.contains(&0);
    let (layout, more) = match Layout::of(&lens, count) {
        Some(layout) => (Some(layout), 0),
        None if is_repeated => (Some(Layout::Pairs), lens.len() - 2),
        None => (None, 0),
    };
    let Some(layout) = layout.filter(|_| held.is_numeric()) else {
        let detail = no_bounds(held, count, INSTEAD);
        return Err(Rejection::new(RejectReason::Grid, name, detail).into());
    };
    if more > 0 {
        planning.assume(format!(
            "{name}: its bounds {bounds:?} have more dimensions than it has; the first of each is taken"
        ));
    }
    if let Some(told) = layout.told() {
        planning.assume(format!("{name}: its bounds {bounds:?} are {told}"));
    }
    let parts = [vec![Part::At(0); more], vec![Part::All; lens.len() - more]].concat();
    // What is valid is said of labels, and edges may lie beyond.
    let packing = Packing::of(held).with_valid_values(f64::NEG_INFINITY, f64::INFINITY);
    let number_count = layout.number_count(count);
    let stored = planning.values.read(bounds, &parts, number_count).await?;
    let mut values: Vec<f64> = stored.into_iter().map(|it| packing.value(it)).collect();
    // Bounds are in the units of what they bound.
    if let Some(axis) = planning.file.variable(name) {
        values = coordinate::turned(axis, values);
    }
    Ok(Some(layout.pairs(&values)))
}

/// Middle and width, degrees, of the one cell of one label.
fn only(label: f64, [one, other]: [f64; 2], along: Along) -> Result<(f64, f64), String> {
    let cell = |one: f64, other: f64| (f64::midpoint(one, other), (other - one).abs());
    let holds = |(middle, width_deg): &(f64, f64)| {
        *width_deg > 0.0
            && width_deg.is_finite()
            && (label - middle).abs() <= (0.5 + TOLERANCE_CELLS) * width_deg
    };
    let found = match along {
        Along::Latitude => Some(cell(one, other)).filter(holds),
        // Both within half a turn of the label; of a cell all round the earth these are one, and they are taken as they are written.
        Along::Longitude => {
            let near = |edge: f64| label + wrap_lon_deg(edge - label);
            let near = Some(cell(near(one), near(other))).filter(holds);
            let written = || Some(cell(one, other)).filter(|found| one < other && holds(found));
            near.or_else(written)
        }
    };
    found.ok_or_else(|| {
        format!("has a cell from {one} to {other} at the label {label}, which is not in it")
    })
}

/// The middles of cells by their edges, where they are not the labels.
fn otherwise(labels: &[f64], edges: &[[f64; 2]], along: Along) -> Result<Option<Vec<f64>>, String> {
    let [Some(first), Some(last)] = [labels.first(), labels.last()] else {
        return Ok(None);
    };
    let gaps = labels.len().saturating_sub(1).max(1) as f64;
    let cell = match along {
        Along::Latitude => (last - first).abs() / gaps,
        // However often the labels jump back by a turn.
        Along::Longitude => {
            let steps = labels.windows(2).map(|two| wrap_lon_deg(two[1] - two[0]));
            steps.sum::<f64>().abs() / gaps
        }
    };
    if !(cell.is_finite() && cell > 0.0) {
        // Refused by their labels.
        return Ok(None);
    }
    let farthest = edges
        .iter()
        .flatten()
        .fold(0.0, |most: f64, edge| most.max(edge.abs()));
    let tolerance = TOLERANCE_CELLS * cell + 2.0 * f64::from(f32::EPSILON) * farthest;
    let near = |one: f64, other: f64| (one - other).abs() <= tolerance;
    let mut middles = Vec::with_capacity(labels.len());
    let (mut is_of_labels, mut odd) = (true, None);
    for (label, pair) in labels.iter().zip(edges) {
        if let Some(bad) = pair.iter().find(|edge| !edge.is_finite()) {
            return Err(format!("holds {bad}, which is no edge of a cell"));
        }
        let edge = |edge: f64| match along {
            Along::Latitude => edge,
            Along::Longitude => label + wrap_lon_deg(edge - label),
        };
        let [one, other] = pair.map(edge);
        let (low, high) = (one.min(other), one.max(other));
        // Cells around a label at a pole end there.
        let ends = match along {
            Along::Latitude => [
                (label - cell / 2.0).max(-90.0),
                (label + cell / 2.0).min(90.0),
            ],
            Along::Longitude => [label - cell / 2.0, label + cell / 2.0],
        };
        is_of_labels &= near(low, ends[0]) && near(high, ends[1]);
        if !near(high - low, cell) || *label < low - tolerance || *label > high + tolerance {
            odd.get_or_insert((*label, pair));
        }
        middles.push(f64::midpoint(low, high));
    }
    match odd {
        _ if is_of_labels => Ok(None),
        Some((label, [one, other])) => Err(format!(
            "has a cell from {one} to {other} at the label {label}, where labels stand {cell} degrees apart: these are no cells side by side"
        )),
        None => Ok(Some(middles)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edges(middles: &[f64], cell: f64) -> Vec<[f64; 2]> {
        let of = |middle: &f64| [middle - cell / 2.0, middle + cell / 2.0];
        middles.iter().map(of).collect()
    }

    #[test]
    fn bounds_about_labels_say_nothing_new() {
        let lat = [85.0, 75.0, 65.0];
        let own = edges(&lat, 10.0);
        assert_eq!(otherwise(&lat, &own, Along::Latitude), Ok(None));
        // The other way round, and of single precision.
        let turned: Vec<[f64; 2]> = own.iter().map(|[a, b]| [b + 1e-5, *a]).collect();
        assert_eq!(otherwise(&lat, &turned, Along::Latitude), Ok(None));
        let poles = [[-90.0, -89.5], [-89.5, -88.5], [-88.5, -87.5]];
        let found = otherwise(&[-90.0, -89.0, -88.0], &poles, Along::Latitude);
        assert_eq!(found, Ok(None));
        // Across the date line, and around the earth.
        let lon = [170.0, -180.0, -170.0];
        let own = [[165.0, 175.0], [175.0, 185.0], [-175.0, -165.0]];
        assert_eq!(otherwise(&lon, &own, Along::Longitude), Ok(None));
        assert_eq!(
            otherwise(
                &[0.0, 120.0, 240.0],
                &edges(&[0.0, 120.0, 240.0], 120.0),
                Along::Longitude
            ),
            Ok(None)
        );
    }

    #[test]
    fn labels_at_the_edge_of_their_cells_give_way_to_bounds() {
        let found = otherwise(
            &[-80.0, -70.0, -60.0],
            &edges(&[-75.0, -65.0, -55.0], 10.0),
            Along::Latitude,
        );
        assert_eq!(found, Ok(Some(vec![-75.0, -65.0, -55.0])));
        let found = otherwise(
            &[350.0, 0.0, 10.0],
            &[[350.0, 360.0], [0.0, 10.0], [10.0, 20.0]],
            Along::Longitude,
        );
        assert_eq!(found, Ok(Some(vec![355.0, 5.0, 15.0])));
    }

    #[test]
    fn the_cell_of_one_label_is_what_its_bounds_say() {
        let lat = |label, pair| only(label, pair, Along::Latitude);
        let lon = |label, pair| only(label, pair, Along::Longitude);
        assert_eq!(lat(0.0, [-5.0, 5.0]), Ok((0.0, 10.0)));
        assert_eq!(lat(0.0, [5.0, -5.0]), Ok((0.0, 10.0)));
        assert_eq!(lat(0.0, [0.0, 10.0]), Ok((5.0, 10.0)));
        // All round the earth, and across the date line or Greenwich's meridian.
        assert_eq!(lon(0.0, [-180.0, 180.0]), Ok((0.0, 360.0)));
        assert_eq!(lon(180.0, [0.0, 360.0]), Ok((180.0, 360.0)));
        assert_eq!(lon(180.0, [175.0, -175.0]), Ok((180.0, 10.0)));
        assert_eq!(lon(0.0, [350.0, 10.0]), Ok((0.0, 20.0)));
        for refused in [
            lat(20.0, [-5.0, 5.0]),
            lat(0.0, [0.0, 0.0]),
            lat(0.0, [f64::NAN, 5.0]),
            lat(0.0, [-5.0, f64::INFINITY]),
            lon(90.0, [350.0, 10.0]),
        ] {
            assert!(refused.unwrap_err().contains("at the label"));
        }
    }

    #[test]
    fn what_are_no_cells_side_by_side_is_refused() {
        let lat = [-80.0, -70.0, -60.0];
        let narrow = otherwise(&lat, &edges(&lat, 2.0), Along::Latitude).unwrap_err();
        assert!(
            narrow.contains("from -81 to -79 at the label -80"),
            "{narrow}"
        );
        let elsewhere = edges(&[10.0, 20.0, 30.0], 10.0);
        assert!(otherwise(&lat, &elsewhere, Along::Latitude).is_err());
        let mut missing = edges(&lat, 10.0);
        missing[1][0] = f64::NAN;
        let missing = otherwise(&lat, &missing, Along::Latitude).unwrap_err();
        assert!(missing.contains("NaN"), "{missing}");
    }
}
