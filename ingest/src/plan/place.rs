//! Where the cells of a variable are: its axes, or the grid a profile states.

use contract::event::RejectReason;

use super::Planning;
use super::edges::{self, Along, Cells};
use crate::error::{Rejection, Stop};
use crate::inspect::file::description::{Dimension, Variable};
use crate::inspect::values::Values;
use crate::plan::cf::axis::{Labels, Mapping, Registration};
use crate::plan::cf::coordinate::{self, Axis, Evidence, Role};
use crate::plan::cf::corner;
use crate::plan::cf::projection;
use crate::plan::profile::{GridRules, StatedGrid, TimeSource};

/// Longitudes of axes that begin anywhere and go once around stay below.
const MAX_LON_DEG: f64 = 540.0;

fn refused(object: &str, detail: impl AsRef<str>) -> Rejection {
    Rejection::new(RejectReason::Grid, object, detail)
}

/// The axes of a variable and the place of every grid cell in it.
pub(super) async fn mapping(
    planning: &mut Planning<'_>,
    variable: &Variable,
) -> Result<(Vec<Axis>, Mapping), Stop> {
    let rules = planning.profile.map(|p| p.grid.clone()).unwrap_or_default();
    projection::check(planning.file, variable)?;
    if let Some(name) = projection::missing(planning.file, variable) {
        let what = match planning.values.unread(name) {
            Some(_) => "cannot be read",
            None => "is not in the file",
        };
        planning.assume(format!(
            "{}: its grid_mapping {name:?} {what}; its axes are taken for latitude and longitude",
            variable.name
        ));
    }
    let mut axes = coordinate::axes(planning.file, variable);
    name_axes(planning, variable, &rules, &mut axes)?;
    name_time(planning, variable, &mut axes);
    let find = |role: Role| axes.iter().find(|a| a.role == role).cloned();
    let (Some(lat), Some(lon)) = (find(Role::Latitude), find(Role::Longitude)) else {
        let names = variable.dimensions.iter();
        let unread = planning.unread(names.filter_map(|own| own.name.as_deref()));
        let no_grid = || coordinate::no_grid(planning.file, variable);
        return Err(unread.unwrap_or_else(no_grid).into());
    };
    let is_of_a_store = matches!(planning.values, Values::Arrays(_));
    check_others(variable, &axes, is_of_a_store)?;
    let (cells, most) = (
        u128::from(lat.len) * u128::from(lon.len),
        planning.limits.plane_cells,
    );
    if cells > u128::from(most) || cells == 0 {
        let detail = format!(
            "has {} x {} cells in one map, 1 to {most} are read; give it in smaller pieces",
            lat.len, lon.len
        );
        let reason = if cells == 0 {
            RejectReason::Grid
        } else {
            RejectReason::TooLarge
        };
        return Err(Rejection::new(reason, &variable.name, detail).into());
    }
    if planning.profile.is_none() {
        told_by_length(planning, variable, &axes)?;
    }
    let mapping = match &rules.stated {
        Some(stated) => stated_mapping(variable, stated, &lat, &lon)?,
        None => read_mapping(planning, &rules, &lat, &lon).await?,
    };
    if (mapping.file_cols.len() as u64) < lon.len {
        let gone = if mapping.file_cols.contains(&0) {
            "last"
        } else {
            "first"
        };
        planning.assume(format!(
            "{}: its first and its last column are a turn apart, which is one place; the {gone} is left out, whatever it holds",
            lon.coordinate.as_ref().unwrap_or(&variable.name)
        ));
    }
    Ok((axes, mapping))
}

/// Gives the axes the roles that a profile states.
fn name_axes(
    planning: &Planning<'_>,
    variable: &Variable,
    rules: &GridRules,
    axes: &mut [Axis],
) -> Result<(), Rejection> {
    for (name, role) in [
        (&rules.latitude, Role::Latitude),
        (&rules.longitude, Role::Longitude),
    ] {
        let Some(name) = name else { continue };
        let missing = || {
            refused(
                name,
                "is no axis of the variable; name another one in the profile",
            )
        };
        let coordinate = planning.file.variable(name).ok_or_else(missing)?;
        projection::check_coordinate(coordinate)?;
        let dimension = coordinate.dimensions.first().ok_or_else(missing)?;
        let is_along = |(_, own): &(&mut Axis, &Dimension)| *own == dimension;
        let (axis, _) = axes
            .iter_mut()
            .zip(&variable.dimensions)
            .find(is_along)
            .ok_or_else(missing)?;
        axis.role = role;
        axis.coordinate = Some(name.clone());
    }
    let Some(stated) = &rules.stated else {
        return Ok(());
    };
    let rank = axes.len();
    if rank < 2 {
        return Err(refused(
            &variable.name,
            format!("has {rank} dimensions where a map has two"),
        ));
    }
    let named = |name: &String| {
        variable
            .dimensions
            .iter()
            .position(|d| d.name.as_ref() == Some(name))
    };
    let places = stated
        .dimensions
        .as_ref()
        .and_then(|[lat, lon]| Some([named(lat)?, named(lon)?]));
    let [lat, lon] = places.unwrap_or([rank - 2, rank - 1]);
    axes[lat].role = Role::Latitude;
    axes[lon].role = Role::Longitude;
    Ok(())
}

