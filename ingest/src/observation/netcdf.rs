//! NetCDF files of observations: which variables were measured, and each of their samples with place, time and flag.

use contract::event::RejectReason;
use contract::observation::{Observation, PlatformKind, Quality};
use contract::product::ProductId;
use contract::time::TimeMs;

use super::argo;
use super::convert::Given;
use super::coordinate::Coordinate;
use super::epic;
use super::gather::{Found, Gathered};
use super::measured::{self, Measured};
use super::points::Points;
use super::quality::{Verdict, worse};
use super::recognise::{Feature, recognise};
use super::sampling::Sampling;
use super::values::read_stored;
use super::{Source, name};
use crate::error::{Rejection, Stop};
use crate::inspect::file::description::Description;
use crate::inspect::reader::session::Session;
use crate::plan::cf::packing::{Packing, Unpacked};
use crate::plan::cf::period;

/// What all samples of a file share.
struct Shared {
    dataset: ProductId,
    kind: PlatformKind,
    sampling: Sampling,
    /// Single samples that nothing in the file tells apart.
    points: Option<Points>,
}

/// Reads a file that [`recognise`] knows.
pub(super) async fn read(
    session: &mut Session,
    file: &Description,
    source: Source<'_>,
) -> Result<Found, Stop> {
    let Some(feature) = recognise(file).filter(|feature| *feature != Feature::Unplaced) else {
        let detail = "has series of platforms, but nothing in the file says where the platforms are; \
                      give it with latitude, longitude and units (CF discrete sampling geometry)";
        return Err(Rejection::new(RejectReason::NoVariable, "file", detail).into());
    };
    let sampling = Sampling::of(session, file, feature, source).await?;
    let is_of_points = feature == Feature::Point && sampling.is_nameless();
    let mut shared = Shared {
        dataset: dataset(file, source),
        kind: kind(file, feature),
        sampling,
        points: is_of_points.then(Points::default),
    };
    let mut gathered = Gathered::default();
    let mut passed_over = vec![];
    for variable in file
        .variables
        .iter()
        .filter(|v| measured::is_candidate(file, v))
    {
        match measured::prepare(session, file, variable, (feature, &shared.sampling)).await? {
            Ok(measured) => {
                gathered.begin(&variable.name);
                take(session, &measured, &mut shared, &mut gathered).await?;
            }
            Err(rejection) => {
                if measured::is_of_samples(&rejection) {
                    gathered.pass_over(rejection.clone());
                }
                passed_over.push(rejection);
            }
        }
    }
    let none = || {
        let detail = "holds no measured variable with a place, a time and a unit";
        Rejection::new(RejectReason::NoVariable, "file", detail)
    };
    for rejection in &passed_over {
        tracing::info!(%rejection, file = source.file_name, "a variable is passed over");
    }
    let why = passed_over.into_iter().next().unwrap_or_else(none);
    Ok(gathered.finish(why)?)
}

fn dataset(file: &Description, source: Source<'_>) -> ProductId {
    let text = |name: &str| file.attributes.text(name).unwrap_or_default();
    let is_array = text("Data_Source").contains("Global Tropical Moored Buoy Array");
    if is_array {
        // Positions of every day lie near, not at, the place that the other files state for all days.
        let is_of_places = file.variables.iter().any(epic::is_measured_place);
        return name::dataset(
            source,
            if is_of_places {
                "gtmba-positions"
            } else {
                "gtmba"
            },
        );
    }
    name::dataset(source, name::stem(source.file_name))
}

fn kind(file: &Description, feature: Feature) -> PlatformKind {
    match feature {
        Feature::Trajectory => PlatformKind::Ship,
        Feature::Profile | Feature::TrajectoryProfile => PlatformKind::Profile,
        Feature::Point | Feature::TimeSeries | Feature::TimeSeriesProfile | Feature::Unplaced => {
            let said = ["platform_type", "platform", "title"]
                .into_iter()
                .filter_map(|name| file.attributes.text(name))
                .any(|text| {
                    let text = text.to_ascii_lowercase();
                    ["tower", "pier", "land station", "lighthouse"]
                        .iter()
                        .any(|w| text.contains(w))
                });
            if said {
                PlatformKind::Station
            } else {
                PlatformKind::Buoy
            }
        }
    }
}

/// Takes every sample of a variable that has a value, a place and a time; counts values that are none.
async fn take(
    session: &mut Session,
    measured: &Measured<'_>,
    shared: &mut Shared,
    gathered: &mut Gathered,
) -> Result<(), Stop> {
    let packing = Packing::of(measured.variable).checked(measured.variable)?;
    let stored = read_stored(session, measured.variable).await?;
    let lens: Vec<usize> = measured
        .variable
        .dimensions
        .iter()
        .map(|d| d.len as usize)
        .collect();
    let mut cell = vec![0; lens.len()];
    for (at, stored) in stored.into_iter().enumerate() {
        let number = packing.unpacked(stored);
        if number == Unpacked::Missing {
            continue;
        }
        let mut rest = at;
        for (index, len) in cell.iter_mut().zip(&lens).rev() {
            *index = rest % len;
            rest /= len;
        }
        sample(measured, shared, &cell, number, gathered)?;
    }
    Ok(())
}

