//! Whether a picture of the globe shows any of the earth's surface: a view in, the tilt that would show some out.

use crate::camera::CameraAngles;
use crate::earth::SPHERE_RADIUS_M;
use crate::job::View;

/// Halvings of the search for a tilt: to a billionth of a degree.
const HALVINGS: u32 = 40;
/// Tilts are told in so many parts of a degree.
const TOLD_PARTS: f64 = 10.0;

/// Edges of a picture as a camera has them before it: forward, right and top.
struct PictureEdges {
    corners: [[f64; 3]; 4],
    half: [f64; 2],
}

impl View {
    /// The largest tilt that has some of the earth's surface in the picture, degrees, rounded down to tenths, where this one
    /// has none: the camera looks past it, at the sky and at what rises over the horizon. None where there is some, on map
    /// tiles, and below the sea surface, which is on all sides of the camera.
    pub fn tilt_with_ground_deg(&self) -> Option<f64> {
        let View::Globe {
            height_m, angles, ..
        } = *self
        else {
            return None;
        };
        let frame = PictureEdges::of(&angles, self.size_px());
        if height_m < 0.0 || frame.has_ground(&angles, height_m) {
            return None;
        }
        let has_ground =
            |tilt_deg| frame.has_ground(&CameraAngles { tilt_deg, ..angles }, height_m);
        let (mut low, mut high) = (0.0, angles.tilt_deg);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if has_ground(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some((low * TOLD_PARTS).floor() / TOLD_PARTS)
    }
}

impl PictureEdges {
    fn of(angles: &CameraAngles, size_px: [u32; 2]) -> Self {
        let [width, height] = size_px.map(f64::from);
        let half_side = (angles.field_of_view_deg / 2.0).to_radians().tan();
        let half = [width, height].map(|side| half_side * side / width.min(height));
        let [x, y] = half;
        let corners = [[1.0, -x, -y], [1.0, x, -y], [1.0, x, y], [1.0, -x, y]];
        Self { corners, half }
    }

    /// Is any sight line of the picture within the cone that touches the globe?
    fn has_ground(&self, angles: &CameraAngles, height_m: f64) -> bool {
        let (sin_tilt, cos_tilt) = angles.tilt_deg.to_radians().sin_cos();
        let (sin_roll, cos_roll) = angles.roll_deg.to_radians().sin_cos();
        // Straight down, seen by the camera; which way a roll turns it matters not to a rectangle.
        let down = [cos_tilt, sin_tilt * sin_roll, -sin_tilt * cos_roll];
        let radii = 1.0 + height_m / SPHERE_RADIUS_M;
        let cos_limb = (1.0 - (1.0 / radii).powi(2)).sqrt();
        self.nearest_cosine(down) >= cos_limb
    }

