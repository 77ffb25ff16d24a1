//! What surrounds the particles of a picture: coast lines and borders, isolines, the sea they sink into, land and sea
//! floor, sky.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::base_map::{Background, BaseMap};
use crate::grid::Grid;
use crate::isolines::Isolines;
use crate::key::ObjectKey;
use crate::kind::Kind;
use crate::manifest::Manifest;
use crate::quantity::Quantity;

/// How much larger heights of a relief are taken than they are, unless told otherwise: slopes of the sea floor are
/// hardly seen without.
pub const RELIEF_EXAGGERATION: f64 = 15.0;
/// Most that heights of a relief are exaggerated.
pub const MAX_RELIEF_EXAGGERATION: f64 = 1000.0;
/// Most cells of a relief: 2^26, more than a grid of 2.5 minutes of arc all round has.
pub const MAX_RELIEF_CELLS: u64 = 1 << 26;
/// Most that the sea hides over [`SEA_OPACITY_DEPTH_M`].
pub const MAX_SEA_OPACITY: f64 = 0.99;
/// Drawn depth (that of particles as they are lifted and sunk, that of the sea floor as it is exaggerated) over which
/// the sea hides the share that a style states, m.
pub const SEA_OPACITY_DEPTH_M: f64 = 100_000.0;

/// What is drawn besides the particles, without data of its own. Nothing of it is in the name of a picture without it.
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a switch of its own, as people are offered it"
)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Context {
    /// Share of what lies [`SEA_OPACITY_DEPTH_M`] below the sea surface that the sea hides, 0 to [`MAX_SEA_OPACITY`]:
    /// Beer-Lambert. 0 draws no sea.
    #[serde(
        default,
        with = "crate::exact",
        skip_serializing_if = "crate::context::is_zero"
    )]
    pub sea_opacity: f64,
    /// Draw coast lines, and on globe views shores of lakes.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub coastlines: bool,
    /// Draw borders of countries (globe views).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub borders: bool,
    /// Shade the plain globe by a coarse relief of land and sea floor, where no relief of its own is drawn.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sea_floor: bool,
    /// Leave out what a thematic map, and isolines, say of land: they end at coasts, by the share of land in every pixel, and
    /// lakes count as land (globe views).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mask_land: bool,
    /// Colours of the plain globe.
    #[serde(default, skip_serializing_if = "BaseMap::is_usual")]
    pub base_map: BaseMap,
    /// What is seen beside the globe.
    #[serde(default, skip_serializing_if = "Background::is_usual")]
    pub background: Background,
    /// Isolines of the quantity that is drawn, on the sea surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub isolines: Option<Isolines>,
}

/// The relief under a picture: one stored field of elevation on a grid of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Relief {
    /// The grid of the field.
    #[serde(with = "crate::exact::grid")]
    pub grid: Grid,
    /// The field.
    #[serde(rename = "frame")]
    pub field: ObjectKey,
    /// How much larger heights are taken than they are where slopes are shaded and the sea floor is seen through the
    /// sea, 0 to [`MAX_RELIEF_EXAGGERATION`].
    #[serde(with = "crate::exact")]
    pub exaggeration: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

impl Context {
    /// Is nothing but the product drawn?
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Share of light that a metre of drawn depth takes, as the exponent of Beer-Lambert, m⁻¹.
    pub fn sea_extinction_per_m(&self) -> f64 {
        -(1.0 - self.sea_opacity).ln() / SEA_OPACITY_DEPTH_M
    }

    pub(crate) fn validate(&self) -> Result<(), ContractError> {
        if (0.0..=MAX_SEA_OPACITY).contains(&self.sea_opacity) {
            return Ok(());
        }
        Err(ContractError::invalid(
            "sea opacity",
            &self.sea_opacity.to_string(),
            format!("a share of 0 to {MAX_SEA_OPACITY}, such as 0.4"),
        ))
    }

    /// Refuses what a picture without a globe would have to leave out: on map tiles whatever belongs to globe views, and a
    /// sky round a globe that is not drawn.
    pub(crate) fn validate_on(
        &self,
        is_tile: bool,
        globe_surface: bool,
    ) -> Result<(), ContractError> {
        let usual = Self::default();
        let of_globes = [
            (self.borders, "borders", "true"),
            (self.sea_floor, "sea floor", "true"),
            (self.mask_land, "mask of land", "true"),
            (
                self.base_map != usual.base_map,
                "base map",
                self.base_map.as_str(),
            ),
        ];
        if let Some((_, what, text)) = of_globes
            .into_iter()
            .find(|(is_set, ..)| is_tile && *is_set)
        {
            let reason =
                "it belongs to views of the globe; map tiles lie over the map of their client";
            return Err(ContractError::invalid(what, text, reason));
        }
        if self.background != usual.background && (is_tile || !globe_surface) {
            let reason = "it lies behind a globe that is drawn; leave it out, or draw the globe";
            return Err(ContractError::invalid(
                "background",
                self.background.as_str(),
                reason,
            ));
        }
        Ok(())
    }
}

