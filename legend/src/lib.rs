//! Legends: a transfer function in; its colours, opacities, sizes and round values to mark out, as JSON, SVG and PNG.
//!
//! By themselves they are answers of the tile server and files of the command line; render workers draw the same bar over
//! pictures that ask for it. [`raster`] turns either drawing into pixels, with fonts that are part of the program.

pub mod raster;
pub mod svg;
pub mod ticks;

#[cfg(test)]
mod palettes;

use contract::colour::{AtStop, Rgb, Scale, Stops, TransferFunction};
use contract::job::Mode;
use contract::quantity::{Display, Quantity};
use serde::Serialize;
use utoipa::ToSchema;

/// Width of a drawn legend, pixels.
const WIDTH_PX: u32 = 512;
/// Height without a row of particles, pixels.
const HEIGHT_PX: u32 = 84;
/// Height of that row, pixels.
const DOTS_HEIGHT_PX: u32 = 24;
/// Left and right of the bar, pixels: half of a label at its end.
const MARGIN_PX: u32 = 20;
/// Where the bar begins, pixels from the top.
const BAR_TOP_PX: u32 = 32;
/// Height of the bar, pixels.
const BAR_HEIGHT_PX: u32 = 18;
/// Side of the squares below transparent colours, pixels.
const CHECK_PX: u32 = 6;
/// Radius of a particle of full size, pixels.
const DOT_PX: f64 = 9.0;
/// Particles in a row.
const DOTS: u32 = 17;

/// What the colours of a layer mean, in the unit people read. Places lie between `low` (0) and `high` (1).
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Legend {
    /// Value of the first colour.
    low: f64,
    /// Value of the last colour.
    high: f64,
    /// Unit of the values.
    unit: &'static str,
    /// How values are spread between the two: `linear` where it is not said; `log`: equal ratios are equally far apart.
    #[serde(skip_serializing_if = "is_linear")]
    #[schema(value_type = Option<String>)]
    scale: Scale,
    /// What the values are, for people.
    label: &'static str,
    /// Place and colour (`#rrggbb`), straight in between.
    stops: Vec<(f64, String)>,
    /// Place and share of the usual optical depth, where users gave any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    opacity: Vec<(f64, f64)>,
    /// Place and share of the full radius of a particle, where users gave any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    size: Vec<(f64, f64)>,
    /// Round values to mark.
    ticks: Vec<f64>,
    #[serde(skip)]
    transfer: TransferFunction,
}

/// A legend that cannot be written: a defect.
#[derive(Debug, thiserror::Error)]
pub enum LegendError {
    /// As JSON.
    #[error("a legend cannot be written as JSON")]
    Json(#[from] serde_json::Error),
    /// As pixels.
    #[error("a drawing cannot be turned into pixels: {0}")]
    Raster(String),
}

/// How a legend is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// What a program draws from.
    Json,
    /// A drawing of any size.
    Svg,
    /// Pixels.
    Png,
}

impl Form {
    /// All of them, in the order they are offered.
    pub const ALL: [Self; 3] = [Self::Json, Self::Svg, Self::Png];

    /// The ending of names of files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Json => "json",
            Self::Svg => "svg",
            Self::Png => "png",
        }
    }

    /// The form of an ending.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|form| form.as_str() == name)
    }

    /// What HTTP calls it.
    pub fn content_type(self) -> &'static str {
        match self {
            Self::Json => "application/json",
            Self::Svg => "image/svg+xml",
            Self::Png => "image/png",
        }
    }
}

impl Legend {
    /// The legend of a quantity in the colours of a valid transfer function.
    pub fn of(quantity: Quantity, transfer: &TransferFunction) -> Self {
        Self::labelled(quantity.title(), quantity, transfer)
    }

    /// The same for pictures of a mode: a flow is coloured by its speed.
    pub fn of_mode(mode: Mode, quantity: Quantity, transfer: &TransferFunction) -> Self {
        match mode {
            Mode::Flow => Self::labelled("Speed of the current", quantity, transfer),
            Mode::Map | Mode::Points | Mode::Sprites | Mode::Volume => Self::of(quantity, transfer),
        }
    }

    /// Usual speeds of a vector whose parts are of a quantity.
    pub fn of_speed(quantity: Quantity) -> Self {
        Self::of_mode(Mode::Flow, quantity, &TransferFunction::of_speed(quantity))
    }

    fn labelled(label: &'static str, quantity: Quantity, transfer: &TransferFunction) -> Self {
        let display = quantity.display();
        let (low, high) = (
            rounded(display.shown(transfer.low), display, transfer),
            rounded(display.shown(transfer.high), display, transfer),
        );
        Self {
            low,
            high,
            unit: display.unit,
            scale: transfer.scale,
            label,
            stops: colours(transfer),
            opacity: places(
                transfer,
                &transfer.opacity,
                contract::colour::Share::get,
                |value| transfer.opacity(value),
            ),
            size: places(
                transfer,
                &transfer.size,
                contract::colour::Share::get,
                |value| transfer.size(value),
            ),
            ticks: match transfer.scale {
                Scale::Linear => ticks::of(low, high),
                Scale::Log => ticks::of_decades(low, high),
            },
            transfer: *transfer,
        }
    }

