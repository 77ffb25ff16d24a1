//! Render jobs: everything that shapes a picture, and the digest of it that names the picture.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::annotation::Annotations;
use crate::camera::{CameraAngles, check_height};
use crate::colour::TransferFunction;
use crate::context::{Context, Relief};
use crate::digest::Digest;
use crate::flow::Flow;
use crate::grid::Grid;
use crate::key::ObjectKey;
use crate::sun::Sun;
use crate::tile::Tile;
use crate::time_sample::TimeSample;
use crate::trails::{TRAILS_PER_CELL, Trails};

/// Raised whenever the renderer draws the same job differently or writes the same picture in other bytes, so that old
/// pictures are not taken for new ones: a name has one content for ever. `make bless` asks for it.
pub const RENDERER_VERSION: u32 = 11;
/// Largest width and height of a picture, pixels.
pub const MAX_IMAGE_PX: u32 = 7680;
/// Most pixels of a picture: as many as 8K has (7680 x 4320).
pub const MAX_PIXELS: u64 = 7680 * 4320;
/// Most slices of a half-angle volume.
pub const MAX_SLICES: u32 = 256;
/// Most particles a cell may carry.
pub const MAX_PARTICLES_PER_CELL: u32 = 256;

/// How a product is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Thematic map: the interpolated grid in colours.
    Map,
    /// One dot a particle.
    Points,
    /// Soft round sprites without shadows.
    Sprites,
    /// Half-angle-sliced volume with shadows.
    Volume,
    /// Particles that drift with a vector field, with trails.
    Flow,
}

impl Mode {
    /// All of them, in the order they are offered.
    pub const ALL: [Self; 5] = [
        Self::Map,
        Self::Points,
        Self::Sprites,
        Self::Volume,
        Self::Flow,
    ];
    /// Those that draw one product alone; a flow needs both parts of a vector.
    pub const SCALAR: [Self; 4] = [Self::Map, Self::Points, Self::Sprites, Self::Volume];

    /// Name in URLs and on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Map => "map",
            Self::Points => "points",
            Self::Sprites => "sprites",
            Self::Volume => "volume",
            Self::Flow => "flow",
        }
    }
}

impl std::fmt::Display for Mode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl std::str::FromStr for Mode {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|mode| mode.as_str() == s);
        found.ok_or_else(|| {
            ContractError::invalid("mode", s, "map, points, sprites, volume or flow")
        })
    }
}

/// From where a picture is taken.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum View {
    /// A map tile; `size_px` pixels a side, 256 or 512.
    Tile {
        /// Address.
        tile: Tile,
        /// Pixels a side.
        size_px: u32,
    },
    /// The globe in perspective.
    Globe {
        /// Longitude below the camera (above it where it stands below the sea), degrees.
        #[serde(with = "crate::exact")]
        lon_deg: f64,
        /// Latitude below the camera, degrees.
        #[serde(with = "crate::exact")]
        lat_deg: f64,
        /// Height of the camera above the ground, m; negative below the sea surface.
        #[serde(with = "crate::exact")]
        height_m: f64,
        /// Picture width, pixels.
        width_px: u32,
        /// Picture height, pixels.
        height_px: u32,
        /// Which way the camera looks: straight down with north up unless told otherwise.
        #[serde(default, skip_serializing_if = "CameraAngles::is_usual")]
        angles: CameraAngles,
    },
}

