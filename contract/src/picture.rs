//! What a picture is asked to be, in the words that the command line, addresses and recomputations share. Together with
//! the versions of the products that it shows it becomes a [`RenderJob`]: here and nowhere else.

mod annotated;

use crate::ContractError;
use crate::annotation::AnnotationWishes;
use crate::base_map::{Background, BaseMap};
use crate::colour::{TransferFunction, TransferOptions};
use crate::context::{Context, Relief};
use crate::flow::drift;
use crate::isolines::IsolineWish;
use crate::job::{Mode, RENDERER_VERSION, RenderJob, Style, View};
use crate::manifest::Manifest;
use crate::quantity::Quantity;
use crate::sun::SunChoice;
use crate::time::TimeMs;
use crate::trails::{TRAILS_PER_CELL, TrailSources, Trails};

/// What somebody asks of the look of a picture; all of it the usual where nothing was asked.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PictureOptions {
    /// Colours, opacity and size.
    pub transfer: TransferOptions,
    /// Draw cells whose gap was filled, and sums that are not complete, differently.
    pub uncertainty: bool,
    /// Half-angle slices.
    pub slices: Option<u32>,
    /// Particles of every cell with data.
    pub particles_per_cell: Option<u32>,
    /// Height of a kilogram of accumulated carbon per square metre, m.
    pub height_m_per_kg_m2: Option<f64>,
    /// Share of what lies 100 km below the sea surface that the sea hides.
    pub sea_opacity: Option<f64>,
    /// Draw coast lines; on views that show the globe unless told otherwise.
    pub coastlines: Option<bool>,
    /// Draw borders of countries; where coast lines are drawn on a globe unless told otherwise.
    pub borders: Option<bool>,
    /// Shade the plain globe by a coarse relief; wherever one is drawn unless told otherwise.
    pub sea_floor: Option<bool>,
    /// End a thematic map at the coasts of a globe view.
    pub mask_land: bool,
    /// Colours of the plain globe.
    pub base_map: Option<BaseMap>,
    /// What is seen beside the globe.
    pub background: Option<Background>,
    /// Isolines of the quantity that is drawn.
    pub isolines: Option<IsolineWish>,
    /// Light.
    pub sun: Option<SunChoice>,
    /// Draw a plain globe behind the particles of a globe view.
    pub globe_surface: bool,
    /// What is drawn over the finished picture.
    pub annotations: AnnotationWishes,
}

/// A picture that somebody asks for, of whichever versions of its products there are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureRequest {
    /// Mode.
    pub mode: Mode,
    /// View.
    pub view: View,
    /// Instant, see [`shown_time`].
    pub time: Option<TimeMs>,
    /// Look.
    pub options: PictureOptions,
}

/// The versions of products that a picture is drawn from.
#[derive(Debug, Clone)]
pub struct PictureSources<'a> {
    /// The product drawn.
    pub product: &'a Manifest,
    /// Its accumulated carbon, which lifts and sinks the particles.
    pub accumulated: Option<&'a Manifest>,
    /// The northward part of the vector whose eastward part the product is; [`Mode::Flow`] needs it.
    pub northward: Option<&'a Manifest>,
    /// The vector whose trails lie on the sea surface.
    pub trails: Option<TrailSources<'a>>,
    /// Land and sea floor below the particles.
    pub relief: Option<Relief>,
}

/// The instant that is shown: the one asked for, or the nearest that the product covers; the middle of its last step
/// unless one is asked for.
///
/// # Errors
/// A product without steps.
pub fn shown_time(product: &Manifest, time: Option<TimeMs>) -> Result<TimeMs, ContractError> {
    let (Some(last), Some(extent)) = (product.steps.last(), product.extent()) else {
        let name = product.product.as_str();
        return Err(ContractError::invalid("product", name, "it has no steps"));
    };
    let time = time.unwrap_or(last.period.mid());
    Ok(time.clamp(extent.start, extent.end))
}

impl PictureOptions {
    /// The style of a quantity that looks so at an instant in a view.
    ///
    /// # Errors
    /// Those of [`PictureOptions::style`].
    pub fn style_in(
        &self,
        view: &View,
        quantity: Quantity,
        mode: Mode,
        time: TimeMs,
    ) -> Result<Style, ContractError> {
        let mut style = self.style(quantity, mode, time)?;
        if let (None, View::Globe { .. }) = (self.slices, view) {
            style.slices = Style::GLOBE_SLICES;
        }
        // From below the sea surface clouds stand right before the eye: many large ones would take long and show no more.
        if let (None, View::Globe { height_m, .. }, Mode::Volume) =
            (self.particles_per_cell, view, mode)
            && *height_m > 0.0
        {
            style.particles_per_cell = Style::GLOBE_PARTICLES_PER_CELL;
        }
        Ok(style)
    }

