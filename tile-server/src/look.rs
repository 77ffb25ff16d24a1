//! How a picture is to look: parameters of an address in, checked options out.

use contract::colour::TransferOptions;
use contract::picture::PictureOptions;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::parsed;
use crate::openapi::words;

/// Parameters that every picture and its legend take; see [`Look`].
#[derive(Debug, Clone, Default, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct LookQuery {
    /// Colours; the quantity's own unless one is named. Not together with `stops`.
    #[param(value_type = Option<words::Palette>)]
    palette: Option<String>,
    /// Values of the first and the last colour, `LOW:HIGH`, in the unit of the legend.
    #[param(example = "-40:40")]
    range: Option<String>,
    /// How values are spread over the colours: `linear`, or `log` for ranges above 0; the quantity's own unless one is named.
    #[param(value_type = Option<words::Scale>)]
    scale: Option<String>,
    /// Colours at values, `VALUE:rrggbb` with commas between, 2 to 16 in rising order, in the unit of the legend.
    #[param(example = "-10:0a0b0c,25:ffffff")]
    stops: Option<String>,
    /// Shares of the usual optical depth at values, `VALUE:SHARE` with commas between, 0 to 1.
    #[param(example = "0:0.5,10:1")]
    opacity: Option<String>,
    /// Shares of a particle's full radius at values, `VALUE:SHARE` with commas between, 0 to 1.
    #[param(example = "0:0.25,1:1")]
    particle_size: Option<String>,
    /// The colours run the other way.
    #[param(value_type = Option<bool>)]
    reverse: Option<String>,
    /// Cells whose gap was filled are drawn differently.
    #[param(value_type = Option<bool>)]
    uncertainty: Option<String>,
    /// What it was called before; told apart from what nobody ever understood.
    #[param(ignore)]
    doubt: Option<String>,
}

/// What was asked of the look; all of it the usual where nothing was.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Look {
    options: TransferOptions,
    uncertainty: bool,
}

impl LookQuery {
    /// The texts as values.
    pub(crate) fn parse(&self) -> Result<Look, ServerError> {
        if let Some(text) = &self.doubt {
            let now = "it is written uncertainty=true now";
            return Err(ServerError::invalid("doubt", text, now));
        }
        Ok(Look {
            options: TransferOptions {
                palette: parsed(self.palette.as_deref())?,
                range: parsed(self.range.as_deref())?,
                scale: parsed(self.scale.as_deref())?,
                colours: parsed(self.stops.as_deref())?.unwrap_or_default(),
                opacity: parsed(self.opacity.as_deref())?.unwrap_or_default(),
                size: parsed(self.particle_size.as_deref())?.unwrap_or_default(),
                reversed: flag("reverse", self.reverse.as_deref())?,
            },
            uncertainty: flag("uncertainty", self.uncertainty.as_deref())?,
        })
    }
}

fn flag(what: &'static str, text: Option<&str>) -> Result<bool, ServerError> {
    match text {
        None | Some("false" | "0") => Ok(false),
        Some("true" | "1") => Ok(true),
        Some(text) => Err(ServerError::invalid(what, text, "true or false")),
    }
}

impl Look {
    /// Is everything as usual?
    pub(crate) fn is_usual(&self) -> bool {
        *self == Self::default()
    }

    /// The same in the words of every picture.
    pub(crate) fn options(&self) -> PictureOptions {
        PictureOptions {
            transfer: self.options,
            uncertainty: self.uncertainty,
            ..PictureOptions::default()
        }
    }

    /// Parameters that ask for the same look, in their canonical form: nothing in them needs escaping.
    pub(crate) fn parameters(&self) -> Vec<String> {
        let options = &self.options;
        let range = options.range.map(|range| format!("range={range}"));
        let palette = options.palette.map(|palette| format!("palette={palette}"));
        let scale = options.scale.map(|scale| format!("scale={scale}"));
        let stops = |name: &str, list: String| (!list.is_empty()).then(|| format!("{name}={list}"));
        let flag = |name: &str, is_set: bool| is_set.then(|| format!("{name}=true"));
        [
            palette,
            range,
            scale,
            stops("stops", options.colours.to_string()),
            stops("opacity", options.opacity.to_string()),
            stops("particle_size", options.size.to_string()),
            flag("reverse", options.reversed),
            flag("uncertainty", self.uncertainty),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_ask_for_the_look_they_came_from() {
        let query = LookQuery {
            range: Some(" -10 : 2.5e1".to_owned()),
            stops: Some("-10:#0A0B0C,25:ffffff".to_owned()),
            opacity: Some("0:0.5".to_owned()),
            particle_size: Some("0:0.25,1:1".to_owned()),
            uncertainty: Some("1".to_owned()),
            scale: Some("linear".to_owned()),
            ..LookQuery::default()
        };
        let look = query.parse().unwrap();
        let parameters = look.parameters().join("&");
        assert_eq!(
            parameters,
            "range=-10:25&scale=linear&stops=-10:0a0b0c,25:ffffff&opacity=0:0.5&particle_size=0:0.25,1:1&uncertainty=true"
        );
        let again = LookQuery {
            range: Some("-10:25".to_owned()),
            stops: Some("-10:0a0b0c,25:ffffff".to_owned()),
            ..query
        };
        assert_eq!(again.parse().unwrap(), look);
        assert!(!look.is_usual());
    }

    #[test]
    fn without_parameters_all_is_as_usual() {
        let look = LookQuery::default().parse().unwrap();
        assert!(look.is_usual() && look.parameters().is_empty());
        assert_eq!(look.options(), PictureOptions::default());
    }
}
