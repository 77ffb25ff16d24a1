//! What an address asks for besides a product, a mode, an instant and a view: relief, sea, coast lines, trails, the sun, and
//! how far particles rise.

use contract::context::{RELIEF_EXAGGERATION, Relief};
use contract::isolines::IsolineWish;
use contract::picture::PictureOptions;
use contract::product::ProductId;
use contract::sun::SunChoice;
use contract::time::TimeMs;
use contract::trails::{eastward_part, no_vector};
use serde::Deserialize;
use utoipa::IntoParams;

use crate::catalogue::Catalogue;
use crate::error::ServerError;
use crate::extract::{number, time};
use crate::ground::flag;
use crate::request::{Beside, VectorAt};

/// The parameters of an address that say it, as they were written.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct SurroundingsQuery {
    /// An elevation product below the layer.
    relief: Option<String>,
    /// How much larger the heights of `relief` are taken than they are; 15 unless told otherwise.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 1000)]
    relief_exaggeration: Option<String>,
    /// Share of what lies deep below the sea surface that the sea hides.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 0.99)]
    sea_opacity: Option<String>,
    /// Coast lines are drawn; unless told otherwise on views that show the globe, and not on tiles.
    #[param(value_type = Option<bool>)]
    coastlines: Option<String>,
    /// Isolines of the layer are drawn on the sea surface: at multiples of this number in the unit of the legend, at most 50
    /// over the range of colours; `auto` chooses a round one.
    #[param(example = "10")]
    isolines: Option<String>,
    /// A vector whose trails are drawn on the sea surface, over the layer and below what rises from it: currents `NAME`, of
    /// which `NAME-east` and `NAME-north` have landed.
    #[param(example = "globcurrent")]
    trails: Option<String>,
    /// Another instant of the vector than the one that is shown.
    #[param(example = "2002-01-15")]
    trails_time: Option<String>,
    /// How far a kilogram of accumulated carbon a square metre lifts particles, m m² kg⁻¹.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 1e9)]
    height_exaggeration: Option<String>,
    /// Where the light comes from: `AZIMUTH,ELEVATION` in degrees, 5 to 90 high, or `time` for where the sun stood at the instant
    /// shown. Particles of map tiles are lit as by a sun no lower than 20 degrees.
    #[param(example = "315,40")]
    sun: Option<String>,
}

/// The same as values.
#[derive(Debug, Default, PartialEq)]
struct ParsedSurroundings {
    relief_exaggeration: Option<f64>,
    sea_opacity: Option<f64>,
    coastlines: Option<bool>,
    isolines: Option<IsolineWish>,
    trails: Option<ProductId>,
    trails_time: Option<TimeMs>,
    height_exaggeration: Option<f64>,
    sun: Option<SunChoice>,
}

impl SurroundingsQuery {
    /// Is the plain picture asked for?
    pub(crate) fn is_empty(&self) -> bool {
        self.fields().into_iter().all(|(_, text)| text.is_none())
    }