impl Relief {
    /// The relief that a version of an elevation product holds: its last step.
    ///
    /// # Errors
    /// A product of another quantity, without steps, or a limit that is broken.
    pub fn of(elevation: &Manifest, exaggeration: f64) -> Result<Self, ContractError> {
        let bad = |reason: String| {
            let name = elevation.product.to_string();
            Err(ContractError::invalid("relief", &name, reason))
        };
        if elevation.quantity != Quantity::Elevation {
            let title = elevation.quantity.title();
            return bad(format!(
                "it is {title}; name a product of elevation (land one, such as etopo20, with fluxglobe ingest)"
            ));
        }
        let Some(step) = elevation.steps.last() else {
            return bad("it has no steps".to_owned());
        };
        let relief = Self {
            grid: elevation.grid,
            field: step.field.clone(),
            exaggeration,
        };
        relief.validate()?;
        Ok(relief)
    }

    pub(crate) fn validate(&self) -> Result<(), ContractError> {
        let bad = |text: &str, reason: String| Err(ContractError::invalid("relief", text, reason));
        self.grid.validate()?;
        let cells = u64::from(self.grid.rows) * u64::from(self.grid.cols);
        if cells > MAX_RELIEF_CELLS {
            let reason = format!("it has {cells} cells, at most {MAX_RELIEF_CELLS} are drawn");
            return bad(self.field.as_str(), reason);
        }
        if !self.field.is_in(Kind::Field.folder()) {
            return bad(self.field.as_str(), "a field is wanted".to_owned());
        }
        if !(0.0..=MAX_RELIEF_EXAGGERATION).contains(&self.exaggeration) {
            let reason = format!("heights are exaggerated 0 to {MAX_RELIEF_EXAGGERATION} times");
            return bad(&self.exaggeration.to_string(), reason);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn relief() -> Relief {
        Relief {
            grid: Grid {
                rows: 180,
                cols: 360,
                north_deg: 90.0,
                west_deg: -180.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            field: "frames/etopo/a".parse().unwrap(),
            exaggeration: 15.0,
        }
    }

    #[test]
    fn a_picture_without_surroundings_says_nothing_of_them() {
        assert_eq!(serde_json::to_string(&Context::default()).unwrap(), "{}");
        let both = Context {
            sea_opacity: 0.25,
            coastlines: true,
            ..Context::default()
        };
        let text = serde_json::to_string(&both).unwrap();
        assert_eq!(text, r#"{"sea_opacity":"0.25","coastlines":true}"#);
        assert_eq!(serde_json::from_str::<Context>(&text).unwrap(), both);
        let all = Context {
            borders: true,
            sea_floor: true,
            mask_land: true,
            base_map: BaseMap::Light,
            background: Background::Sky,
            isolines: Some(Isolines::Decades { one: 1.0 }),
            ..both
        };
        let text = serde_json::to_string(&all).unwrap();
        let more = r#""borders":true,"sea_floor":true,"mask_land":true,"base_map":"light","background":"sky","isolines":{"decades":{"one":"1"}}}"#;
        assert!(text.ends_with(more), "{text}");
        assert_eq!(serde_json::from_str::<Context>(&text).unwrap(), all);
    }

    #[test]
    fn what_belongs_to_globe_views_is_refused_where_no_globe_is_drawn() {
        let changes: [fn(&mut Context); 5] = [
            |c| c.borders = true,
            |c| c.sea_floor = true,
            |c| c.mask_land = true,
            |c| c.base_map = BaseMap::Light,
            |c| c.background = Background::Sky,
        ];
        for change in changes {
            let mut context = Context::default();
            change(&mut context);
            context.validate_on(false, true).unwrap();
            context.validate_on(true, false).unwrap_err();
            let is_sky = context.background == Background::Sky;
            assert_eq!(context.validate_on(false, false).is_err(), is_sky);
        }
        let lines = Context {
            coastlines: true,
            ..Context::default()
        };
        lines.validate_on(true, false).unwrap();
    }

    #[test]
    fn the_sea_hides_the_stated_share_over_the_stated_depth() {
        let sea = Context {
            sea_opacity: 0.4,
            ..Context::default()
        };
        let kept = (-sea.sea_extinction_per_m() * SEA_OPACITY_DEPTH_M).exp();
        assert!((kept - 0.6).abs() < 1e-12);
        assert!(Context::default().sea_extinction_per_m().abs() < 1e-300);
    }

    #[test]
    fn surroundings_beyond_a_limit_are_refused() {
        for sea_opacity in [-0.1, 1.0, f64::NAN, f64::INFINITY] {
            let context = Context {
                sea_opacity,
                ..Context::default()
            };
            let text = context.validate().unwrap_err().to_string();
            assert!(text.contains("such as 0.4"), "{text}");
        }
        relief().validate().unwrap();
        let broken: [fn(&mut Relief); 4] = [
            |r| r.exaggeration = f64::NAN,
            |r| r.exaggeration = 1e9,
            |r| r.field = "domain/etopo/a".parse().unwrap(),
            |r| {
                (r.grid.rows, r.grid.cols) = (10_800, 21_600);
                (r.grid.dlat_deg, r.grid.dlon_deg) = (1.0 / 60.0, 1.0 / 60.0);
            },
        ];
        for change in broken {
            let mut relief = relief();
            change(&mut relief);
            assert!(relief.validate().is_err(), "{relief:?}");
        }
    }
}