/// Finds the time axis that a profile speaks of: that of its time variable, or, where steps are counted, the only
/// axis left that has steps.
fn name_time(planning: &Planning<'_>, variable: &Variable, axes: &mut [Axis]) {
    let Some(rules) = planning.profile.and_then(|p| p.time.as_ref()) else {
        return;
    };
    let along = match &rules.from {
        TimeSource::Variable { name, .. } => planning
            .file
            .variable(name)
            .and_then(|v| v.dimensions.first()),
        TimeSource::MonthNumber => {
            let mut left = axes
                .iter()
                .zip(&variable.dimensions)
                .filter(|(a, _)| a.role == Role::Other && a.len > 1);
            let only = left.next().map(|(_, dimension)| dimension);
            only.filter(|_| left.next().is_none())
        }
        TimeSource::Attribute(_) | TimeSource::FileName(_) | TimeSource::Fixed(_) => None,
    };
    let is_along =
        |(axis, own): &(&mut Axis, &Dimension)| axis.role == Role::Other && Some(*own) == along;
    if axes.iter().all(|a| a.role != Role::Time)
        && let Some((axis, _)) = axes.iter_mut().zip(&variable.dimensions).find(is_along)
    {
        axis.role = Role::Time;
    }
}

/// Refuses two axes of one role, and further axes of more than one level.
fn check_others(variable: &Variable, axes: &[Axis], is_of_a_store: bool) -> Result<(), Rejection> {
    for role in [Role::Latitude, Role::Longitude, Role::Time] {
        if axes.iter().filter(|a| a.role == role).count() > 1 {
            return Err(refused(
                &variable.name,
                format!("has two {role:?} axes; name them in a profile"),
            ));
        }
    }
    let both = axes.iter().zip(&variable.dimensions);
    let deep: Vec<&Dimension> = both
        .filter(|(axis, _)| axis.role == Role::Other && axis.len != 1)
        .map(|(_, dimension)| dimension)
        .collect();
    if deep.is_empty() {
        return Ok(());
    }
    let levels = |dimension: &&Dimension| {
        let name = dimension.name.as_deref().unwrap_or("without a name");
        format!("{} levels along dimension {name:?}", dimension.len)
    };
    let index = |dimension: &&Dimension| {
        let name = dimension.name.as_ref()?;
        let last = dimension.len.saturating_sub(1);
        Some(format!(" --index {name}=N (0 to {last})"))
    };
    let indexes: Option<String> = deep.iter().map(index).collect();
    let advice = match indexes {
        Some(indexes) => format!("say which is read:{indexes}"),
        None if !is_of_a_store => "name its dimensions, as NetCDF-4 and dimension scales of HDF5 do, so that --index can say which is read, or give a file with one level".to_owned(),
        None => "name its dimensions (dimension_names, in version 2 _ARRAY_DIMENSIONS), so that --index can say which is read".to_owned(),
    };
    let levels: Vec<String> = deep.iter().map(levels).collect();
    let detail = format!("has {}; {advice}", levels.join(" and "));
    Err(refused(&variable.name, detail))
}

/// Notes axes that nothing but their length tells, and refuses those that their length does not tell.
fn told_by_length(
    planning: &mut Planning<'_>,
    variable: &Variable,
    axes: &[Axis],
) -> Result<(), Rejection> {
    let unnamed = axes.iter().zip(&variable.dimensions);
    let unnamed = unnamed.filter(|(_, dimension)| dimension.name.is_none());
    for (axis, dimension) in unnamed {
        let Some(coordinate) = &axis.coordinate else {
            continue;
        };
        let is_other = |other: &&Variable| {
            let role = coordinate::role_of(other);
            other.is_coordinate()
                && other.is_numeric()
                && other.dimensions[0].len == dimension.len
                && role != Role::Other
                && role != axis.role
        };
        if let Some(other) = planning.file.variables.iter().find(is_other) {
            let detail = format!(
                "names no dimensions, and {coordinate} and {} are of one length: nothing says which goes along which axis; name its dimensions, or give a profile that states the grid",
                other.name
            );
            return Err(refused(&variable.name, detail));
        }
        planning.assume(format!(
            "{}: names no dimensions; that of {} is taken for {coordinate}, which alone is as long",
            variable.name, dimension.len
        ));
    }
    Ok(())
}

