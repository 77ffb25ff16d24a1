//! Names of meridians and parallels at their ends: where they go behind the globe or leave the picture. The lines themselves
//! lie on the globe, below its particles: the engine draws them (`render/src/plan/isolines.rs`).

mod clip;
mod labels;

use contract::annotation::Graticule;
use contract::grid::LonLatDeg;
use render::plan::{Projection, graticule_step_deg};

/// Corners of a line.
const CORNERS: u32 = 360;
/// Where meridians end, degrees from the poles: they would run into one another. Four go on to the pole.
const POLE_DEG: f64 = 10.0;

/// Which lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Meridian,
    Parallel,
}

/// A line, as far as it is in the picture.
struct Line {
    kind: Kind,
    /// Of latitude or longitude, beyond 180 where the picture reaches over it.
    degrees: f64,
    parts: Vec<Vec<[f64; 2]>>,
}

/// The lines of a picture.
pub(super) struct Lines(Vec<Line>);

/// What may be seen of the globe: within an angle of a place, degrees.
struct Cap {
    lon: f64,
    lat: f64,
    angle: f64,
}

impl Lines {
    pub(super) fn of(graticule: Graticule, projection: &Projection, size: [f64; 2]) -> Self {
        let cap = Cap::of(projection);
        let step = graticule_step_deg(graticule, projection.horizon());
        let parallels = multiples(step, cap.lat - cap.angle, cap.lat + cap.angle);
        let parallels = parallels.filter(|lat| lat.abs() < 90.0 - 1e-9);
        let half = cap.half_width();
        let meridians = multiples(step, cap.lon - half, cap.lon + half);
        let mut lines = vec![];
        for (kind, degrees) in parallels
            .map(|lat| (Kind::Parallel, lat))
            .chain(meridians.map(|lon| (Kind::Meridian, lon)))
        {
            let corners = match kind {
                Kind::Parallel => corners([cap.lon - half, cap.lon + half], |lon| LonLatDeg {
                    lon,
                    lat: degrees,
                }),
                Kind::Meridian => {
                    let is_whole = (degrees / 90.0).fract().abs() < 1e-9;
                    let end = if is_whole {
                        90.0
                    } else {
                        90.0 - POLE_DEG.min(step)
                    };
                    let from = (cap.lat - cap.angle).max(-end);
                    let to = (cap.lat + cap.angle).min(end);
                    corners([from, to], |lat| LonLatDeg { lon: degrees, lat })
                }
            };
            let seen = projection.lines(&corners);
            let parts: Vec<_> = seen
                .iter()
                .flat_map(|part| clip::to_picture(part, size))
                .collect();
            if !parts.is_empty() {
                lines.push(Line {
                    kind,
                    degrees,
                    parts,
                });
            }
        }
        Self(lines)
    }
}

impl Cap {
    fn of(projection: &Projection) -> Self {
        let (below, _from_middle) = projection.stands();
        Self {
            lon: below.lon,
            lat: below.lat,
            angle: projection.horizon().to_degrees(),
        }
    }

    /// Longitudes on either side of the middle, degrees; all of them round a pole.
    fn half_width(&self) -> f64 {
        if self.lat.abs() + self.angle >= 90.0 - 1e-6 {
            return 180.0;
        }
        let sine = self.angle.to_radians().sin() / self.lat.to_radians().cos();
        sine.min(1.0).asin().to_degrees()
    }
}

/// Multiples of a step from one number to another, each of all round the globe once.
fn multiples(step: f64, from: f64, to: f64) -> impl Iterator<Item = f64> {
    let (first, last) = (
        (from / step - 1e-9).ceil() as i64,
        (to / step + 1e-9).floor() as i64,
    );
    (first..=last)
        .map(move |i| i as f64 * step)
        .filter(move |at| *at < from + 360.0 - 1e-9)
}

/// Corners of a line from one number to another.
fn corners([from, to]: [f64; 2], at: impl Fn(f64) -> LonLatDeg) -> Vec<LonLatDeg> {
    let place = |i: u32| at(from + (to - from) * f64::from(i) / f64::from(CORNERS));
    (0..=CORNERS).map(place).collect()
}

#[cfg(test)]
mod tests;