    fn fields(&self) -> [(&'static str, Option<&str>); 9] {
        [
            ("relief", self.relief.as_deref()),
            ("relief_exaggeration", self.relief_exaggeration.as_deref()),
            ("sea_opacity", self.sea_opacity.as_deref()),
            ("coastlines", self.coastlines.as_deref()),
            ("isolines", self.isolines.as_deref()),
            ("trails", self.trails.as_deref()),
            ("trails_time", self.trails_time.as_deref()),
            ("height_exaggeration", self.height_exaggeration.as_deref()),
            ("sun", self.sun.as_deref()),
        ]
    }

    fn parsed(&self) -> Result<ParsedSurroundings, ServerError> {
        let real = |name, text: &Option<String>, valid| {
            let text = text.as_deref();
            text.map(|text| number(name, text, valid)).transpose()
        };
        let coastlines = flag("coastlines", self.coastlines.as_deref())?;
        Ok(ParsedSurroundings {
            relief_exaggeration: real(
                "relief_exaggeration",
                &self.relief_exaggeration,
                "a number, 0 to 1000",
            )?,
            sea_opacity: real("sea_opacity", &self.sea_opacity, "a share, 0 to 0.99")?,
            coastlines,
            isolines: self.isolines.as_deref().map(str::parse).transpose()?,
            trails: self.trails.as_deref().map(str::parse).transpose()?,
            trails_time: time(self.trails_time.as_deref())?,
            height_exaggeration: real(
                "height_exaggeration",
                &self.height_exaggeration,
                "metres for each kilogram of carbon a square metre, 0 to 1e9",
            )?,
            sun: self.sun.as_deref().map(str::parse).transpose()?,
        })
    }

    /// The options of a picture, with what is asked for here.
    pub(crate) fn around(&self, options: &PictureOptions) -> Result<PictureOptions, ServerError> {
        let asked = self.parsed()?;
        Ok(PictureOptions {
            sea_opacity: asked.sea_opacity,
            coastlines: asked.coastlines,
            isolines: asked.isolines,
            height_m_per_kg_m2: asked.height_exaggeration,
            sun: asked.sun,
            ..*options
        })
    }

    /// The newest versions of the products that are asked for beside the layer.
    pub(crate) async fn beside(&self, catalogue: &Catalogue) -> Result<Beside, ServerError> {
        Ok(Beside {
            relief: self.relief(catalogue).await?,
            trails: self.trails(catalogue).await?,
        })
    }

    async fn trails(&self, catalogue: &Catalogue) -> Result<Option<VectorAt>, ServerError> {
        let asked = self.parsed()?;
        let Some(named) = asked.trails else {
            if let Some(text) = &self.trails_time {
                let valid = "it is an instant of trails, which are not asked for";
                return Err(ServerError::invalid("trails_time", text, valid));
            }
            return Ok(None);
        };
        let part = eastward_part(&named)?;
        let layer = match catalogue.layer(part.as_str()).await {
            Err(ServerError::UnknownProduct { .. }) => return Err(no_vector(&named).into()),
            layer => layer?,
        };
        if layer.northward.is_none() {
            return Err(no_vector(&named).into());
        }
        let time = asked.trails_time;
        Ok(Some(VectorAt { layer, time }))
    }

    async fn relief(&self, catalogue: &Catalogue) -> Result<Option<Relief>, ServerError> {
        let Some(product) = &self.relief else {
            return Ok(None);
        };
        let exaggeration = self.parsed()?.relief_exaggeration;
        let elevation = catalogue.layer(product).await?;
        let exaggeration = exaggeration.unwrap_or(RELIEF_EXAGGERATION);
        Ok(Some(Relief::of(&elevation.manifest, exaggeration)?))
    }

    /// The parameters as tiles take them, `name=value`, in one order and one spelling.
    pub(crate) fn of_tiles(&self) -> Result<Vec<String>, ServerError> {
        let asked = self.parsed()?;
        let relief = self.relief.as_ref();
        // A name of letters, digits and hyphens, whatever else was written.
        let relief = relief.map(|name| name.parse::<ProductId>()).transpose()?;
        let real = |number: Option<f64>| number.map(|number| number.to_string());
        let values = [
            relief.map(|name| name.to_string()),
            real(asked.relief_exaggeration),
            real(asked.sea_opacity),
            asked.coastlines.map(|drawn| drawn.to_string()),
            asked.isolines.map(|isolines| isolines.to_string()),
            asked.trails.map(|trails| trails.to_string()),
            asked.trails_time.map(|time| time.to_string()),
            real(asked.height_exaggeration),
            asked.sun.map(|sun| sun.to_string()),
        ];
        let named = self.fields().into_iter().zip(values);
        Ok(named
            .filter_map(|((name, _), value)| Some(format!("{name}={}", value?)))
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn query(
        field: fn(&mut SurroundingsQuery) -> &mut Option<String>,
        text: &str,
    ) -> SurroundingsQuery {
        let mut query = SurroundingsQuery::default();
        *field(&mut query) = Some(text.to_owned());
        query
    }

    #[test]
    fn words_that_mean_nothing_are_refused_with_what_would_be_valid() {
        let refused: [(SurroundingsQuery, &str); 8] = [
            (query(|q| &mut q.trails, "Sea&"), "starting with a letter"),
            (query(|q| &mut q.trails_time, "noon"), "2000"),
            (query(|q| &mut q.sea_opacity, "half"), "a share"),
            (query(|q| &mut q.coastlines, "yes"), "true or false"),
            (query(|q| &mut q.isolines, "-1"), "such as 10"),
            (query(|q| &mut q.sun, "noon"), "such as 315,40"),
            (query(|q| &mut q.height_exaggeration, "inf"), "metres"),
            (query(|q| &mut q.relief_exaggeration, ""), "0 to 1000"),
        ];
        for (query, valid) in refused {
            let text = query.parsed().unwrap_err().to_string();
            assert!(text.contains(valid), "{text}");
        }
    }

    #[test]
    fn tiles_are_asked_for_in_one_spelling() {
        let mut query = query(|q| &mut q.sun, "time");
        query.relief = Some("etopo20".to_owned());
        query.sea_opacity = Some("0.50".to_owned());
        query.isolines = Some("2.50".to_owned());
        query.trails = Some("sea".to_owned());
        query.trails_time = Some("2002-01-15".to_owned());
        assert_eq!(
            query.of_tiles().unwrap(),
            [
                "relief=etopo20",
                "sea_opacity=0.5",
                "isolines=2.5",
                "trails=sea",
                "trails_time=2002-01-15T00:00:00Z",
                "sun=time"
            ]
        );
        // A plus sign is a space to a query.
        query.trails_time = Some("2002-01-15T02:00:00 02:00".to_owned());
        let again = query.of_tiles().unwrap();
        assert_eq!(again[4], "trails_time=2002-01-15T00:00:00Z");
        query.relief = Some("a&b".to_owned());
        assert!(query.of_tiles().is_err());
        assert!(SurroundingsQuery::default().is_empty() && !query.is_empty());
    }
}