fn stated_mapping(
    variable: &Variable,
    stated: &StatedGrid,
    lat: &Axis,
    lon: &Axis,
) -> Result<Mapping, Rejection> {
    let (rows, cols) = (u64::from(stated.grid.rows), u64::from(stated.grid.cols));
    if (lat.len, lon.len) != (rows, cols) {
        let detail = format!(
            "has {} x {} cells, its profile states {rows} x {cols}; give the profile that fits",
            lat.len, lon.len
        );
        return Err(refused(&variable.name, detail));
    }
    Mapping::from_grid(stated.grid, stated.north_first)
}

async fn read_mapping(
    planning: &mut Planning<'_>,
    rules: &GridRules,
    lat: &Axis,
    lon: &Axis,
) -> Result<Mapping, Stop> {
    let name = |axis: &Axis| axis.coordinate.clone().unwrap_or_default();
    let names = [name(lat), name(lon)];
    let (lat_deg, lon_deg) = (
        planning.coordinate(&names[0]).await?,
        planning.coordinate(&names[1]).await?,
    );
    if (lat_deg.len() as u64, lon_deg.len() as u64) != (lat.len, lon.len) {
        return Err(refused(
            &names[0],
            "is not as long as the variable's dimension; the file is damaged",
        )
        .into());
    }
    for (name, labels, stated, most_deg) in [
        (&names[0], &lat_deg, &rules.latitude, 90.0),
        (&names[1], &lon_deg, &rules.longitude, MAX_LON_DEG),
    ] {
        if stated.is_none() {
            check_evidence(planning, name, labels, most_deg)?;
        }
    }
    let (lat, lon) = if rules.registration.is_none() {
        (
            edges::cells(planning, (&names[0], lat_deg), Along::Latitude).await?,
            edges::cells(planning, (&names[1], lon_deg), Along::Longitude).await?,
        )
    } else {
        (Cells::of(lat_deg), Cells::of(lon_deg))
    };
    let registration = registration(planning, rules, &names, [&lat.labels, &lon.labels]);
    let labels = [&lat, &lon].map(|cells| Labels {
        deg: &cells.labels,
        only_deg: cells.only_deg,
    });
    let mapping = Mapping::from_labels(labels, registration, [&names[0], &names[1]])?;
    for (name, role, labels) in [
        (&names[0], Role::Latitude, &lat.labels),
        (&names[1], Role::Longitude, &lon.labels),
    ] {
        if let Some((off_deg, cells)) = mapping.moved(role, labels, registration) {
            let short = mapping
                .short_of_poles_deg()
                .filter(|_| role == Role::Latitude);
            let short = short.map_or_else(String::new, |deg| {
                format!("; they end {deg:.5} degrees before the poles, round which nothing counts")
            });
            planning.assume(format!(
                "{name}: is not evenly spaced; its cells are taken for evenly spaced ones, the farthest {off_deg:.5} degrees ({:.1} % of a cell) from its label{short}",
                100.0 * cells
            ));
        }
    }
    Ok(mapping)
}

/// What labels name: what a profile says, else centres, unless they can only be corners.
fn registration(
    planning: &mut Planning<'_>,
    rules: &GridRules,
    names: &[String; 2],
    [lat_deg, lon_deg]: [&[f64]; 2],
) -> Registration {
    if planning.profile.is_some() {
        return rules.registration.unwrap_or_default();
    }
    let Some(corner) = corner::of(lat_deg, lon_deg) else {
        return rules.registration.unwrap_or_default();
    };
    planning.assume(format!(
        "{} and {}: as centres of cells their labels would reach past a pole; they are taken for corners ({corner:?}) of cells that cover the globe",
        names[0], names[1]
    ));
    corner
}

/// Notes an axis that nothing but its name makes a latitude or longitude, and refuses it if it cannot be one.
fn check_evidence(
    planning: &mut Planning<'_>,
    name: &str,
    labels: &[f64],
    most_deg: f64,
) -> Result<(), Rejection> {
    let found = planning.file.variable(name).and_then(coordinate::evidence);
    let Some((role, Evidence::NameAlone)) = found else {
        return Ok(());
    };
    let role = format!("{role:?}").to_lowercase();
    if let Some(bad) = labels.iter().find(|label| label.abs() > most_deg) {
        let detail = format!(
            "holds {bad}, which is no {role} in degrees, and has neither units nor standard_name; say in a profile what it is, or regrid the file"
        );
        return Err(refused(name, detail));
    }
    planning.assume(format!(
        "{name}: is taken for the {role} by its name alone; it has neither units (degrees_north, degrees_east) nor standard_name"
    ));
    Ok(())
}