    /// Its bytes in a form; the same legend is always the same bytes.
    ///
    /// # Errors
    /// None that a legend of a valid transfer function has; defects of the encoders.
    pub fn encoded(&self, form: Form) -> Result<Vec<u8>, LegendError> {
        match form {
            Form::Json => Ok(serde_json::to_vec(self)?),
            Form::Svg => Ok(svg::drawn(self).into_bytes()),
            Form::Png => raster::png(&svg::drawn(self)),
        }
    }

    /// What the values are, for people.
    pub fn label(&self) -> &'static str {
        self.label
    }

    /// Unit of the values; empty where they have none.
    pub fn unit(&self) -> &'static str {
        self.unit
    }

    /// In one line.
    fn title(&self) -> String {
        if self.unit.is_empty() {
            self.label.to_owned()
        } else {
            format!("{}, {}", self.label, self.unit)
        }
    }

    /// Width and height of its drawing, pixels.
    fn size_px(&self) -> [u32; 2] {
        let dots = if self.size.is_empty() {
            0
        } else {
            DOTS_HEIGHT_PX
        };
        [WIDTH_PX, HEIGHT_PX + dots]
    }

    /// Where a place of the range lies, pixels from the left.
    fn x_px(place: f64) -> f64 {
        f64::from(MARGIN_PX) + place * f64::from(WIDTH_PX - 2 * MARGIN_PX)
    }

    /// Where the values to mark lie, 0 to 1, and their texts.
    pub fn marks(&self) -> Vec<(f64, String)> {
        let place = |tick: &f64| {
            let [at, low, high] = [*tick, self.low, self.high].map(|v| self.scale.spread(v));
            (at - low) / (high - low)
        };
        let text = match self.scale {
            Scale::Linear => ticks::texts(&self.ticks),
            // Each as short as it is: 0.03 and 10.
            Scale::Log => self
                .ticks
                .iter()
                .flat_map(|tick| ticks::texts(&[*tick]))
                .collect(),
        };
        self.ticks.iter().map(place).zip(text).collect()
    }

    /// The row of particles: places and radii, pixels; none without sizes.
    fn dots(&self) -> Vec<(f64, f64)> {
        let place = |i: u32| (f64::from(i) + 0.5) / f64::from(DOTS);
        let dot = |place: f64| {
            Some((
                place,
                DOT_PX * self.transfer.size(self.transfer.value_at(place))?,
            ))
        };
        (0..DOTS).filter_map(|i| dot(place(i))).collect()
    }
}

/// A number for people without the noise that arithmetic adds to it: a millionth of a millionth of the range.
fn rounded(shown: f64, display: Display, transfer: &TransferFunction) -> f64 {
    let span = (transfer.high - transfer.low) * display.factor;
    // The noise is that of the numbers, which may be far larger than their range.
    let noise = match transfer.scale {
        Scale::Linear => (span * 1e-9).max(shown.abs() * 1e-14),
        Scale::Log => shown.abs() * 1e-9,
    };
    let digits = -noise.log10().floor();
    let scale = 10f64.powf(digits.clamp(-20.0, 30.0));
    let rounded = (shown * scale).round() / scale;
    if rounded.is_finite() { rounded } else { shown }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_linear(scale: &Scale) -> bool {
    *scale == Scale::Linear
}

fn bytes(colour: [f64; 3]) -> [u8; 3] {
    colour.map(|share| (share * 255.0).round() as u8)
}

fn colours(transfer: &TransferFunction) -> Vec<(f64, String)> {
    let at = |value: f64| Rgb(bytes(transfer.colour(value))).to_string();
    if !transfer.colours.is_empty() {
        return places(
            transfer,
            &transfer.colours,
            |colour: Rgb| colour.to_string(),
            |value| Some(at(value)),
        );
    }
    let stops = transfer.palette.stops().iter();
    if transfer.reversed {
        evenly_placed(stops.rev())
    } else {
        evenly_placed(stops)
    }
}

/// Two colours or more at equal distances from 0 to 1.
pub fn evenly_placed<'a>(
    colours: impl ExactSizeIterator<Item = &'a [u8; 3]>,
) -> Vec<(f64, String)> {
    let last = (colours.len() - 1) as f64;
    let stop = |(i, colour): (usize, &[u8; 3])| (i as f64 / last, Rgb(*colour).to_string());
    colours.enumerate().map(stop).collect()
}

