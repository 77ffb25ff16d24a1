//! Key frames that are flown through: cameras at instants in, one at any instant between out, at rest at both ends alone.

use super::curve::{Curve, Place};
use super::monotone::Monotone;
use super::pose::Pose;

/// The way of a camera through key frames, once differentiable in time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Flight {
    first: Pose,
    seconds: Vec<f64>,
    stops: Vec<Stop>,
    places: Curve,
    /// Parameter of the places by time.
    along: Monotone,
    away: Monotone,
    /// Of the heading what is not that of a camera that goes straight on along the places, degrees.
    turn: Monotone,
    tilt: Monotone,
    roll: Monotone,
    fov: Monotone,
}

/// A key frame's place on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stop {
    place: Place,
    parameter: f64,
    /// How far a camera that goes straight on has turned against north since the first, degrees.
    straight: f64,
}

impl Flight {
    /// Through cameras at instants, two at least and all of one anchor.
    pub(super) fn through(frames: &[(f64, Pose)]) -> Self {
        let seconds: Vec<f64> = frames.iter().map(|(seconds, _)| *seconds).collect();
        let named: Vec<Place> = frames
            .iter()
            .map(|(_, pose)| Place::of(pose.place))
            .collect();
        let (places, parameters) = Curve::through(&named);
        let mut stops: Vec<Stop> = vec![];
        for ((place, parameter), (_, pose)) in named.into_iter().zip(parameters).zip(frames) {
            let straight = stops.last().map_or(0.0, |last| {
                let (from, to) = ((last.parameter, last.place), (parameter, place));
                let turned = places.north_turned(from, to).to_degrees();
                let asked = pose.heading - frames[stops.len() - 1].1.heading;
                last.straight + past_pole(turned, asked)
            });
            stops.push(Stop {
                place,
                parameter,
                straight,
            });
        }
        let of = |number: &dyn Fn(usize, &Pose) -> f64| {
            let numbers = frames.iter().enumerate();
            let values = numbers.map(|(i, (_, pose))| number(i, pose)).collect();
            Monotone::through(&seconds, values)
        };
        Self {
            first: frames[0].1,
            along: of(&|i, _| stops[i].parameter),
            away: of(&|_, pose| pose.scaled_away()),
            turn: of(&|i, pose| pose.heading - stops[i].straight),
            tilt: of(&|_, pose| pose.tilt),
            roll: of(&|_, pose| pose.roll),
            fov: of(&|_, pose| pose.fov),
            seconds,
            stops,
            places,
        }
    }

    /// The camera at an instant between the first and the last.
    pub(super) fn pose(&self, seconds: f64) -> Pose {
        let after = self.seconds.partition_point(|stop| *stop <= seconds);
        let stop = self.stops[after.saturating_sub(1)];
        let parameter = self.along.value(seconds);
        let place = self.places.place(parameter);
        let turned = self
            .places
            .north_turned((stop.parameter, stop.place), (parameter, place));
        Pose {
            place: place.degrees(),
            away_km: self.first.away_of(self.away.value(seconds)),
            heading: self.turn.value(seconds) + stop.straight + turned.to_degrees(),
            tilt: self.tilt.value(seconds),
            roll: self.roll.value(seconds),
            fov: self.fov.value(seconds),
            ..self.first
        }
    }
}

/// How far north turned on the way to a key frame, degrees: past a pole it turned by half a turn or so, to the one side or the
/// other as the way lay, and the side is taken that leaves less for the camera to turn.
fn past_pole(turned: f64, asked: f64) -> f64 {
    if turned.abs() < 90.0 {
        return turned;
    }
    let rest = asked - turned;
    let other = turned + 360.0f64.copysign(-turned);
    if (asked - other).abs() < rest.abs() {
        other
    } else {
        turned
    }
}
