//! Coordinates of samples: for each cell of a measured variable, where, when, how deep and of which platform it is.

use super::argo;
use super::epic;
use super::pressure;
use super::sampling::Sampling;
use super::values::read;
use crate::error::Stop;
use crate::inspect::file::description::{Description, Dimension, Variable};
use crate::inspect::reader::session::Session;
use crate::plan::cf::coordinate::{Role, role_of, turned};

/// What a coordinate says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Says {
    Time,
    Latitude,
    Longitude,
    Depth,
    /// How deep a sample is, by the pressure there.
    Pressure,
}

/// Values of a coordinate and how to find that of a cell.
#[derive(Debug, Clone)]
pub(super) struct Coordinate {
    pub(super) name: String,
    pub(super) values: Vec<f64>,
    /// For each of its dimensions: which index of the cell goes there, and how far one step is.
    steps: Vec<(Index, usize)>,
}

/// Where the index of a dimension comes from.
#[derive(Debug, Clone, Copy)]
enum Index {
    /// The cell's own index at this place.
    Own(usize),
    /// The instance that the sample at this place belongs to.
    Instance(usize),
    /// The ship or station of the cast at this place.
    OwnerOfCast(usize),
    /// The ship or station of the cast that the sample at this place belongs to.
    Owner(usize),
    /// The dimension has one element.
    Only,
}

impl Coordinate {
    fn position(&self, cell: &[usize], sampling: &Sampling) -> usize {
        let step = |(index, stride): &(Index, usize)| {
            let at = match index {
                Index::Own(place) => cell[*place],
                Index::Instance(place) => sampling.instance_of(cell[*place]),
                Index::OwnerOfCast(place) => sampling.owner_of(cell[*place]),
                Index::Owner(place) => sampling.owner_of(sampling.instance_of(cell[*place])),
                Index::Only => 0,
            };
            at * stride
        };
        self.steps.iter().map(step).sum()
    }

    /// Does it say something of each index of the measured variable's dimension at this place?
    pub(super) fn varies_along(&self, place: usize) -> bool {
        let is_own =
            |(index, _): &(Index, usize)| matches!(index, Index::Own(own) if *own == place);
        self.steps.iter().any(is_own)
    }

    /// The value that belongs to a cell; NaN if there is none.
    pub(super) fn at(&self, cell: &[usize], sampling: &Sampling) -> f64 {
        let position = self.position(cell, sampling);
        self.values.get(position).copied().unwrap_or(f64::NAN)
    }
}

/// What a variable says of samples, if it is a coordinate.
pub(super) fn says(variable: &Variable) -> Option<Says> {
    match role_of(variable) {
        Role::Latitude => return Some(Says::Latitude),
        Role::Longitude => return Some(Says::Longitude),
        Role::Time => return Some(Says::Time),
        Role::Other => {}
    }
    let text = |name: &str| {
        variable
            .attributes
            .text(name)
            .unwrap_or_default()
            .to_ascii_lowercase()
    };
    let name = variable.name.to_ascii_lowercase();
    let is_depth = text("axis") == "z"
        || matches!(
            text("standard_name").as_str(),
            "depth" | "height" | "altitude"
        )
        || matches!(text("positive").as_str(), "up" | "down")
        || matches!(
            name.as_str(),
            "depth" | "depth_m" | "z" | "height" | "altitude"
        )
        || variable.is_coordinate() && epic::code_of(variable) == Some(epic::DEPTH);
    is_depth.then_some(Says::Depth)
}

/// How a cell of `measured` finds its value among those along these dimensions; none if it cannot.
fn steps(
    dimensions: &[Dimension],
    measured: &Variable,
    sampling: &Sampling,
) -> Option<Vec<(Index, usize)>> {
    let mut stride = 1usize;
    let mut steps = vec![];
    for dimension in dimensions.iter().rev() {
        let own = measured
            .dimensions
            .iter()
            .position(|d| d.name.is_some() && d.name == dimension.name && d.len == dimension.len);
        let place_of = |wanted: Option<&str>| {
            let mut own = measured.dimensions.iter();
            own.position(|d| d.name.is_some() && d.name.as_deref() == wanted)
        };
        let is_along =
            |wanted: Option<&str>| wanted.is_some() && dimension.name.as_deref() == wanted;
        let sample = || place_of(sampling.sample_dimension());
        let through = || {
            if is_along(sampling.instance_dimension()) {
                return sample().map(Index::Instance);
            }
            if is_along(sampling.owner_dimension()) {
                let cast = place_of(sampling.instance_dimension()).map(Index::OwnerOfCast);
                return cast.or_else(|| sample().map(Index::Owner));
            }
            None
        };
        let index = own.map(Index::Own).or_else(through);
        let index = index.or((dimension.len == 1).then_some(Index::Only))?;
        steps.push((index, stride));
        stride = stride.checked_mul(usize::try_from(dimension.len).ok()?)?;
    }
    Some(steps)
}

/// The coordinate of a kind that fits a measured variable best: one that it names, then one that is a dimension of it,
/// then any other.
pub(super) async fn find(
    session: &mut Session,
    file: &Description,
    measured: &Variable,
    sampling: &Sampling,
    what: Says,
) -> Result<Option<Coordinate>, Stop> {
    let named: Vec<&str> = measured
        .attributes
        .text("coordinates")
        .map_or_else(Vec::new, |text| text.split_whitespace().collect());
    let rank = |variable: &Variable| {
        let is_named = named.contains(&variable.name.as_str());
        let is_own = measured
            .dimensions
            .iter()
            .any(|d| d.name.as_deref() == Some(variable.name.as_str()));
        let is_other = argo::is_adjusted(variable) != argo::is_adjusted(measured);
        // The more dimensions, the more exactly it says where a sample is.
        let inexact = usize::MAX - variable.dimensions.len();
        (!is_named, !is_own, inexact, is_other)
    };
    let is_it = |v: &Variable| match what {
        Says::Pressure => pressure::is_pressure(v),
        _ => says(v) == Some(what),
    };
    let fits = |v: &&Variable| {
        v.name != measured.name && v.is_numeric() && is_it(v) && !epic::is_measured_place(v)
    };
    let mut best = file.variables.iter().filter(fits).collect::<Vec<_>>();
    best.sort_by_key(|v| rank(v));
    let found = best
        .into_iter()
        .find_map(|v| steps(&v.dimensions, measured, sampling).map(|steps| (v, steps)));
    let Some((variable, steps)) = found else {
        return Ok(None);
    };
    Ok(Some(Coordinate {
        name: variable.name.clone(),
        values: turned(variable, read(session, variable).await?),
        steps,
    }))
}

/// The coordinate of a variable of the same shape (or less) as a measured one: its flags, say.
pub(super) async fn beside(
    session: &mut Session,
    variable: &Variable,
    measured: &Variable,
    sampling: &Sampling,
) -> Result<Option<Coordinate>, Stop> {
    let Some(steps) = steps(&variable.dimensions, measured, sampling) else {
        return Ok(None);
    };
    Ok(Some(Coordinate {
        name: variable.name.clone(),
        values: read(session, variable).await?,
        steps,
    }))
}

/// Values along dimensions of the file as a coordinate of a measured variable; none if it does not have these.
pub(super) fn along(
    name: &str,
    (dimensions, values): (&[Dimension], Vec<f64>),
    measured: &Variable,
    sampling: &Sampling,
) -> Option<Coordinate> {
    Some(Coordinate {
        name: name.to_owned(),
        values,
        steps: steps(dimensions, measured, sampling)?,
    })
}