/// Stops as places of the range and what holds there, its ends included; none without stops.
fn places<T: AtStop, U: PartialEq>(
    transfer: &TransferFunction,
    stops: &Stops<T>,
    of: impl Fn(T) -> U,
    at: impl Fn(f64) -> Option<U>,
) -> Vec<(f64, U)> {
    if stops.is_empty() {
        return vec![];
    }
    let low = at(transfer.low).map(|low| (0.0, low));
    let inside = stops.as_slice().iter();
    let inside = inside.filter(|stop| stop.0 > transfer.low && stop.0 <= transfer.high);
    let inside = inside.map(|stop| (transfer.position(stop.0), of(stop.1)));
    let mut places: Vec<_> = low.into_iter().chain(inside).collect();
    let high = at(transfer.high).map(|high| (1.0, high));
    if places.last() != high.as_ref() {
        places.extend(high);
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::colour::TransferOptions;

    fn legend(quantity: Quantity, options: &TransferOptions) -> Legend {
        Legend::of(quantity, &options.over(quantity).unwrap())
    }

    fn usual(quantity: Quantity) -> Legend {
        legend(quantity, &TransferOptions::default())
    }

    #[test]
    fn a_legend_is_in_the_unit_people_read() {
        let legend = usual(Quantity::SeaSurfaceTemperature);
        assert_eq!((legend.low, legend.high, legend.unit), (-2.0, 32.0, "°C"));
        assert_eq!(legend.stops.first().unwrap(), &(0.0, "#081d42".to_owned()));
        assert!((legend.stops.last().unwrap().0 - 1.0).abs() < 1e-12);
        assert_eq!(legend.ticks, [0.0, 10.0, 20.0, 30.0]);
    }

    #[test]
    fn every_quantity_has_round_ends_and_ticks_between_them() {
        for quantity in Quantity::ALL {
            let legend = usual(quantity);
            for end in [legend.low, legend.high] {
                let is_round = ((end * 100.0).round() - end * 100.0).abs() < 1e-9;
                assert!(is_round, "{quantity:?} {end}");
            }
            assert!((2..=7).contains(&legend.ticks.len()), "{quantity:?}");
            let inside = |tick: &f64| (legend.low - 1e-9..=legend.high + 1e-9).contains(tick);
            assert!(legend.ticks.iter().all(inside), "{quantity:?}");
        }
    }

    #[test]
    fn a_logarithmic_legend_has_ticks_at_equal_ratios() {
        let legend = usual(Quantity::Chlorophyll);
        let marks = legend.marks();
        let texts: Vec<_> = marks.iter().map(|(_, text)| text.as_str()).collect();
        assert_eq!(texts, ["0.03", "0.1", "0.3", "1", "3", "10"]);
        let places: Vec<_> = marks.iter().map(|(place, _)| *place).collect();
        assert!(places[0].abs() < 1e-9 && (places[5] - 1.0).abs() < 1e-9);
        assert!(((places[3] - places[1]) - (places[5] - places[3])).abs() < 1e-9);
        let json = legend.encoded(Form::Json).unwrap();
        assert!(
            String::from_utf8(json)
                .unwrap()
                .contains("\"scale\":\"log\"")
        );
    }

    #[test]
    fn stops_are_shown_within_the_range_with_what_holds_at_its_ends() {
        let options = TransferOptions {
            range: Some("2:6".parse().unwrap()),
            colours: "0:#000000,4:#808080,4:#ff0000,8:#ffffff".parse().unwrap(),
            opacity: "2:0.5,3:1,9:1".parse().unwrap(),
            ..TransferOptions::default()
        };
        let legend = legend(Quantity::WindSpeed, &options);
        let expected = [
            (0.0, "#404040"),
            (0.5, "#808080"),
            (0.5, "#ff0000"),
            (1.0, "#ff8080"),
        ];
        let found: Vec<_> = legend
            .stops
            .iter()
            .map(|(at, c)| (*at, c.as_str()))
            .collect();
        assert_eq!(found, expected);
        assert_eq!(legend.opacity, [(0.0, 0.5), (0.25, 1.0), (1.0, 1.0)]);
        assert!(legend.size.is_empty() && legend.dots().is_empty());
    }

    #[test]
    fn a_reversed_palette_is_shown_reversed() {
        let reversed = TransferOptions {
            reversed: true,
            ..TransferOptions::default()
        };
        let (there, back) = (
            usual(Quantity::WindSpeed).stops,
            legend(Quantity::WindSpeed, &reversed).stops,
        );
        let colours = there.iter().map(|(_, colour)| colour);
        assert!(colours.eq(back.iter().rev().map(|(_, colour)| colour)));
        assert_ne!(there, back);
    }

    #[test]
    fn what_users_did_not_give_is_not_in_the_json() {
        let text = String::from_utf8(usual(Quantity::WindSpeed).encoded(Form::Json).unwrap());
        let text = text.unwrap();
        assert!(!text.contains("opacity") && !text.contains("size") && !text.contains("transfer"));
        assert!(!text.contains("scale"));
        assert!(
            text.contains("\"ticks\":[0.0,") && text.contains("m s⁻¹"),
            "{text}"
        );
    }
}
