//! Words for what is drawn over a picture of the globe so that it explains itself.

use clap::Args;
use contract::annotation::{Annotation, AnnotationWishes, Graticule};

/// The heading of these words in help texts.
const HEADING: &str = "Annotations";

/// What is drawn over the finished picture.
#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a word of the command line"
)]
pub(crate) struct Annotated {
    /// All annotations below that the picture has something to tell of.
    #[arg(long, help_heading = HEADING)]
    annotate: bool,
    /// What the colours mean: a bar with numbers and the unit.
    #[arg(long, help_heading = HEADING)]
    legend: bool,
    /// The instant in plain words, and what the values are means over.
    #[arg(long, help_heading = HEADING)]
    date: bool,
    /// Meridians and parallels every so many degrees, 0.01 to 90, as in `--graticule 15`; what suits the view if no number
    /// is given. Lines that nobody could tell apart are fewer.
    #[arg(long, help_heading = HEADING, value_name = "DEGREES", allow_negative_numbers = true, value_parser = graticule)]
    #[expect(
        clippy::option_option,
        reason = "clap's way to say: not there, or there without a number"
    )]
    graticule: Option<Option<Graticule>>,
    /// Names of oceans and seas where there is room for them.
    #[arg(long, help_heading = HEADING)]
    names: bool,
    /// How long a kilometre is on the ground in the middle of the picture.
    #[arg(long, help_heading = HEADING)]
    scale_bar: bool,
    /// How much accumulated carbon a drawn height stands for, to scale in the middle of the picture where it is seen from
    /// the side; only where carbon lifts particles.
    #[arg(long, help_heading = HEADING)]
    height_bar: bool,
    /// Title and citation of the product.
    #[arg(long, help_heading = HEADING)]
    source: bool,
}

impl Annotated {
    /// The same for the contract.
    pub(crate) fn wishes(&self) -> AnnotationWishes {
        let all = if self.annotate {
            AnnotationWishes::all()
        } else {
            AnnotationWishes::default()
        };
        let named = [
            (self.legend, Annotation::Legend),
            (self.date, Annotation::Date),
            (self.graticule.is_some(), Annotation::Graticule),
            (self.names, Annotation::Names),
            (self.scale_bar, Annotation::Scale),
            (self.height_bar, Annotation::Height),
            (self.source, Annotation::Source),
        ];
        let named = named.into_iter().filter(|(is_asked, _)| *is_asked);
        let wishes = named.fold(all, |wishes, (_, one)| wishes.with(one));
        match self.graticule.flatten() {
            Some(graticule) => wishes.with_graticule(graticule),
            None => wishes,
        }
    }
}

fn graticule(text: &str) -> Result<Graticule, String> {
    let degrees: f64 = text
        .parse()
        .map_err(|_no_number| "degrees between lines, such as 15".to_owned())?;
    Graticule::every(degrees).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use crate::cli::{Cli, Command, Render};
    use clap::Parser as _;
    use contract::annotation::{Annotation, AnnotationWishes, Graticule};

    fn wishes(words: &[&str]) -> Result<AnnotationWishes, String> {
        let start = [
            "fluxglobe",
            "render",
            "globe",
            "--layer",
            "p",
            "--lon",
            "0",
            "--lat",
            "0",
        ];
        let words = start.iter().chain(words).chain(&["-o", "a.png"]);
        let cli = Cli::try_parse_from(words).map_err(|error| error.to_string())?;
        let Command::Render(Render::Globe(globe)) = cli.command else {
            panic!("it is a globe");
        };
        Ok(globe.annotations.wishes())
    }

    #[test]
    fn every_word_asks_for_one_annotation() {
        assert_eq!(wishes(&[]).unwrap(), AnnotationWishes::default());
        assert_eq!(wishes(&["--annotate"]).unwrap(), AnnotationWishes::all());
        for (word, one) in [
            ("--legend", Annotation::Legend),
            ("--date", Annotation::Date),
            ("--graticule", Annotation::Graticule),
            ("--names", Annotation::Names),
            ("--scale-bar", Annotation::Scale),
            ("--height-bar", Annotation::Height),
            ("--source", Annotation::Source),
        ] {
            let alone = AnnotationWishes::default().with(one);
            assert_eq!(wishes(&[word]).unwrap(), alone, "{word}");
        }
        let fine = wishes(&["--annotate", "--graticule", "2.5"]).unwrap();
        assert_eq!(fine.graticule(), Graticule::every(2.5).ok());
    }

    #[test]
    fn lines_at_no_distance_are_refused_with_what_would_do() {
        for bad in ["0", "NaN", "1000", "-5"] {
            let refused = wishes(&["--graticule", bad]).unwrap_err();
            assert!(refused.contains("0.01 to 90"), "{refused}");
        }
        assert!(
            wishes(&["--graticule", "dense"])
                .unwrap_err()
                .contains("such as 15")
        );
    }
}