    /// The style of a quantity that looks so at an instant.
    ///
    /// # Errors
    /// Options of colours that contradict each other or do not fit the quantity; isolines that the range of colours has
    /// too many of, or none.
    pub fn style(
        &self,
        quantity: Quantity,
        mode: Mode,
        time: TimeMs,
    ) -> Result<Style, ContractError> {
        let usual = match mode {
            Mode::Flow => Style::of_flow(self.transfer.over_speed(quantity)?),
            Mode::Map | Mode::Points | Mode::Sprites | Mode::Volume => {
                Style::with_transfer(self.transfer.over(quantity)?)
            }
        };
        let isolines = self.isolines;
        let isolines = isolines.map(|wish| wish.within(quantity, &usual.transfer));
        let context = Context {
            isolines: isolines.transpose()?,
            ..self.context(usual.context)
        };
        Ok(Style {
            slices: self.slices.unwrap_or(usual.slices),
            particles_per_cell: self.particles_per_cell.unwrap_or(usual.particles_per_cell),
            height_m_per_kg_m2: self.height_m_per_kg_m2.unwrap_or(usual.height_m_per_kg_m2),
            sun: self
                .sun
                .map_or(usual.sun, |choice| choice.instead_of(usual.sun, time)),
            globe_surface: self.globe_surface,
            uncertainty: self.uncertainty,
            context,
            ..usual
        })
    }

    /// What surrounds the particles: a globe has its map unless told otherwise, a map tile lies over that of its client.
    fn context(&self, usual: Context) -> Context {
        let is_globe = self.globe_surface;
        let coastlines = self.coastlines.unwrap_or(is_globe);
        Context {
            sea_opacity: self.sea_opacity.unwrap_or(usual.sea_opacity),
            coastlines,
            borders: self.borders.unwrap_or(is_globe && coastlines),
            sea_floor: self.sea_floor.unwrap_or(is_globe),
            mask_land: self.mask_land,
            base_map: self.base_map.unwrap_or(usual.base_map),
            background: self.background.unwrap_or(usual.background),
            isolines: usual.isolines,
        }
    }
}

impl PictureRequest {
    /// The job that draws it.
    ///
    /// # Errors
    /// A product without steps, products that do not belong together, or a limit that is broken.
    pub fn job(&self, sources: &PictureSources<'_>) -> Result<RenderJob, ContractError> {
        let time = shown_time(sources.product, self.time)?;
        let quantity = sources.product.quantity;
        let style = self
            .options
            .style_in(&self.view, quantity, self.mode, time)?;
        let job = sources.job(self.mode, self.view, time, style)?;
        sources.annotated(job, time, self.options.annotations)
    }
}

impl<'a> PictureSources<'a> {
    /// A product alone.
    pub fn of(product: &'a Manifest) -> Self {
        Self {
            product,
            accumulated: None,
            northward: None,
            trails: None,
            relief: None,
        }
    }

    /// The job that draws these versions in a finished style.
    ///
    /// # Errors
    /// As [`PictureRequest::job`].
    pub fn job(
        &self,
        mode: Mode,
        view: View,
        time: TimeMs,
        style: Style,
    ) -> Result<RenderJob, ContractError> {
        let job = match (mode, self.northward) {
            (Mode::Flow, Some(northward)) => {
                RenderJob::of_flow(self.product, northward, time, view, style)?
            }
            (mode, _) => RenderJob::of(self.product, self.accumulated, time, mode, view, style)?,
        };
        let job = job.over(self.relief.clone())?;
        match self.trails {
            Some(trails) => job.under_trails(trails.trails(time)?),
            None => Ok(job),
        }
    }
}

impl RenderJob {
    /// The job that draws a version of a product at an instant in any mode but [`Mode::Flow`], lifted by a version of its accumulated carbon. A map has
    /// no particles to lift.
    ///
    /// # Errors
    /// A product without steps, two that do not lie on one grid, or a limit that is broken.
    pub fn of(
        product: &Manifest,
        accumulated: Option<&Manifest>,
        time: TimeMs,
        mode: Mode,
        view: View,
        style: Style,
    ) -> Result<Self, ContractError> {
        let sample = |manifest: &Manifest, with_counts: bool| {
            let name = || manifest.product.to_string();
            let empty = || ContractError::invalid("product", &name(), "it has no steps");
            if manifest.grid != product.grid {
                let reason = format!("it does not lie on the grid of {}", product.product);
                return Err(ContractError::invalid("product", &name(), reason));
            }
            let sample = if with_counts {
                manifest.time_sample_with_counts(time)
            } else {
                manifest.time_sample(time)
            };
            sample.ok_or_else(empty)
        };
        let accumulated = accumulated.filter(|_| mode != Mode::Map);
        let job = Self {
            renderer_version: RENDERER_VERSION,
            grid: product.grid,
            // Colours are uncertain, heights are not.
            value: sample(product, style.uncertainty)?,
            accumulated: accumulated
                .map(|accumulated| sample(accumulated, false))
                .transpose()?,
            relief: None,
            flow: None,
            trails: None,
            mode,
            view,
            style: Style {
                nearest: !product.quantity.is_linear(),
                ..style
            },
            annotations: None,
        };
        job.validate()?;
        Ok(job)
    }