/// Takes the observation of one cell, or counts why its number is none; unless its flag says that there is no value.
fn sample(
    measured: &Measured<'_>,
    shared: &mut Shared,
    cell: &[usize],
    number: Unpacked,
    gathered: &mut Gathered,
) -> Result<(), Rejection> {
    let at = |coordinate: &Coordinate| coordinate.at(cell, &shared.sampling);
    let verdicts = measured
        .flags
        .iter()
        .map(|(flag, scheme)| scheme.verdict(at(flag)));
    let verdict: Option<Verdict> = verdicts.reduce(worse);
    let Some(quality) = verdict.unwrap_or(Some(Quality::NotEvaluated)) else {
        return Ok(());
    };
    if let Some((mode, twin)) = &measured.mode
        && !argo::counts(measured.variable, at(mode))
    {
        if twin.as_ref().is_none_or(|twin| at(twin).is_nan()) {
            gathered.superseded();
        }
        return Ok(());
    }
    let conversion = &measured.conversion;
    let value = match number {
        Unpacked::Value(number) => conversion.given(number),
        Unpacked::Missing => Given::Missing,
        Unpacked::OutOfRange => {
            gathered.out_of_range();
            return Ok(());
        }
    };
    let value = match value {
        Given::Value(value) => value,
        Given::Missing => return Ok(()),
        Given::Implausible(value) => {
            gathered.implausible(conversion, value);
            return Ok(());
        }
    };
    let Some(place) = Place::of(measured, &shared.sampling, cell)? else {
        gathered.unplaced();
        return Ok(());
    };
    let name = shared.sampling.name(measured.variable, cell);
    let platform = match &mut shared.points {
        Some(points) => points.name(&name, place.time, [place.lon_deg, place.lat_deg]),
        None => name,
    };
    let is_longitude = conversion.property == "longitude";
    gathered.take(Observation {
        dataset: shared.dataset.clone(),
        platform,
        kind: shared.kind,
        time: place.time,
        lon_deg: place.lon_deg,
        lat_deg: place.lat_deg,
        depth_m: place.depth_m,
        property: conversion.property.clone(),
        value: if is_longitude {
            contract::grid::wrap_lon_deg(value)
        } else {
            value
        },
        unit: conversion.unit.clone(),
        quality,
    })
}

/// When and where a sample was taken.
struct Place {
    time: TimeMs,
    lon_deg: f64,
    lat_deg: f64,
    depth_m: f64,
}

impl Place {
    /// That of a cell; none where the file leaves a part of it open. Without a word of depths samples are at the surface, as are
    /// those whose property says so, and those without a depth among others at the surface.
    fn of(
        measured: &Measured<'_>,
        sampling: &Sampling,
        cell: &[usize],
    ) -> Result<Option<Self>, Rejection> {
        let at = |coordinate: &Coordinate| coordinate.at(cell, sampling);
        let time = at(&measured.time);
        let (lon_deg, lat_deg) = (at(&measured.longitude), at(&measured.latitude));
        let said = measured.depth.as_ref();
        let mut depth_m = said.map_or(0.0, |(depth, to)| to.depth_m(at(depth), lat_deg));
        let is_at_surface =
            || !measured.is_of_depths || is_of_surface(&measured.conversion.property);
        if depth_m.is_nan() && is_at_surface() {
            depth_m = 0.0;
        }
        if [time, lon_deg, lat_deg, depth_m].iter().any(|n| n.is_nan()) {
            return Ok(None);
        }
        Ok(Some(Self {
            time: instant(measured, time)?,
            lon_deg,
            lat_deg,
            depth_m,
        }))
    }
}

/// Does the name of a property say how deep it is?
fn is_of_surface(property: &str) -> bool {
    ["sea_surface_", "surface_"]
        .iter()
        .any(|start| property.starts_with(start))
}

fn instant(measured: &Measured<'_>, number: f64) -> Result<TimeMs, Rejection> {
    let refused = |why: String| Rejection::new(RejectReason::Time, &measured.time.name, why);
    if !measured.time_unit.is_instant(number) {
        let why = format!(
            "says {number} in months or years, which are not equally long: nothing says which instant that is; give it in days"
        );
        return Err(refused(why));
    }
    let date = measured.time_unit.date(number).and_then(period::instant);
    date.map_err(refused)
}
