//! The figures of the earth used for areas: geodetic latitude bands in, square metres out.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Equatorial radius of WGS84, m (NIMA TR8350.2).
pub const WGS84_EQUATORIAL_RADIUS_M: f64 = 6_378_137.0;
/// Polar radius of WGS84, m.
pub const WGS84_POLAR_RADIUS_M: f64 = 6_356_752.314_245_179;
/// First eccentricity of WGS84, squared.
const WGS84_ECCENTRICITY_SQ: f64 = 6.694_379_990_141_317e-3;
/// Mean radius of the sphere that budgets are compared on, m.
pub const SPHERE_RADIUS_M: f64 = 6_371_000.0;

/// Figure of the earth for areas.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Earth {
    /// The WGS84 ellipsoid.
    #[default]
    Wgs84,
    /// A sphere of [`SPHERE_RADIUS_M`].
    Sphere,
    /// At every latitude a sphere whose radius is the distance of WGS84's surface from the earth's centre there: neither
    /// a sphere nor the ellipsoid, 0.7 % more than that at the equator and 1.3 % less at the poles. What FluxEngine sums
    /// with (its `lib_ofluxghg_flux_budgets.py`), so that its totals can be had.
    #[serde(rename = "local-radius")]
    LocalRadius,
}

impl Earth {
    /// Area between the equator and latitude `lat_rad`, per radian of longitude, m²; odd in latitude.
    ///
    /// Source: Snyder (1987), Map Projections, USGS Professional Paper 1395, eq. 3-12 (authalic q), times a²/2. With the
    /// local radius R: the integral of R² = (a⁴ (1 - s²) + b⁴ s²) / (a² (1 - s²) + b² s²) over the sine s of latitude.
    pub fn zone_area_m2_per_rad(self, lat_rad: f64) -> f64 {
        let s = lat_rad.sin();
        match self {
            Self::Sphere => SPHERE_RADIUS_M * SPHERE_RADIUS_M * s,
            Self::Wgs84 => {
                let e2 = WGS84_ECCENTRICITY_SQ;
                let e = e2.sqrt();
                let q = (1.0 - e2) * (s / (1.0 - e2 * s * s) + (e * s).atanh() / e);
                0.5 * WGS84_EQUATORIAL_RADIUS_M * WGS84_EQUATORIAL_RADIUS_M * q
            }
            Self::LocalRadius => {
                let e = WGS84_ECCENTRICITY_SQ.sqrt();
                let (a2, b2) = (
                    WGS84_EQUATORIAL_RADIUS_M * WGS84_EQUATORIAL_RADIUS_M,
                    WGS84_POLAR_RADIUS_M * WGS84_POLAR_RADIUS_M,
                );
                (a2 + b2) * s - b2 * (e * s).atanh() / e
            }
        }
    }

    /// Area of the cell between two latitudes and `width_deg` of longitude, m².
    pub fn cell_area_m2(self, south_deg: f64, north_deg: f64, width_deg: f64) -> f64 {
        let zone = self.zone_area_m2_per_rad(north_deg.to_radians())
            - self.zone_area_m2_per_rad(south_deg.to_radians());
        zone * width_deg.to_radians()
    }
}

impl std::fmt::Display for Earth {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Wgs84 => "wgs84",
            Self::Sphere => "sphere",
            Self::LocalRadius => "local-radius",
        })
    }
}

impl std::str::FromStr for Earth {
    type Err = crate::ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "wgs84" => Ok(Self::Wgs84),
            "sphere" => Ok(Self::Sphere),
            "local-radius" => Ok(Self::LocalRadius),
            _ => Err(crate::ContractError::invalid(
                "earth",
                s,
                "use wgs84, sphere or local-radius",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_ellipsoid_has_its_published_surface() {
        let area = Earth::Wgs84.cell_area_m2(-90.0, 90.0, 360.0);
        assert!((area - 5.100_656_217_240_9e14).abs() < 1e6, "{area}"); // 510 065 621.724 km²
    }

    #[test]
    fn a_zone_with_the_local_radius_is_the_integral_of_its_square() {
        let radius_sq_m2 = |lat_rad: f64| {
            let (a, b) = (WGS84_EQUATORIAL_RADIUS_M, WGS84_POLAR_RADIUS_M);
            let (c, s) = (a * lat_rad.cos(), b * lat_rad.sin());
            ((a * c).powi(2) + (b * s).powi(2)) / (c * c + s * s)
        };
        for (south_deg, north_deg) in [(-90.0, -10.0), (0.0, 1.0), (12.5, 90.0)] {
            // The midpoint rule, whose error falls with the square of 10⁵ steps.
            let steps = 100_000;
            let step_rad = f64::to_radians(north_deg - south_deg) / f64::from(steps);
            let sum: f64 = (0..steps)
                .map(|i| f64::to_radians(south_deg) + (f64::from(i) + 0.5) * step_rad)
                .map(|lat| radius_sq_m2(lat) * lat.cos() * step_rad)
                .sum();
            let area = Earth::LocalRadius.cell_area_m2(south_deg, north_deg, 1.0);
            let expected = sum * 1.0f64.to_radians();
            assert!((area / expected - 1.0).abs() < 1e-9, "{area} {expected}");
        }
    }

    #[test]
    fn figures_are_read_as_they_are_written() {
        for earth in [Earth::Wgs84, Earth::Sphere, Earth::LocalRadius] {
            assert_eq!(earth.to_string().parse::<Earth>().unwrap(), earth);
            let json = serde_json::to_string(&earth).unwrap();
            assert_eq!(json, format!("\"{earth}\""));
        }
        let refused = "flat".parse::<Earth>().unwrap_err().to_string();
        assert!(refused.contains("local-radius"), "{refused}");
    }

    #[test]
    fn the_whole_sphere_is_four_pi_r_squared() {
        let area = Earth::Sphere.cell_area_m2(-90.0, 90.0, 360.0);
        let expected = 4.0 * std::f64::consts::PI * SPHERE_RADIUS_M * SPHERE_RADIUS_M;
        assert!((area / expected - 1.0).abs() < 1e-14);
    }
}
