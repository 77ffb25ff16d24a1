//! What an address asks for over a finished picture of the globe: parameters in, checked wishes out.

use contract::annotation::{AnnotationWishes, Annotations, GRATICULE_LIMITS_DEG, Graticule};
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::{number, parsed};

/// The parameters of an address that say it, as they were written.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct AnnotationsQuery {
    /// What is drawn over the picture so that it explains itself: any of `legend`, `date`, `graticule`, `names`, `scale`,
    /// `height` and `source` with commas between, or `all` that the picture has something to tell of. By name, what it has
    /// nothing to tell of is refused.
    #[param(example = "legend,date,names")]
    annotate: Option<String>,
    /// Degrees between the lines of the graticule, which this asks for; what suits the view unless one is given.
    #[param(value_type = Option<f64>, minimum = 0.01, maximum = 90)]
    graticule: Option<String>,
}

impl AnnotationsQuery {
    /// The texts as values.
    pub(crate) fn wishes(&self) -> Result<AnnotationWishes, ServerError> {
        let wishes: AnnotationWishes = parsed(self.annotate.as_deref())?.unwrap_or_default();
        let Some(text) = self.graticule.as_deref() else {
            return Ok(wishes);
        };
        let [least, most] = GRATICULE_LIMITS_DEG;
        let valid = format!("degrees between lines, {least} to {most}");
        let graticule = Graticule::every(number("graticule", text, &valid)?)?;
        Ok(wishes.with_graticule(graticule))
    }

    /// Refuses all of them, for what map tiles are drawn by.
    pub(crate) fn refused_on_tiles(&self) -> Result<(), ServerError> {
        if self.annotate.is_none() && self.graticule.is_none() {
            return Ok(());
        }
        Err(Annotations::refused_on_tiles().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::annotation::Annotation;

    fn query(annotate: Option<&str>, graticule: Option<&str>) -> AnnotationsQuery {
        AnnotationsQuery {
            annotate: annotate.map(str::to_owned),
            graticule: graticule.map(str::to_owned),
        }
    }

    #[test]
    fn lines_at_a_distance_ask_for_a_graticule() {
        assert!(query(None, None).wishes().unwrap().is_empty());
        let lines = query(None, Some("7.5")).wishes().unwrap();
        assert_eq!(lines.graticule(), Graticule::every(7.5).ok());
        assert!(lines.has(Annotation::Graticule) && !lines.has(Annotation::Names));
        let both = query(Some("names"), Some("7.5")).wishes().unwrap();
        assert!(both.has(Annotation::Graticule) && both.has(Annotation::Names));
    }

    #[test]
    fn what_means_nothing_is_refused_with_what_would() {
        for (annotate, graticule, valid) in [
            (
                Some("legend,north"),
                None,
                "legend, date, graticule, names, scale, height, source",
            ),
            (Some(""), None, "all, or any of"),
            (None, Some("0"), "0.01 to 90"),
            (None, Some("NaN"), "0.01 to 90"),
            (None, Some("1000"), "0.01 to 90"),
            (Some("all"), Some("fine"), "0.01 to 90"),
        ] {
            let refused = query(annotate, graticule).wishes().unwrap_err().to_string();
            assert!(refused.contains(valid), "{refused}");
        }
        query(None, None).refused_on_tiles().unwrap();
        for asked in [query(Some("all"), None), query(None, Some("15"))] {
            let refused = asked.refused_on_tiles().unwrap_err().to_string();
            assert!(refused.contains("neighbours would cut"), "{refused}");
        }
    }
}
