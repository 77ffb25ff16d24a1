//! Words for the ground of a globe view, and for what lies behind the globe.

use clap::Args;
use contract::base_map::{Background, BaseMap};

use super::surroundings::HEADING;

/// What a picture of the globe has below and beside its particles.
#[derive(Debug, Args)]
pub(crate) struct Ground {
    /// Draw borders of countries, thinner than coasts; wherever coast lines are drawn if absent.
    #[arg(
        long,
        help_heading = HEADING,
        num_args = 0..=1,
        default_missing_value = "true",
        value_name = "true|false"
    )]
    borders: Option<bool>,
    /// Shade the plain globe by a coarse relief of land and sea floor; true if absent. One given by --relief takes its place.
    #[arg(
        long,
        help_heading = HEADING,
        num_args = 0..=1,
        default_missing_value = "true",
        value_name = "true|false"
    )]
    sea_floor: Option<bool>,
    /// End a thematic map (--mode map) and its isolines at coasts: cells cover land too, of coarse grids much. Lakes count as land.
    #[arg(long, help_heading = HEADING)]
    mask_land: bool,
    /// Colours of the plain globe: dark or light.
    #[arg(long, help_heading = HEADING, default_value_t, value_name = "dark|light")]
    base_map: BaseMap,
    /// What is seen beside the globe: none, which leaves it transparent, or sky; sky if absent, unless the globe is left out.
    #[arg(long, help_heading = HEADING, value_name = "none|sky")]
    background: Option<Background>,
    /// Leave out the plain globe behind the particles.
    #[arg(long)]
    transparent: bool,
}

/// The same for the contract.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct GroundOptions {
    /// A plain globe behind the particles.
    pub(crate) surface: bool,
    pub(crate) borders: Option<bool>,
    pub(crate) sea_floor: Option<bool>,
    /// A thematic map ends at coasts.
    pub(crate) mask_land: bool,
    pub(crate) base_map: Option<BaseMap>,
    pub(crate) background: Option<Background>,
}

impl Ground {
    pub(crate) fn options(&self) -> GroundOptions {
        // A picture or a film stands for itself; a sky round nothing would be refused.
        let usual = if self.transparent {
            Background::None
        } else {
            Background::Sky
        };
        GroundOptions {
            surface: !self.transparent,
            borders: self.borders,
            sea_floor: self.sea_floor,
            mask_land: self.mask_land,
            base_map: Some(self.base_map),
            background: Some(self.background.unwrap_or(usual)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command, Render, RenderGlobe};
    use clap::Parser as _;

    fn globe(words: &[&str]) -> Result<RenderGlobe, String> {
        let start = "fluxglobe render globe --layer p --lon 0 --lat 0 -o a.png";
        let words = start.split(' ').chain(words.iter().copied());
        let cli = Cli::try_parse_from(words).map_err(|error| error.to_string())?;
        match cli.command {
            Command::Render(Render::Globe(globe)) => Ok(globe),
            _ => Err("it is no globe".to_owned()),
        }
    }

    #[test]
    fn switches_stand_alone_or_take_true_or_false() {
        let lines = |words: &[&str]| globe(words).unwrap().picture.surroundings.coastlines;
        assert_eq!(lines(&[]), None);
        assert_eq!(lines(&["--coastlines"]), Some(true));
        assert_eq!(lines(&["--coastlines", "--annotate"]), Some(true));
        assert_eq!(lines(&["--coastlines", "false"]), Some(false));
        assert_eq!(lines(&["--coastlines=true"]), Some(true));
        globe(&["--coastlines", "maybe"]).unwrap_err();
        let ground = globe(&["--borders=false", "--sea-floor", "false"]).unwrap();
        let options = ground.ground.options();
        assert_eq!(
            (options.borders, options.sea_floor),
            (Some(false), Some(false))
        );
        assert!(!options.mask_land);
        assert!(globe(&["--mask-land"]).unwrap().ground.options().mask_land);
    }

    #[test]
    fn a_picture_has_a_sky_unless_told_otherwise_and_none_without_a_globe() {
        let of = |words: &[&str]| globe(words).unwrap().ground.options();
        assert_eq!(of(&[]).background, Some(Background::Sky));
        assert_eq!(
            of(&["--background", "none"]).background,
            Some(Background::None)
        );
        let bare = of(&["--transparent"]);
        assert_eq!(
            (bare.surface, bare.background),
            (false, Some(Background::None))
        );
        assert_eq!(of(&["--base-map", "light"]).base_map, Some(BaseMap::Light));
        let refused = globe(&["--base-map", "grey"]).unwrap_err();
        assert!(refused.contains("dark or light"), "{refused}");
    }
}
