//! Are palettes ordered for everybody? Measured for readers who lack a kind of cones and for grey print; `BLESS=1` writes
//! the figures and the picture of docs/palettes.md: `BLESS=1 cargo test -p legend palettes`.

mod vision;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use contract::colour::{Palette, TransferFunction};

use self::vision::{Reader, bytes, difference, lab, linear};

/// Parts of a range whose ends are compared.
const PARTS: usize = 8;
/// Steps in which lightness is looked at.
const STEPS: usize = 64;
/// Least difference of the ends of such a part, CIEDE2000: several times what is just seen.
const LEAST_OF_A_PART: f64 = 5.0;
/// Least difference of two values as far from the middle of a diverging palette, from a fifth of an arm on.
const LEAST_OF_ARMS: f64 = 10.0;
/// Least change of lightness in a step, L*: a whole range of 64 of them is nowhere level.
const LEAST_STEP: f64 = 0.3;
/// Least difference of lightness from the first to the last colour, or from the middle to either end, L*.
const LEAST_SPAN: f64 = 60.0;

/// What was measured of a palette for a reader.
struct Measured {
    /// Least difference of the ends of an eighth.
    part: f64,
    /// Least difference of the arms; none of a sequential palette, nor where colours are grey.
    arms: Option<f64>,
    /// Least change of lightness in a step, in the right direction.
    step: f64,
    /// Lightness of both ends and the middle.
    lightness: [f64; 3],
}

fn seen(palette: Palette, place: f64, reader: Reader) -> [f64; 3] {
    let colour = TransferFunction::linear(palette, 0.0, 1.0).colour(place);
    lab(reader.sees(linear(colour)))
}

fn measured(palette: Palette, reader: Reader) -> Measured {
    let at = |place: f64| seen(palette, place, reader);
    let part = |i: usize| {
        let [low, high] = [i, i + 1].map(|i| at(i as f64 / PARTS as f64));
        difference(low, high)
    };
    let arms = |i: u32| {
        let off = f64::from(i) / 20.0;
        difference(at(0.5 - off), at(0.5 + off))
    };
    let lightness = |i: usize| at(i as f64 / STEPS as f64)[0];
    let sign = |i: usize| match (palette.is_diverging(), i < STEPS / 2) {
        (true, true) => 1.0,
        (true, false) => -1.0,
        (false, _) => (lightness(STEPS) - lightness(0)).signum(),
    };
    let step = |i: usize| sign(i) * (lightness(i + 1) - lightness(i));
    let has_arms = palette.is_diverging() && reader != Reader::Grey;
    Measured {
        part: (0..PARTS).map(part).fold(f64::INFINITY, f64::min),
        arms: has_arms.then(|| (2..=10).map(arms).fold(f64::INFINITY, f64::min)),
        step: (0..STEPS).map(step).fold(f64::INFINITY, f64::min),
        lightness: [0, STEPS / 2, STEPS].map(lightness),
    }
}

#[test]
fn every_palette_is_ordered_for_every_reader() {
    for palette in Palette::ALL {
        for reader in Reader::ALL {
            let Measured {
                part,
                arms,
                step,
                lightness: [low, middle, high],
            } = measured(palette, reader);
            assert!(
                part >= LEAST_OF_A_PART,
                "{palette} {reader:?}: {part} a part"
            );
            assert!(step >= LEAST_STEP, "{palette} {reader:?}: {step} a step");
            let arms_apart = arms.is_none_or(|arms| arms >= LEAST_OF_ARMS);
            assert!(
                arms_apart,
                "{palette} {reader:?}: {arms:?} between the arms"
            );
            let spans = if palette.is_diverging() {
                [middle - low, middle - high]
            } else {
                [(high - low).abs(); 2]
            };
            assert!(
                spans.iter().all(|span| *span >= LEAST_SPAN),
                "{palette} {reader:?}"
            );
        }
    }
}

#[test]
fn colours_that_are_not_ordered_are_seen() {
    // The rainbow that is asked for most.
    let jet = [
        [0, 0, 128],
        [0, 0, 255],
        [0, 255, 255],
        [255, 255, 0],
        [255, 0, 0],
        [128, 0, 0],
    ];
    let lightness = jet.map(|colour: [u8; 3]| lab(linear(colour.map(|c| f64::from(c) / 255.0)))[0]);
    assert!(!lightness.is_sorted() && !lightness.iter().rev().is_sorted());
    // The dark arms of a published blue and green palette, which tritanopes take for one another.
    let arms = [[27, 62, 130], [24, 79, 36]];
    let [blue, green] = arms.map(|colour: [u8; 3]| linear(colour.map(|c| f64::from(c) / 255.0)));
    let apart = |reader: Reader| difference(lab(reader.sees(blue)), lab(reader.sees(green)));
    assert!(
        apart(Reader::Tritanope) < LEAST_OF_ARMS,
        "{}",
        apart(Reader::Tritanope)
    );
    assert!(apart(Reader::Usual) > 3.0 * LEAST_OF_ARMS);
}

