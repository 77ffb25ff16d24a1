//! Words for colours, opacity and size, and for legends. Values are in the unit that the legend shows.

use std::path::PathBuf;

use clap::Args;
use contract::colour::{Palette, Rgb, Scale, Share, ShownRange, Stops, TransferOptions};
use contract::product::ProductId;

/// Where help lists them: apart from what says which picture.
pub(super) const HEADING: &str = "Look";

/// Refuses `--doubt` with what to write.
pub(super) fn old_word(_nothing: &str) -> Result<bool, String> {
    Err("it is called --uncertainty now".to_owned())
}

/// What changes colours, opacity and size from the usual.
#[derive(Debug, Args)]
pub(crate) struct Look {
    /// balance, curl, delta, thermal, haline, ice, algae, speed, dense or gray.
    #[arg(long, help_heading = HEADING)]
    pub(crate) palette: Option<Palette>,
    /// Values of the first and the last colour, in the legend's unit, such as -40:40.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true, help_heading = HEADING)]
    pub(crate) range: Option<ShownRange>,
    /// How values are spread over the colours: linear, or log for ranges above 0 over several powers of ten; the quantity's
    /// own if absent, which is log for chlorophyll.
    #[arg(long, value_name = "linear|log", help_heading = HEADING)]
    pub(crate) scale: Option<Scale>,
    /// Colours in place of a palette's, 2 to 16 stops such as '-40:#11387f,0:#f0f0ee,40:#760e24'; two at one value jump.
    #[arg(long, value_name = "VALUE:#rrggbb,...", allow_hyphen_values = true, help_heading = HEADING)]
    pub(crate) stops: Option<Stops<Rgb>>,
    /// Share of the usual opacity by value, up to 16 stops such as '-40:1,0:0.1,40:1'.
    #[arg(long, value_name = "VALUE:SHARE,...", allow_hyphen_values = true, help_heading = HEADING)]
    pub(crate) opacity: Option<Stops<Share>>,
    /// Share of a particle's full size by value, up to 16 stops such as '0:0.3,40:1'.
    #[arg(long, value_name = "VALUE:SHARE,...", allow_hyphen_values = true, help_heading = HEADING)]
    pub(crate) particle_size: Option<Stops<Share>>,
    /// The palette's last colour first.
    #[arg(long, help_heading = HEADING)]
    pub(crate) reverse: bool,
}

impl Look {
    /// The same for the contract.
    pub(crate) fn options(&self) -> TransferOptions {
        TransferOptions {
            palette: self.palette,
            range: self.range,
            scale: self.scale,
            colours: self.stops.unwrap_or_default(),
            opacity: self.opacity.unwrap_or_default(),
            size: self.particle_size.unwrap_or_default(),
            reversed: self.reverse,
        }
    }
}

/// `fluxglobe render legend`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  fluxglobe render legend --layer takahashi09-flux --palette curl --range -60:60 -o legend.svg"
)]
pub(crate) struct RenderLegend {
    /// Product.
    #[arg(long, alias = "product")]
    pub(crate) layer: ProductId,
    /// File to write, its kind by its name: .png, .svg or .json.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) look: Look,
}

#[cfg(test)]
mod tests {
    use super::Scale;
    use crate::cli::{Cli, Command, Render};
    use clap::Parser as _;
    use contract::isolines::IsolineWish;

    fn parsed(words: &[&str]) -> Result<Cli, String> {
        let start = ["fluxglobe", "render", "tile", "--layer", "p", "-o", "a.png"];
        let place = ["--z", "0", "--x", "0", "--y", "0"];
        let words = start.iter().chain(&place).chain(words);
        Cli::try_parse_from(words).map_err(|error| error.to_string())
    }

    #[test]
    fn looks_of_negative_values_are_understood() {
        let words = [
            "--range",
            "-40:40",
            "--opacity",
            "-40:1,0:0.1,40:1",
            "--particle-size=-40:1",
            "--uncertainty",
            "--scale=log",
            "--isolines",
            "auto",
        ];
        let Command::Render(Render::Tile(tile)) = parsed(&words).unwrap().command else {
            panic!("it is a tile");
        };
        let options = tile.picture.look.options();
        assert_eq!(options.opacity.as_slice().len(), 3);
        assert_eq!(options.range.unwrap().to_string(), "-40:40");
        assert!(tile.picture.uncertainty && !options.is_default());
        assert_eq!(options.scale, Some(Scale::Log));
        assert_eq!(tile.picture.surroundings.isolines, Some(IsolineWish::Auto));
    }

    #[test]
    fn looks_that_mean_nothing_are_refused_with_what_is_valid() {
        for (words, reason) in [
            (["--palette", "jet"], "balance, curl"),
            (["--range", "40:-40"], "LOW:HIGH"),
            (["--stops", "0:red,1:blue"], "#rrggbb"),
            (["--opacity", "0:7"], "from 0 to 1"),
            (["--scale", "ln"], "linear or log"),
            (["--isolines", "0"], "such as 10"),
        ] {
            let refused = parsed(&words).unwrap_err();
            assert!(refused.contains(reason), "{refused}");
        }
    }
}
