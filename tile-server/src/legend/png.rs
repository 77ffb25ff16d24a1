//! A legend as PNG, with a font of its own: what a report or a map without a browser shows.

use super::font;
use super::{BAR_HEIGHT_PX, BAR_TOP_PX, CHECK_PX, HEIGHT_PX, Legend, MARGIN_PX};

const PAPER: [u8; 3] = [255, 255, 255];
const INK: [u8; 3] = [34, 34, 34];
const CHECK: [u8; 3] = [204, 204, 204];
const DOT: [u8; 3] = [85, 85, 85];
/// Pixels along a side of a dot of the font.
const FONT_SCALE: u32 = 2;
/// Pixels along a side of a particle's pixel that are looked at for its soft edge.
const EDGE_SAMPLES: u32 = 4;

/// Rows of red, green and blue.
struct Canvas {
    size_px: [u32; 2],
    rgb: Vec<u8>,
}

/// The drawing.
pub(super) fn drawn(legend: &Legend) -> Result<Vec<u8>, png::EncodingError> {
    let size_px = legend.size_px();
    let pixels = size_px[0] as usize * size_px[1] as usize;
    let mut canvas = Canvas {
        size_px,
        rgb: PAPER.repeat(pixels),
    };
    let right = size_px[0] - MARGIN_PX;
    canvas.text(MARGIN_PX, 8, legend.label);
    let unit_px = font::width(legend.unit) * FONT_SCALE;
    canvas.text(right.saturating_sub(unit_px), 8, legend.unit);
    canvas.bar(legend);
    let foot = BAR_TOP_PX + BAR_HEIGHT_PX;
    for (x, text) in legend.marks() {
        let x = x.round() as u32;
        for y in foot..foot + 6 {
            canvas.set(x, y, INK, 1.0);
        }
        let half = font::width(&text) * FONT_SCALE / 2;
        let left = x.saturating_sub(half);
        let most = size_px[0].saturating_sub(2 * half + 2);
        canvas.text(left.min(most), foot + 9, &text);
    }
    for (place, radius) in legend.dots() {
        canvas.disc([Legend::x_px(place), f64::from(HEIGHT_PX + 6)], radius);
    }
    let mut file = vec![];
    let mut encoder = png::Encoder::new(&mut file, size_px[0], size_px[1]);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&canvas.rgb)?;
    writer.finish()?;
    Ok(file)
}

impl Canvas {
    /// Lays a colour over a pixel, if it is on the canvas.
    fn set(&mut self, x: u32, y: u32, color: [u8; 3], share: f64) {
        let [width, height] = self.size_px;
        if x >= width || y >= height {
            return;
        }
        let at = (y as usize * width as usize + x as usize) * 3;
        for (channel, color) in self.rgb[at..at + 3].iter_mut().zip(color) {
            let mixed = f64::from(*channel) * (1.0 - share) + f64::from(color) * share;
            *channel = mixed.round() as u8;
        }
    }

    fn text(&mut self, left: u32, top: u32, text: &str) {
        let mut x = left;
        for letter in text.chars() {
            for column in font::columns(letter) {
                for row in (0..8).filter(|row| column & (1 << row) != 0) {
                    for (across, down) in
                        (0..FONT_SCALE).flat_map(|a| (0..FONT_SCALE).map(move |d| (a, d)))
                    {
                        self.set(x + across, top + row * FONT_SCALE + down, INK, 1.0);
                    }
                }
                x += FONT_SCALE;
            }
            x += FONT_SCALE;
        }
    }

    fn bar(&mut self, legend: &Legend) {
        let width = self.size_px[0] - 2 * MARGIN_PX;
        for column in 0..width {
            let place = (f64::from(column) + 0.5) / f64::from(width);
            let (color, share) = (legend.color_at(place), legend.opacity_at(place));
            for row in 0..BAR_HEIGHT_PX {
                let (x, y) = (MARGIN_PX + column, BAR_TOP_PX + row);
                if (column / CHECK_PX + row / CHECK_PX).is_multiple_of(2) {
                    self.set(x, y, CHECK, 1.0);
                }
                self.set(x, y, color, share);
            }
        }
    }