/// What a picture looks like. A word that is not known is refused: it would be another picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Style {
    /// Value to colour.
    pub transfer: TransferFunction,
    /// Height of one kilogram of accumulated carbon per square metre, m: the height exaggeration.
    #[serde(with = "crate::exact")]
    pub height_m_per_kg_m2: f64,
    /// Half-angle slices over the range of particles, 1 to [`MAX_SLICES`].
    pub slices: u32,
    /// Particles of every cell with data, 1 to [`MAX_PARTICLES_PER_CELL`].
    pub particles_per_cell: u32,
    /// Optical depth looking straight through a cell's column at the top of the transfer function.
    #[serde(with = "crate::exact")]
    pub optical_depth: f64,
    /// Light.
    pub sun: Sun,
    /// Draw a plain globe behind the particles of a globe view.
    pub globe_surface: bool,
    /// Draw cells whose gap was filled differently, by their estimated error, and sums of accumulated carbon that lack
    /// data of some of their time, by its share: hatched on maps, paler as particles.
    // Spelt as in the names of pictures that are stored.
    #[serde(rename = "doubt", default, skip_serializing_if = "std::ops::Not::not")]
    pub uncertainty: bool,
    /// Pixels have the value of the cell that they lie in, and gaps stay gaps: codes and directions have nothing between two of them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub nearest: bool,
    /// Coast lines and the sea.
    #[serde(default, skip_serializing_if = "Context::is_empty")]
    pub context: Context,
}

/// Everything that shapes a picture and nothing else. Two jobs with the same digest are the same picture, byte for
/// byte; versions and instants that come to the same fields come to the same job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderJob {
    /// [`RENDERER_VERSION`].
    pub renderer_version: u32,
    /// The grid of all fields.
    #[serde(with = "crate::exact::grid")]
    pub grid: Grid,
    /// The product drawn.
    pub value: TimeSample,
    /// Accumulated carbon that lifts and sinks the particles; without it they lie in a thin sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accumulated: Option<TimeSample>,
    /// Relief of land and sea floor below the particles: on globe views with a surface, and on map tiles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relief: Option<Relief>,
    /// What makes the product drawn the eastward part of a vector; there if and only if the mode is [`Mode::Flow`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<Flow>,
    /// A vector whose trails lie on the sea surface: under particles that rise above it, over those that lie on it or sink,
    /// and over the colours of a map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trails: Option<Box<Trails>>,
    /// Mode.
    pub mode: Mode,
    /// View.
    pub view: View,
    /// Style.
    pub style: Style,
    /// What is drawn over the finished picture: on globe views.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub annotations: Option<Annotations>,
}

impl Style {
    /// Slices of a globe view unless told otherwise: seen at a slant, clouds need thinner ones than on a map.
    pub const GLOBE_SLICES: u32 = 128;
    /// Clouds of a cell of a globe view at most, unless told otherwise: where cells are wide, smaller clouds show how light
    /// falls within them. No more than on a map are drawn on a pixel.
    pub const GLOBE_PARTICLES_PER_CELL: u32 = 64;

    /// What a picture looks like unless told otherwise.
    pub fn with_transfer(transfer: TransferFunction) -> Self {
        Self {
            transfer,
            height_m_per_kg_m2: 8.0e6,
            slices: 64,
            particles_per_cell: 16,
            optical_depth: 1.5,
            sun: Sun {
                azimuth_deg: 315.0,
                elevation_deg: 40.0,
                subsolar: None,
            },
            globe_surface: false,
            uncertainty: false,
            nearest: false,
            context: Context::default(),
        }
    }

    fn validate(&self) -> Result<(), ContractError> {
        self.transfer.validate()?;
        let numbers = [self.height_m_per_kg_m2, self.optical_depth];
        let bad = |reason: &str| {
            Err(ContractError::invalid(
                "style",
                &format!("{self:?}"),
                reason,
            ))
        };
        if numbers.iter().any(|v| !v.is_finite()) {
            return bad("numbers must be finite");
        }
        if !(1..=MAX_SLICES).contains(&self.slices) {
            return bad("slices are 1 to 256");
        }
        if !(1..=MAX_PARTICLES_PER_CELL).contains(&self.particles_per_cell) {
            return bad("particles a cell are 1 to 256");
        }
        if !(0.0..=100.0).contains(&self.optical_depth)
            || !(0.0..=1e9).contains(&self.height_m_per_kg_m2)
        {
            return bad("optical depth is 0 to 100, height 0 to 1e9 m per kg m-2");
        }
        self.sun.validate()?;
        self.context.validate()?;
        let isolines = self.context.isolines;
        isolines.map_or(Ok(()), |isolines| isolines.lines(&self.transfer).map(drop))
    }
}

