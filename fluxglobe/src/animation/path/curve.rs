//! Places in, a smooth way over the sphere through them out, and how far north turns along it.
//!
//! Centripetal Catmull-Rom curves by the pyramid of P. J. Barry and R. N. Goldman: *A recursive evaluation algorithm for a
//! class of Catmull-Rom splines*. Computer Graphics 22 (4), 199, 1988. [doi:10.1145/378456.378511](https://doi.org/10.1145/378456.378511),
//! with great circles in the place of straight lines. Knots lie the root of the way apart, so that no piece makes loops:
//! C. Yuksel, S. Schaefer, J. Keyser: *Parameterization and applications of Catmull-Rom curves*. Computer-Aided Design 43 (7),
//! 747, 2011. [doi:10.1016/j.cad.2010.08.008](https://doi.org/10.1016/j.cad.2010.08.008)

use std::f64::consts::{FRAC_PI_3, PI};

use glam::DVec3;

/// Longest piece between two knots, radians: that of a longer way would meet the places opposite its own, to which
/// no great circle is the shorter one. Knots in between lie on the great circle.
const LONGEST_PIECE: f64 = FRAC_PI_3;
/// Places nearer to each other are one, radians: a tenth of a millimetre.
const SAME: f64 = 1e-11;
/// Steps of a piece along which north is followed: two thirds of a degree of the longest.
const NORTH_STEPS: u32 = 90;

/// A place on the sphere with the direction that is called north there: at a pole its longitude says which.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    lon: f64,
    lat: f64,
}

/// A way through places: once differentiable in its parameter, which is 0 at the first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Curve {
    knots: Vec<Knot>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    at: f64,
    place: DVec3,
}

impl Place {
    /// From degrees.
    pub(super) fn of([lon, lat]: [f64; 2]) -> Self {
        Self {
            lon: lon.to_radians(),
            lat: lat.to_radians(),
        }
    }

    pub(super) fn at(place: DVec3) -> Self {
        Self {
            lon: place.y.atan2(place.x),
            // Near a pole the arcsine knows nothing of the last digits.
            lat: place.z.atan2(place.x.hypot(place.y)),
        }
    }

    /// Longitude and latitude, degrees.
    pub(super) fn degrees(self) -> [f64; 2] {
        [self.lon, self.lat].map(f64::to_degrees)
    }

    pub(super) fn vector(self) -> DVec3 {
        let ((sin_lon, cos_lon), (sin_lat, cos_lat)) = (self.lon.sin_cos(), self.lat.sin_cos());
        DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
    }

    fn north(self) -> DVec3 {
        let ((sin_lon, cos_lon), (sin_lat, cos_lat)) = (self.lon.sin_cos(), self.lat.sin_cos());
        DVec3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat)
    }

    fn east(self) -> DVec3 {
        DVec3::new(-self.lon.sin(), self.lon.cos(), 0.0)
    }

    /// Clockwise from north at `to`, the direction that north at this place has become when it is carried there along the great
    /// circle, radians.
    fn north_carried(self, to: Self) -> f64 {
        let (from, there) = (self.vector(), to.vector());
        let north = self.north();
        let carried = north - (from + there) * (north.dot(there) / (1.0 + from.dot(there)));
        carried.dot(to.east()).atan2(carried.dot(to.north()))
    }
}

impl Curve {
    /// Through places in order; with it the parameter at each.
    pub(super) fn through(places: &[Place]) -> (Self, Vec<f64>) {
        let mut knots: Vec<Knot> = vec![];
        let mut parameters = Vec::with_capacity(places.len());
        for place in places.iter().map(|place| place.vector()) {
            match knots.last().copied() {
                None => knots.push(Knot { at: 0.0, place }),
                Some(last) => {
                    let way = angle(last.place, place);
                    let pieces = if way < SAME {
                        0
                    } else {
                        (way / LONGEST_PIECE).ceil() as u32
                    };
                    let length = (way / f64::from(pieces.max(1))).sqrt();
                    knots.extend((1..=pieces).map(|piece| Knot {
                        at: last.at + length * f64::from(piece),
                        place: slerp(last.place, place, f64::from(piece) / f64::from(pieces)),
                    }));
                }
            }
            parameters.push(knots.last().map_or(0.0, |knot| knot.at));
        }
        (Self { knots }, parameters)
    }