    /// The same picture over a relief.
    ///
    /// # Errors
    /// A limit that is broken.
    pub fn over(self, relief: Option<Relief>) -> Result<Self, ContractError> {
        let job = Self { relief, ..self };
        job.validate()?;
        Ok(job)
    }

    /// The same picture with trails on its sea surface.
    ///
    /// # Errors
    /// Trails of the very vector that is drawn as a flow, or a limit that is broken.
    pub fn under_trails(self, trails: Trails) -> Result<Self, ContractError> {
        let job = Self {
            trails: Some(Box::new(trails)),
            ..self
        };
        job.validate()?;
        Ok(job)
    }

    /// The job that draws particles drifting with a vector, by its parts' versions.
    ///
    /// # Errors
    /// Products that are no parts of one vector, an instant around which they have different steps, a limit that is
    /// broken.
    pub fn of_flow(
        eastward: &Manifest,
        northward: &Manifest,
        time: TimeMs,
        view: View,
        style: Style,
    ) -> Result<Self, ContractError> {
        let (value, flow) = drift(eastward, northward, time)?;
        let job = Self {
            renderer_version: RENDERER_VERSION,
            grid: eastward.grid,
            value,
            accumulated: None,
            relief: None,
            flow: Some(flow),
            trails: None,
            mode: Mode::Flow,
            view,
            style,
            annotations: None,
        };
        job.validate()?;
        Ok(job)
    }
}

impl Style {
    /// What a flow looks like unless told otherwise, in colours by speed.
    pub fn of_flow(speed: TransferFunction) -> Self {
        Self {
            particles_per_cell: TRAILS_PER_CELL,
            ..Self::with_transfer(speed)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_asked_for_is_as_usual() {
        let time = "2000-02-01".parse().unwrap();
        for mode in Mode::ALL {
            let style = PictureOptions::default().style(Quantity::Current, mode, time);
            let usual = match mode {
                Mode::Flow => {
                    Style::of_flow(crate::colour::TransferFunction::of_speed(Quantity::Current))
                }
                _ => Style::with_transfer(crate::colour::TransferFunction::default_for(
                    Quantity::Current,
                )),
            };
            assert_eq!(style.unwrap(), usual, "{mode}");
        }
    }

    #[test]
    fn a_globe_has_lines_and_a_sea_floor_unless_told_otherwise() {
        let time = "2000-02-01".parse().unwrap();
        let context = |options: PictureOptions| {
            let style = options.style(Quantity::CarbonFlux, Mode::Volume, time);
            style.unwrap().context
        };
        let globe = PictureOptions {
            globe_surface: true,
            ..PictureOptions::default()
        };
        let usual = context(globe);
        assert!(usual.coastlines && usual.borders && usual.sea_floor);
        assert_eq!(
            (usual.base_map, usual.background),
            (BaseMap::Dark, Background::None)
        );
        let without = context(PictureOptions {
            coastlines: Some(false),
            ..globe
        });
        assert!(!without.coastlines && !without.borders && without.sea_floor);
        let borders = context(PictureOptions {
            borders: Some(true),
            coastlines: Some(false),
            ..globe
        });
        assert!(!borders.coastlines && borders.borders);
        assert!(
            context(PictureOptions::default()).is_empty(),
            "a tile has none of it"
        );
        let lines = context(PictureOptions {
            coastlines: Some(true),
            ..PictureOptions::default()
        });
        assert!(
            lines.coastlines && !lines.borders,
            "tiles have coasts alone"
        );
    }

    #[test]
    fn every_option_reaches_the_style() {
        let time: TimeMs = "2000-06-21T12:00:00Z".parse().unwrap();
        let style = |options: PictureOptions| {
            options
                .style(Quantity::CarbonFlux, Mode::Volume, time)
                .unwrap()
        };
        let usual = style(PictureOptions::default());
        let changes: [fn(&mut PictureOptions); 16] = [
            |o| o.transfer.reversed = true,
            |o| o.isolines = Some(IsolineWish::Auto),
            |o| o.isolines = Some(IsolineWish::Every(20.0)),
            |o| o.uncertainty = true,
            |o| o.slices = Some(7),
            |o| o.particles_per_cell = Some(3),
            |o| o.height_m_per_kg_m2 = Some(1.0),
            |o| o.sea_opacity = Some(0.5),
            |o| o.coastlines = Some(true),
            |o| o.sun = Some(SunChoice::OfTime),
            |o| o.globe_surface = true,
            |o| o.borders = Some(true),
            |o| o.sea_floor = Some(true),
            |o| o.mask_land = true,
            |o| o.base_map = Some(BaseMap::Light),
            |o| o.background = Some(Background::Sky),
        ];
        let mut seen = vec![usual];
        for change in changes {
            let mut options = PictureOptions::default();
            change(&mut options);
            let changed = style(options);
            assert!(!seen.contains(&changed), "{options:?}");
            seen.push(changed);
        }
    }
}