impl View {
    /// Width and height, pixels.
    pub fn size_px(&self) -> [u32; 2] {
        match *self {
            Self::Tile { size_px, .. } => [size_px; 2],
            Self::Globe {
                width_px,
                height_px,
                ..
            } => [width_px, height_px],
        }
    }

    /// Checks every limit of a view.
    ///
    /// # Errors
    /// The limit that is broken, with what would be valid.
    pub fn validate(&self) -> Result<(), ContractError> {
        let bad =
            |what, text: String, reason: &str| Err(ContractError::invalid(what, &text, reason));
        let names = match self {
            Self::Tile { .. } => ["size"; 2],
            Self::Globe { .. } => ["width", "height"],
        };
        for (what, px) in names.into_iter().zip(self.size_px()) {
            if !(1..=MAX_IMAGE_PX).contains(&px) {
                let reason = "pictures are 1 to 7680 pixels wide and high";
                return bad(what, px.to_string(), reason);
            }
        }
        let [width, height] = self.size_px().map(u64::from);
        if width * height > MAX_PIXELS {
            let reason = "pictures have at most as many pixels as 7680 x 4320";
            return bad("size", format!("{width}x{height}"), reason);
        }
        match *self {
            Self::Tile { tile, size_px } => {
                if size_px != 256 && size_px != 512 {
                    let reason = "tiles are 256 or 512 pixels a side";
                    return bad("size", size_px.to_string(), reason);
                }
                Tile::new(tile.z, tile.x, tile.y).map(|_inside| ())
            }
            Self::Globe {
                lon_deg,
                lat_deg,
                height_m,
                angles,
                ..
            } => {
                crate::grid::LonLatDeg::new(lon_deg, lat_deg)?;
                check_height(height_m)?;
                angles.validate(height_m, self.size_px())
            }
        }
    }
}

impl RenderJob {
    /// Checks every limit of a job that came from outside.
    ///
    /// # Errors
    /// The first limit that is broken, with what would be valid.
    pub fn validate(&self) -> Result<(), ContractError> {
        if self.renderer_version != RENDERER_VERSION {
            let text = self.renderer_version.to_string();
            return Err(ContractError::invalid(
                "renderer version",
                &text,
                format!("this one is {RENDERER_VERSION}"),
            ));
        }
        self.grid.validate()?;
        self.value.validate()?;
        self.accumulated
            .as_ref()
            .map_or(Ok(()), TimeSample::validate)?;
        self.relief.as_ref().map_or(Ok(()), Relief::validate)?;
        self.validate_flow()?;
        self.validate_trails()?;
        self.validate_annotations()?;
        self.style.validate()?;
        if self.style.nearest && self.style.context.isolines.is_some() {
            let reason = "codes, directions and days of the year have nothing between two of them that lines could run through; leave isolines out";
            return Err(ContractError::invalid(
                "isolines",
                self.value.product(),
                reason,
            ));
        }
        let Style {
            context,
            globe_surface,
            ..
        } = &self.style;
        let is_tile = matches!(self.view, View::Tile { .. });
        context.validate_on(is_tile, *globe_surface)?;
        if context.mask_land && self.mode != Mode::Map {
            let reason = "it ends thematic maps at coasts; particles are of whole cells and stand high: leave it out, or draw a map";
            let mode = self.mode.as_str();
            return Err(ContractError::invalid("mask of land", mode, reason));
        }
        self.view.validate()
    }