    /// The place at a parameter; beyond the ends theirs.
    pub(super) fn place(&self, at: f64) -> Place {
        Place::at(self.vector(at))
    }

    /// Clockwise from north at the place of `to`, what north at the place of `from` has become when it is carried there along the
    /// way, radians: whole turns count. The ends may be stated as the places they are, for the north of a pole.
    pub(super) fn north_turned(&self, from: (f64, Place), to: (f64, Place)) -> f64 {
        let mut turned = 0.0;
        let mut before = from.1;
        for at in self.stops(from.0, to.0) {
            let place = self.place(at);
            turned += before.north_carried(place);
            before = place;
        }
        turned + before.north_carried(to.1)
    }

    /// Parameters between two, the same whatever the second is.
    fn stops(&self, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let pieces = self
            .knots
            .windows(2)
            .filter(move |pair| pair[0].at < to && pair[1].at > from);
        let of_piece = |pair: &[Knot]| {
            let (start, length) = (pair[0].at, pair[1].at - pair[0].at);
            (0..NORTH_STEPS)
                .map(move |step| start + length * f64::from(step) / f64::from(NORTH_STEPS))
        };
        pieces
            .flat_map(of_piece)
            .filter(move |at| *at > from && *at < to)
    }

    fn vector(&self, at: f64) -> DVec3 {
        let Some(last) = self.knots.len().checked_sub(2) else {
            return self.knots.first().map_or(DVec3::X, |knot| knot.place);
        };
        let at = at.clamp(self.knots[0].at, self.knots[last + 1].at);
        let i = self
            .knots
            .partition_point(|knot| knot.at <= at)
            .saturating_sub(1)
            .min(last);
        let (from, to) = (self.knots[i], self.knots[i + 1]);
        // Beyond an end the way goes on as it came, by as much.
        let mirrored = |end: Knot, next: Knot| Knot {
            at: 2.0 * end.at - next.at,
            place: slerp(end.place, next.place, -1.0),
        };
        let before = i
            .checked_sub(1)
            .map_or_else(|| mirrored(from, to), |before| self.knots[before]);
        let after = self
            .knots
            .get(i + 2)
            .copied()
            .unwrap_or_else(|| mirrored(to, from));
        let three = [
            between(before, from, at),
            between(from, to, at),
            between(to, after, at),
        ];
        let share = |a: Knot, b: Knot| (at - a.at) / (b.at - a.at);
        let two = [
            slerp(three[0], three[1], share(before, to)),
            slerp(three[1], three[2], share(from, after)),
        ];
        slerp(two[0], two[1], share(from, to))
    }
}

fn between(from: Knot, to: Knot, at: f64) -> DVec3 {
    slerp(from.place, to.place, (at - from.at) / (to.at - from.at))
}

fn angle(from: DVec3, to: DVec3) -> f64 {
    from.cross(to).length().atan2(from.dot(to))
}

/// A place on the shorter great circle between two, or beyond them: 0 is the first, 1 the second.
pub(super) fn slerp(from: DVec3, to: DVec3, share: f64) -> DVec3 {
    let angle = angle(from, to);
    let towards = |place: DVec3| (place - from * from.dot(place)).try_normalize();
    // To the opposite place over the north pole; from a pole along the meridian of Greenwich.
    let opposite = PI - angle < SAME;
    let way = if opposite { None } else { towards(to) };
    let way = way.or_else(|| towards(DVec3::Z)).unwrap_or(DVec3::X);
    let (sin, cos) = (share * angle).sin_cos();
    (from * cos + way * sin).normalize_or(from)
}
