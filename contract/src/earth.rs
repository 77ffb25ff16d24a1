//! The two figures of the earth used for areas: geodetic latitude bands in, square metres out.

use serde::{Deserialize, Serialize};

/// Equatorial radius of WGS84, m (NIMA TR8350.2).
pub const WGS84_EQUATORIAL_RADIUS_M: f64 = 6_378_137.0;
/// Polar radius of WGS84, m.
pub const WGS84_POLAR_RADIUS_M: f64 = 6_356_752.314_245_179;
/// First eccentricity of WGS84, squared.
const WGS84_ECCENTRICITY_SQ: f64 = 6.694_379_990_141_317e-3;
/// Mean radius of the sphere that budgets are compared on, m.
pub const SPHERE_RADIUS_M: f64 = 6_371_000.0;

/// Figure of the earth for areas.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Earth {
    /// The WGS84 ellipsoid.
    #[default]
    Wgs84,
    /// A sphere of [`SPHERE_RADIUS_M`].
    Sphere,
}

impl Earth {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Wgs84, Self::Sphere];

    /// Area between the equator and latitude `lat_rad`, per radian of longitude, m²; odd in latitude.
    ///
    /// Source: Snyder (1987), Map Projections, USGS Professional Paper 1395, eq. 3-12 (authalic q), times a²/2.
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
        })
    }
}

impl std::str::FromStr for Earth {
    type Err = crate::ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "wgs84" => Ok(Self::Wgs84),
            "sphere" => Ok(Self::Sphere),
            _ => Err(crate::ContractError::invalid(
                "earth",
                s,
                "use wgs84 or sphere",
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
    fn the_whole_sphere_is_four_pi_r_squared() {
        let area = Earth::Sphere.cell_area_m2(-90.0, 90.0, 360.0);
        let expected = 4.0 * std::f64::consts::PI * SPHERE_RADIUS_M * SPHERE_RADIUS_M;
        assert!((area / expected - 1.0).abs() < 1e-14);
    }
}