    fn validate_flow(&self) -> Result<(), ContractError> {
        let bad = |reason: &str| {
            let text = format!("{} {:?}", self.mode, self.flow);
            Err(ContractError::invalid("flow", &text, reason))
        };
        match &self.flow {
            None if self.mode == Mode::Flow => {
                bad("this mode needs the northward part of a vector")
            }
            Some(_) if self.mode != Mode::Flow || self.accumulated.is_some() => {
                bad("only the mode flow has a northward part, and nothing lifts its particles")
            }
            Some(_) if self.style.context.isolines.is_some() => bad(
                "isolines are those of one quantity; leave them out, or draw a part of the vector as a map",
            ),
            flow => flow.as_ref().map_or(Ok(()), Flow::validate),
        }
    }

    fn validate_trails(&self) -> Result<(), ContractError> {
        let (Some(trails), Some(alone)) = (&self.trails, self.trails_alone()) else {
            return Ok(());
        };
        if self.mode == Mode::Flow && self.value.product() == trails.eastward.product() {
            let reason = "it is what is drawn as a flow; leave its trails out, or draw another layer or mode";
            return Err(ContractError::invalid(
                "trails",
                trails.eastward.product(),
                reason,
            ));
        }
        // What they are drawn by has the limits of any job.
        alone.validate()
    }

    fn validate_annotations(&self) -> Result<(), ContractError> {
        let Some(annotations) = &self.annotations else {
            return Ok(());
        };
        if matches!(self.view, View::Tile { .. }) {
            return Err(Annotations::refused_on_tiles());
        }
        if annotations.height.is_some() && self.accumulated.is_none() {
            let reason = "nothing lifts the particles of this picture";
            return Err(ContractError::invalid("annotations", "height", reason));
        }
        annotations.validate()
    }

    /// The job that draws the trails alone in the same view, on nothing.
    pub fn trails_alone(&self) -> Option<Self> {
        let trails = self.trails.as_ref()?;
        Some(Self {
            renderer_version: self.renderer_version,
            grid: trails.grid,
            value: trails.eastward.clone(),
            accumulated: None,
            relief: None,
            flow: Some(trails.flow.clone()),
            trails: None,
            mode: Mode::Flow,
            view: self.view,
            style: Style {
                particles_per_cell: TRAILS_PER_CELL,
                ..Style::with_transfer(trails.transfer)
            },
            annotations: None,
        })
    }

    /// The digest that names the picture.
    pub fn digest(&self) -> Digest {
        Digest::of_json(self)
    }

