//! What an address of a globe view asks of the ground: borders, sea floor, colours, and what lies behind the globe.

use contract::picture::PictureOptions;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::parsed;
use crate::openapi::words;

/// The parameters of an address that say it, as they were written.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct GroundQuery {
    /// The ground is drawn below the particles; yes unless told otherwise.
    #[param(value_type = Option<bool>)]
    surface: Option<String>,
    /// Borders of countries are drawn; wherever coast lines are unless told otherwise.
    #[param(value_type = Option<bool>)]
    borders: Option<String>,
    /// The plain globe is shaded by a coarse relief of land and sea floor; yes unless told otherwise. One named by `relief`
    /// takes its place.
    #[param(value_type = Option<bool>)]
    sea_floor: Option<String>,
    /// A thematic map (`map`) and its isolines end at coasts, by the share of land in every pixel; no unless told otherwise, as
    /// cells are whole. Lakes count as land. Other modes refuse it.
    #[param(value_type = Option<bool>)]
    #[serde(alias = "mask-land")]
    mask_land: Option<String>,
    /// Colours of the plain globe; dark unless told otherwise.
    #[param(value_type = Option<words::BaseMap>)]
    #[serde(alias = "base-map")]
    base_map: Option<String>,
    /// What is seen beside the globe; none unless told otherwise, which leaves it transparent.
    #[param(value_type = Option<words::Background>)]
    background: Option<String>,
}

impl GroundQuery {
    /// The options of a picture, with what is asked for here.
    pub(crate) fn below(&self, options: &PictureOptions) -> Result<PictureOptions, ServerError> {
        Ok(PictureOptions {
            globe_surface: flag("surface", self.surface.as_deref())?.unwrap_or(true),
            borders: flag("borders", self.borders.as_deref())?,
            sea_floor: flag("sea_floor", self.sea_floor.as_deref())?,
            mask_land: flag("mask_land", self.mask_land.as_deref())?.unwrap_or(false),
            base_map: parsed(self.base_map.as_deref())?,
            background: parsed(self.background.as_deref())?,
            ..*options
        })
    }
}

/// A choice, if one was made.
pub(crate) fn flag(what: &'static str, text: Option<&str>) -> Result<Option<bool>, ServerError> {
    match text {
        None => Ok(None),
        Some("true") => Ok(Some(true)),
        Some("false") => Ok(Some(false)),
        Some(text) => Err(ServerError::invalid(what, text, "true or false")),
    }
}