    fn disc(&mut self, [center_x, center_y]: [f64; 2], radius: f64) {
        let low = |center: f64| (center - radius).floor().max(0.0) as u32;
        let high = |center: f64| (center + radius).ceil().max(0.0) as u32;
        let sample = |i: u32| (f64::from(i) + 0.5) / f64::from(EDGE_SAMPLES);
        for y in low(center_y)..high(center_y) {
            for x in low(center_x)..high(center_x) {
                let samples =
                    (0..EDGE_SAMPLES).flat_map(|a| (0..EDGE_SAMPLES).map(move |b| (a, b)));
                let inside = samples.filter(|(a, b)| {
                    let dx = f64::from(x) + sample(*a) - center_x;
                    let dy = f64::from(y) + sample(*b) - center_y;
                    dx.hypot(dy) < radius
                });
                let share = inside.count() as f64 / f64::from(EDGE_SAMPLES * EDGE_SAMPLES);
                self.set(x, y, DOT, share);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::colour::TransferOptions;
    use contract::quantity::Quantity;

    fn pixels(quantity: Quantity, options: &TransferOptions) -> (u32, Vec<u8>) {
        let file = drawn(&Legend::of(quantity, &options.over(quantity).unwrap())).unwrap();
        let decoder = png::Decoder::new(std::io::Cursor::new(file));
        let mut reader = decoder.read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut rgb).unwrap();
        (info.width, rgb)
    }

    fn at((width, rgb): &(u32, Vec<u8>), x: u32, y: u32) -> [u8; 3] {
        let at = (y * width + x) as usize * 3;
        rgb[at..at + 3].try_into().unwrap()
    }

    #[test]
    fn the_bar_shows_the_colours_and_the_text_is_there() {
        let legend = pixels(Quantity::CarbonFlux, &TransferOptions::default());
        let near = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 3);
        assert!(near(at(&legend, MARGIN_PX, 40), [17, 56, 127]));
        assert!(near(at(&legend, 512 / 2, 40), [240, 240, 238]));
        assert!(near(at(&legend, 512 - MARGIN_PX - 1, 40), [118, 14, 36]));
        assert_eq!(at(&legend, MARGIN_PX - 1, 40), PAPER);
        let ink = |ys: std::ops::Range<u32>| {
            let places = ys.flat_map(|y| (0..512).map(move |x| (x, y)));
            places.filter(|(x, y)| at(&legend, *x, *y) == INK).count()
        };
        assert!(ink(0..30) > 400, "title and unit");
        assert!(ink(59..80) > 150, "texts of ticks");
        assert_eq!(ink(52..54), 2 * 5, "five marks");
    }

    #[test]
    fn the_longest_title_leaves_room_for_its_unit() {
        for quantity in Quantity::ALL {
            let unit = quantity.display().unit;
            let taken = (font::width(quantity.title()) + font::width(unit)) * FONT_SCALE;
            assert!(taken + 2 * MARGIN_PX + 8 <= 512, "{quantity:?}: {taken}");
        }
    }

    #[test]
    fn what_is_transparent_shows_the_squares_below_and_sizes_are_discs() {
        let options = TransferOptions {
            opacity: "0:0,15:1".parse().unwrap(),
            size: "0:0.2,15:1".parse().unwrap(),
            ..TransferOptions::default()
        };
        let legend = pixels(Quantity::WindSpeed, &options);
        let left: Vec<_> = (0..12).map(|i| at(&legend, MARGIN_PX + i, 40)).collect();
        assert!(left.iter().any(|c| c[0] > 240) && left.iter().any(|c| c[0] < 210));
        let dark = |xs: std::ops::Range<u32>| {
            let places = xs.flat_map(|x| (80..108).map(move |y| (x, y)));
            places.filter(|(x, y)| at(&legend, *x, *y)[0] < 120).count()
        };
        assert!(dark(440..500) > 3 * dark(12..72) && dark(12..72) > 10);
    }
}