    /// Where the picture is kept.
    pub fn key(&self) -> ObjectKey {
        ObjectKey::tile(&self.digest())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::annotation::{DateLabel, Graticule, HeightScale, Label};
    use crate::base_map::{Background, BaseMap};
    use crate::colour::{Palette, Scale, Share, Stops};
    use crate::isolines::Isolines;
    use crate::quantity::Quantity;
    use crate::sun::Subsolar;
    use crate::time_sample::{After, Counts};

    fn sample() -> TimeSample {
        TimeSample {
            domain: "domain/p/d".parse().unwrap(),
            before: Some("frames/p/a".parse().unwrap()),
            after: Some(after("frames/p/b", 0.25)),
            contributed: None,
        }
    }

    fn after(field: &str, weight: f64) -> After {
        let field = field.parse().unwrap();
        After { field, weight }
    }

    fn counts(before: &str) -> Counts {
        let before = before.parse().ok();
        let after = None;
        Counts { before, after }
    }

    fn job() -> RenderJob {
        RenderJob {
            renderer_version: RENDERER_VERSION,
            grid: Grid {
                rows: 2,
                cols: 4,
                north_deg: 90.0,
                west_deg: -180.0,
                dlat_deg: 90.0,
                dlon_deg: 90.0,
            },
            value: sample(),
            accumulated: None,
            relief: None,
            flow: None,
            trails: None,
            mode: Mode::Volume,
            view: View::Tile {
                tile: Tile { z: 1, x: 0, y: 0 },
                size_px: 256,
            },
            style: Style::with_transfer(TransferFunction::default_for(Quantity::CarbonFlux)),
            annotations: None,
        }
    }

    /// As they may come from outside: what is read is checked later.
    fn shares_beyond_one() -> Stops<Share> {
        serde_json::from_str(r#"[["0","1.5"]]"#).unwrap()
    }

    #[test]
    fn a_job_in_the_usual_style_names_nothing_that_it_does_not_use() {
        let json = serde_json::to_string(&job()).unwrap();
        for unused in [
            "reversed", "colors", "opacity", "\"size\"", "doubt", "scale", "isolines",
        ] {
            assert!(!json.contains(unused), "{unused}: {json}");
        }
    }

    fn subsolar(lon_deg: f64) -> Subsolar {
        let lat_deg = 20.0;
        Subsolar { lon_deg, lat_deg }
    }

    fn every(step: f64) -> Isolines {
        Isolines::Every { zero: 0.0, step }
    }

    fn relief(exaggeration: f64) -> Relief {
        Relief {
            grid: job().grid,
            field: "frames/etopo/a".parse().unwrap(),
            exaggeration,
        }
    }

    #[test]
    fn a_job_of_an_older_program_keeps_its_name() {
        let text = serde_json::to_string(&job()).unwrap();
        for later in [
            "relief",
            "context",
            "subsolar",
            "contributed",
            "annotations",
            "trails",
            "look",
        ] {
            assert!(!text.contains(later), "{text}");
        }
        assert!(text.contains(r#""sun":{"azimuth_deg":"315","elevation_deg":"40"}"#));
        let back: RenderJob = serde_json::from_str(&text).unwrap();
        assert_eq!(back.digest(), job().digest());
    }

    /// Each another picture; none of them a valid one of a tile.
    const ANNOTATED: &[fn(&mut RenderJob)] = &[
        |j| over(j, |a| a.legend = Some(Quantity::CarbonFlux)),
        |j| over(j, |a| a.legend = Some(Quantity::AccumulatedCarbon)),
        |j| over(j, |a| a.date = date("15 July 2000", None)),
        |j| over(j, |a| a.date = date("16 July 2000", None)),
        |j| over(j, |a| a.date = date("16 July 2000", Label::cut("daily"))),
        |j| over(j, |a| a.graticule = Graticule::every(10.0).ok()),
        |j| over(j, |a| a.graticule = Graticule::every(15.0).ok()),
        |j| over(j, |a| a.names = true),
        |j| over(j, |a| a.scale = true),
        |j| over(j, |a| a.height = since("2000")),
        |j| over(j, |a| a.height = since("2001")),
        |j| over(j, |a| a.source = Label::cut("A")),
        |j| over(j, |a| a.source = Label::cut("B")),
        |j| over(j, |a| (a.version, a.names) = (a.version + 1, true)),
    ];

    fn over(job: &mut RenderJob, change: impl Fn(&mut Annotations)) {
        let mut annotations = Annotations::none();
        change(&mut annotations);
        job.annotations = Some(annotations);
    }

    fn date(shown: &str, note: Option<Label>) -> Option<DateLabel> {
        let shown = Label::cut(shown)?;
        Some(DateLabel { shown, note })
    }

    fn since(time: &str) -> Option<HeightScale> {
        let since = time.parse().ok()?;
        Some(HeightScale { since })
    }

    #[test]
    fn annotations_belong_to_views_of_the_globe_and_heights_to_what_is_lifted() {
        let with = |job: &RenderJob, change: fn(&mut Annotations)| {
            let mut job = job.clone();
            over(&mut job, change);
            job.validate().map_err(|error| error.to_string())
        };
        let tile = job();
        let refused = with(&tile, |a| a.names = true).unwrap_err();
        assert!(refused.contains("neighbours would cut"), "{refused}");
        let globe = RenderJob {
            view: View::Globe {
                lon_deg: 0.0,
                lat_deg: 0.0,
                height_m: 1e6,
                width_px: 10,
                height_px: 10,
                angles: crate::camera::CameraAngles::NADIR,
            },
            ..tile
        };
        with(&globe, |a| a.names = true).unwrap();
        let refused = with(&globe, |a| a.height = since("2000")).unwrap_err();
        assert!(refused.contains("nothing lifts"), "{refused}");
        let lifted = RenderJob {
            accumulated: Some(sample()),
            ..globe
        };
        with(&lifted, |a| a.height = since("2000")).unwrap();
        with(&lifted, |_nothing| ()).unwrap_err();
    }

    #[test]
    fn everything_that_shapes_a_picture_changes_its_name() {
        let base = job();
        base.validate().unwrap();
        let mut names = vec![base.key()];
        let mut changed = |change: fn(&mut RenderJob)| {
            let mut job = job();
            change(&mut job);
            names.push(job.key());
        };
        changed(|j| j.grid.rows = 1);
        changed(|j| j.value.domain = "domain/p/e".parse().unwrap());
        changed(|j| j.value.before = None);
        changed(|j| j.value.after = None);
        changed(|j| j.value.after = Some(after("frames/p/c", 0.25)));
        changed(|j| j.value.after = Some(after("frames/p/b", 0.5)));
        changed(|j| j.value.contributed = Some(counts("contributed/p/a")));
        changed(|j| j.value.contributed = Some(counts("contributed/p/b")));
        changed(|j| j.accumulated = Some(sample()));
        changed(|j| j.mode = Mode::Map);
        changed(|j| {
            j.view = View::Tile {
                tile: Tile { z: 1, x: 1, y: 0 },
                size_px: 256,
            }
        });
        changed(|j| j.style.slices = 32);
        changed(|j| j.style.sun.azimuth_deg = 0.0);
        changed(|j| j.style.uncertainty = true);
        changed(|j| j.style.transfer.palette = Palette::Ice);
        changed(|j| j.style.transfer.reversed = true);
        changed(|j| j.style.transfer.high *= 2.0);
        changed(|j| j.style.transfer.colours = "0:#000000,1:#ffffff".parse().unwrap());
        changed(|j| j.style.transfer.opacity = "0:0.5".parse().unwrap());
        changed(|j| j.style.transfer.opacity = "0:0.25".parse().unwrap());
        changed(|j| j.style.transfer.size = "0:0.5".parse().unwrap());
        changed(|j| j.style.sun.subsolar = Some(subsolar(10.0)));
        changed(|j| j.style.sun.subsolar = Some(subsolar(11.0)));
        changed(|j| j.style.context.coastlines = true);
        changed(|j| j.style.context.sea_opacity = 0.5);
        changed(|j| j.style.context.borders = true);
        changed(|j| j.style.context.sea_floor = true);
        changed(|j| j.style.context.mask_land = true);
        changed(|j| j.style.context.base_map = BaseMap::Light);
        changed(|j| j.style.context.background = Background::Sky);
        changed(|j| j.style.context.isolines = Some(every(1e-10)));
        changed(|j| j.style.context.isolines = Some(every(2e-10)));
        changed(|j| j.style.transfer.scale = Scale::Log);
        changed(|j| j.relief = Some(relief(15.0)));
        changed(|j| j.relief = Some(relief(30.0)));
        for change in ANNOTATED {
            changed(*change);
        }
        changed(|j| j.renderer_version += 1);
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    #[test]
    fn a_job_that_is_read_back_has_the_name_it_was_written_with() {
        for odd in [
            0.1 + 0.2,
            1.0 / 3.0,
            123.456_789_012_345_67,
            5e-324_f64.sqrt(),
            360.0 / 8640.0,
        ] {
            let mut job = job();
            job.grid.dlon_deg = odd;
            job.grid.west_deg = -odd;
            job.value.after = Some(after("frames/p/b", odd.fract()));
            job.style.transfer.low = -odd * 1e-9;
            job.style.sun.azimuth_deg = odd;
            job.style.sun.subsolar = Some(subsolar(-odd));
            job.style.context.sea_opacity = odd.fract() * 0.9;
            job.relief = Some(relief(odd));
            job.view = View::Globe {
                lon_deg: odd,
                lat_deg: -odd,
                height_m: odd * 1e6,
                width_px: 10,
                height_px: 10,
                angles: crate::camera::CameraAngles::NADIR,
            };
            let back: RenderJob =
                serde_json::from_str(&serde_json::to_string(&job).unwrap()).unwrap();
            assert_eq!((back.digest(), &back), (job.digest(), &job), "{odd}");
        }
    }

    #[test]
    fn isolines_of_what_has_nothing_between_two_values_are_refused() {
        let mut job = job();
        job.mode = Mode::Map;
        let tenth = (job.style.transfer.high - job.style.transfer.low) / 10.0;
        job.style.context.isolines = Some(every(tenth));
        job.validate().unwrap();
        job.style.nearest = true;
        let refused = job.validate().unwrap_err().to_string();
        assert!(refused.contains("codes, directions and days"), "{refused}");
        job.style.context.isolines = None;
        job.validate().unwrap();
    }

    #[test]
    fn a_look_with_a_word_that_is_not_known_is_refused_and_not_drawn_without_it() {
        let mut told = serde_json::to_value(job()).unwrap();
        let read = |told: &serde_json::Value| serde_json::from_str::<RenderJob>(&told.to_string());
        assert_eq!(read(&told).unwrap(), job());
        told["style"]["glow"] = true.into();
        let refused = read(&told).unwrap_err().to_string();
        assert!(refused.contains("unknown field `glow`"), "{refused}");
    }

    #[test]
    fn jobs_beyond_a_limit_are_refused() {
        let globe = |height_m, width_px| View::Globe {
            lon_deg: 0.0,
            lat_deg: 0.0,
            height_m,
            width_px,
            height_px: 10,
            angles: crate::camera::CameraAngles::NADIR,
        };
        let told = |view: View| view.validate().unwrap_err().to_string();
        let wide = told(globe(1e6, 99_999));
        let expected = "width \"99999\" is not valid: pictures are 1 to 7680";
        assert!(wide.starts_with(expected), "{wide}");
        let square = told(View::Globe {
            lon_deg: 0.0,
            lat_deg: 0.0,
            height_m: 1e6,
            width_px: MAX_IMAGE_PX,
            height_px: MAX_IMAGE_PX,
            angles: crate::camera::CameraAngles::NADIR,
        });
        assert!(square.starts_with("size \"7680x7680\""), "{square}");
        let broken: [fn(&mut RenderJob); 18] = [
            |j| j.grid.rows = u32::MAX,
            |j| j.style.sun.subsolar = Some(subsolar(f64::NAN)),
            |j| j.style.sun.azimuth_deg = f64::INFINITY,
            |j| j.style.context.sea_opacity = 1.0,
            |j| j.style.context.borders = true,
            |j| j.relief = Some(relief(-1.0)),
            |j| j.value.before = Some("raw/p/a".parse().unwrap()),
            |j| {
                j.accumulated = Some(TimeSample {
                    after: Some(after("frames/p/b", 2.0)),
                    ..sample()
                });
            },
            |j| j.style.slices = 1_000_000_000,
            |j| j.style.slices = 0,
            |j| j.style.transfer.high = f64::NAN,
            |j| j.style.transfer.scale = Scale::Log,
            |j| j.style.context.isolines = Some(every(0.0)),
            |j| j.style.context.isolines = Some(every(1e-12)),
            |j| j.style.transfer.low = -1e300,
            |j| j.style.transfer.size = shares_beyond_one(),
            |j| j.style.sun.elevation_deg = -1.0,
            |j| {
                j.view = View::Tile {
                    tile: Tile { z: 1, x: 5, y: 0 },
                    size_px: 256,
                }
            },
        ];
        for change in broken {
            let mut job = job();
            change(&mut job);
            assert!(job.validate().is_err());
        }
        for view in [
            globe(-100.0, 10),
            globe(1e6, 0),
            globe(1e6, 7681),
            globe(f64::NAN, 10),
        ] {
            assert!(RenderJob { view, ..job() }.validate().is_err());
        }
    }
}