/// The figures as a table of docs/palettes.md.
fn table() -> String {
    let mut text = "| palette | what | usual | protanopia | deuteranopia | tritanopia | grey print |\n|---|---|---|---|---|---|---|\n".to_owned();
    for palette in Palette::ALL {
        let all = Reader::ALL.map(|reader| measured(palette, reader));
        let mut row = |what: &str, of: &dyn Fn(&Measured) -> String| {
            let cells: Vec<String> = all.iter().map(of).collect();
            writeln!(text, "| {palette} | {what} | {} |", cells.join(" | "))
                .expect("a string takes any text");
        };
        row("an eighth", &|m| format!("{:.1}", m.part));
        if palette.is_diverging() {
            row("arms", &|m| {
                m.arms
                    .map_or_else(|| "–".to_owned(), |arms| format!("{arms:.1}"))
            });
        }
        row("lightness", &|m| {
            let [low, middle, high] = m.lightness.map(f64::round);
            if palette.is_diverging() {
                format!("{low} {middle} {high}")
            } else {
                format!("{low} {high}")
            }
        });
    }
    text
}

const LEFT_PX: usize = 84;
const BAR_PX: usize = 132;
const GAP_PX: usize = 8;
const ROW_PX: usize = 26;
const TOP_PX: usize = 28;

/// All palettes as every reader sees them.
fn drawing() -> String {
    let width = LEFT_PX + Reader::ALL.len() * (BAR_PX + GAP_PX);
    let height = TOP_PX + Palette::ALL.len() * ROW_PX + 4;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\"><title>Palettes as readers see them</title>\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
    );
    let mut push = |text: String| svg.push_str(&text);
    for (column, reader) in Reader::ALL.into_iter().enumerate() {
        let x = LEFT_PX + column * (BAR_PX + GAP_PX);
        push(format!(
            "<text x=\"{x}\" y=\"18\">{}</text>\n",
            reader.title()
        ));
        for (row, palette) in Palette::ALL.into_iter().enumerate() {
            let y = TOP_PX + row * ROW_PX;
            if column == 0 {
                push(format!("<text x=\"6\" y=\"{}\">{palette}</text>\n", y + 14));
            }
            let id = format!("{palette}-{column}");
            push(format!("<linearGradient id=\"{id}\">"));
            for i in 0..=32 {
                let place = f64::from(i) / 32.0;
                let colour = TransferFunction::linear(palette, 0.0, 1.0).colour(place);
                let [r, g, b] = bytes(reader.sees(linear(colour)));
                push(format!(
                    "<stop offset=\"{place:.5}\" stop-color=\"#{r:02x}{g:02x}{b:02x}\"/>"
                ));
            }
            push(format!(
                "</linearGradient><rect x=\"{x}\" y=\"{y}\" width=\"{BAR_PX}\" height=\"20\" fill=\"url(#{id})\"/>\n"
            ));
        }
    }
    svg.push_str("</svg>\n");
    svg
}

fn docs(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs")
        .join(file)
}

#[expect(clippy::disallowed_methods, reason = "a test's own switch")]
fn is_blessed() -> bool {
    std::env::var("BLESS").is_ok_and(|value| !value.is_empty() && value != "0")
}

/// The page with another table in the place of its own.
fn with_table(page: &str) -> String {
    let (before, after) = page
        .split_once("\n| palette |")
        .expect("the page has a table");
    let (_, rest) = after.split_once("\n\n").unwrap_or((after, ""));
    format!("{before}\n{}\n{rest}", table())
}

#[test]
fn the_documented_figures_and_picture_are_those_that_are_measured() {
    let (page, picture) = (docs("palettes.md"), docs("palettes.svg"));
    let read = |path: &Path| std::fs::read_to_string(path).unwrap_or_default();
    if is_blessed() {
        std::fs::write(&page, with_table(&read(&page))).unwrap();
        std::fs::write(&picture, drawing()).unwrap();
    }
    let is_same = with_table(&read(&page)) == read(&page);
    assert!(
        is_same,
        "docs/palettes.md has other figures; BLESS=1 writes them anew"
    );
    let is_same = read(&picture) == drawing();
    assert!(
        is_same,
        "docs/palettes.svg shows other colours; BLESS=1 draws it anew"
    );
}