    /// Cosine of the angle between a direction and the sight line of the picture that is nearest to it.
    fn nearest_cosine(&self, way: [f64; 3]) -> f64 {
        let [ahead, right, top] = way;
        let [half_width, half_height] = self.half;
        if ahead > 0.0 && right.abs() <= half_width * ahead && top.abs() <= half_height * ahead {
            return 1.0;
        }
        let edges = (0..4).map(|i| (self.corners[i], self.corners[(i + 1) % 4]));
        let nearest = edges.map(|(from, to)| {
            let ends = cosine(from, way).max(cosine(to, way));
            // On the plane of the edge and the camera; in the edge if it lies between its ends.
            let normal = cross(from, to);
            let away = dot(normal, way) / dot(normal, normal);
            let flat: [f64; 3] = std::array::from_fn(|i| way[i] - away * normal[i]);
            let is_between =
                dot(cross(from, flat), normal) >= 0.0 && dot(cross(flat, to), normal) >= 0.0;
            if is_between {
                ends.max(cosine(flat, way))
            } else {
                ends
            }
        });
        nearest.fold(-1.0, f64::max)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn cosine(a: [f64; 3], b: [f64; 3]) -> f64 {
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(height_m: f64, tilt_deg: f64, roll_deg: f64, size: [u32; 2]) -> View {
        View::Globe {
            lon_deg: 10.0,
            lat_deg: 20.0,
            height_m,
            width_px: size[0],
            height_px: size[1],
            angles: CameraAngles {
                tilt_deg,
                roll_deg,
                ..CameraAngles::NADIR
            },
        }
    }

    /// By looking along every sight line of a fine picture.
    fn sees_ground(view: &View) -> bool {
        let View::Globe {
            height_m, angles, ..
        } = *view
        else {
            panic!("a globe")
        };
        let frame = PictureEdges::of(&angles, view.size_px());
        let (sin_tilt, cos_tilt) = angles.tilt_deg.to_radians().sin_cos();
        let (sin_roll, cos_roll) = angles.roll_deg.to_radians().sin_cos();
        let down = [cos_tilt, sin_tilt * sin_roll, -sin_tilt * cos_roll];
        let radii = 1.0 + height_m / SPHERE_RADIUS_M;
        let limb = (1.0 / radii).asin();
        let share = |i: u32| f64::from(i) / 200.0 - 1.0;
        (0..=400).any(|x| {
            (0..=400).any(|y| {
                let sight = [1.0, share(x) * frame.half[0], share(y) * frame.half[1]];
                cosine(sight, down).acos() <= limb
            })
        })
    }

    #[test]
    fn a_picture_of_nothing_but_sky_is_told_with_a_tilt_that_has_ground() {
        // From 5 km the horizon is 2.3 degrees below the level, and half of the picture reaches 22.5 below its middle.
        let size = [640, 480];
        assert_eq!(view(5e3, 100.0, 0.0, size).tilt_with_ground_deg(), None);
        assert_eq!(
            view(5e3, 120.0, 0.0, size).tilt_with_ground_deg(),
            Some(110.2)
        );
        assert_eq!(
            view(5e3, 180.0, 0.0, size).tilt_with_ground_deg(),
            Some(110.2)
        );
        for (height_m, tilt, roll, size) in [
            (5e3, 130.0, 30.0, [640, 480]),
            (1e6, 140.0, -70.0, [1600, 200]),
            (3e5, 175.0, 45.0, [100, 900]),
            (1e3, 130.0, 10.0, [1, 1]),
        ] {
            let sky = view(height_m, tilt, roll, size);
            assert!(!sees_ground(&sky), "{sky:?}");
            let told = sky.tilt_with_ground_deg().unwrap();
            let with = view(height_m, told, roll, size);
            let without = view(height_m, told + 0.15, roll, size);
            assert_eq!(with.tilt_with_ground_deg(), None, "{told}");
            assert!(without.tilt_with_ground_deg().is_some(), "{told}");
            // Half a step of the fine picture farther in.
            assert!(
                sees_ground(&view(height_m, told - 0.5, roll, size)),
                "{told}"
            );
            assert!(!sees_ground(&without), "{told}");
        }
    }

    #[test]
    fn pictures_with_ground_of_tiles_and_from_below_are_told_nothing_of() {
        for tilt in [0.0, 45.0, 80.0] {
            assert_eq!(view(1e6, tilt, 0.0, [64, 64]).tilt_with_ground_deg(), None);
        }
        assert_eq!(
            view(-4e5, 180.0, 0.0, [64, 64]).tilt_with_ground_deg(),
            None
        );
        let tile = View::Tile {
            tile: crate::tile::Tile { z: 3, x: 1, y: 1 },
            size_px: 256,
        };
        assert_eq!(tile.tilt_with_ground_deg(), None);
        // A narrow field of view looks past what a wide one has.
        let mut narrow = view(5e3, 100.0, 0.0, [64, 64]);
        if let View::Globe { angles, .. } = &mut narrow {
            angles.field_of_view_deg = 10.0;
        }
        assert_eq!(narrow.tilt_with_ground_deg(), Some(92.7));
    }
}
