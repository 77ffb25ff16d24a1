use std::collections::BTreeSet;

use super::*;
use contract::annotation::{Annotations, DateLabel, Graticule, HeightScale, Label};
use contract::camera::CameraAngles;
use contract::job::{Mode, View};
use contract::quantity::Quantity;
use render_proof::ocean;

/// Columns of 45 g C m⁻² upwards and of 62 downwards.
const LIFTED: Lifted = Lifted {
    up_kg_m2: 0.045,
    down_kg_m2: 0.062,
};

/// Takes one annotation away.
type Without = fn(&mut Annotations);

fn view(width_px: u32, height_px: u32, height_m: f64, tilt_deg: f64) -> View {
    View::Globe {
        lon_deg: -150.0,
        lat_deg: 10.0,
        height_m,
        width_px,
        height_px,
        angles: CameraAngles {
            heading_deg: 40.0,
            tilt_deg,
            ..CameraAngles::NADIR
        },
    }
}

fn all() -> Annotations {
    Annotations {
        legend: Some(Quantity::CarbonFlux),
        date: Some(DateLabel {
            shown: Label::cut("15 July 2000").unwrap(),
            note: Label::cut("monthly means"),
        }),
        graticule: Graticule::every(15.0).ok(),
        names: true,
        scale: true,
        height: Some(HeightScale {
            since: "2000".parse().unwrap(),
        }),
        source: Label::cut("Takahashi et al. (2009), doi:10.1016/j.dsr2.2008.12.009"),
        ..Annotations::none()
    }
}

fn job(view: View, annotations: Annotations) -> RenderJob {
    RenderJob {
        annotations: Some(annotations),
        ..ocean::job(view)
    }
}

fn drawn(view: View, change: impl Fn(&mut Annotations)) -> String {
    let mut annotations = all();
    change(&mut annotations);
    let job = job(view, annotations);
    job.validate().unwrap();
    drawing(&job, &LIFTED).unwrap().unwrap()
}

/// Sizes and views of all sorts.
fn views() -> Vec<View> {
    let sizes = [
        (96, 96),
        (128, 300),
        (256, 256),
        (640, 360),
        (1000, 120),
        (1600, 900),
    ];
    let cameras = [
        (1e3, 0.0),
        (3e5, 80.0),
        (3e6, 30.0),
        (1.5e7, 0.0),
        (1.5e7, 12.0),
        (1e9, 0.0),
    ];
    let of = |(width, height): (u32, u32)| {
        cameras.map(move |(height_m, tilt)| view(width, height, height_m, tilt))
    };
    sizes.into_iter().flat_map(of).collect()
}

/// Panels of a drawing: left, top, right and bottom.
fn panels(svg: &str) -> Vec<[f64; 4]> {
    let rects = svg
        .split("<rect ")
        .skip(1)
        .filter(|rect| rect.contains("rx="));
    let of = |rect: &str| {
        let number = |name: &str| -> f64 {
            let (_, rest) = rect.split_once(&format!("{name}=\"")).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        let (x, y) = (number("x"), number("y"));
        [x, y, x + number("width"), y + number("height")]
    };
    rects.map(of).collect()
}

fn overlap(a: &[f64; 4], b: &[f64; 4]) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[test]
fn nothing_lies_over_anything_else_or_outside() {
    let mut most = 0;
    for view in views() {
        let svg = drawn(view, |_all| ());
        let [width, height] = view.size_px().map(f64::from);
        let boxes = raster::text_boxes(&svg).unwrap();
        for [left, top, right, bottom] in boxes.iter().chain(&panels(&svg)) {
            let is_inside = *left >= 0.0 && *top >= 0.0 && *right <= width && *bottom <= height;
            assert!(is_inside, "{view:?} {left} {top} {right} {bottom}");
        }
        let panels = panels(&svg);
        for (i, panel) in panels.iter().enumerate() {
            assert!(
                !panels[..i].iter().any(|other| overlap(panel, other)),
                "{view:?} {panels:?}"
            );
        }
        for (i, text) in boxes.iter().enumerate() {
            // Boxes are as high as the highest letters of a font.
            let core = [
                text[0] + 1.0,
                text[1] + 0.3 * (text[3] - text[1]),
                text[2] - 1.0,
                text[3] - 0.25 * (text[3] - text[1]),
            ];
            let over = boxes[..i].iter().find(|other| overlap(&core, other));
            assert!(over.is_none(), "{view:?} {text:?} {over:?}");
            let of_panel = panels.iter().find(|panel| overlap(&core, panel));
            if let Some(panel) = of_panel {
                let is_in = text[0] >= panel[0] && text[2] <= panel[2];
                assert!(is_in, "{view:?} {text:?} {panel:?}");
            }
        }
        most = most.max(boxes.len());
    }
    assert!(most > 30, "{most}");
}

#[test]
fn each_annotation_is_drawn_when_it_is_asked_for_and_not_else() {
    let view = view(1600, 900, 4e6, 25.0);
    let whole = drawn(view, |_all| ());
    let parts: [(Without, &str); 7] = [
        (|a| a.legend = None, "sea gives off"),
        (|a| a.date = None, "15 July 2000"),
        (|a| a.graticule = None, "120°W"),
        (|a| a.names = false, "NORTH PACIFIC OCEAN"),
        (|a| a.scale = false, "at the centre"),
        (|a| a.height = None, "100 km drawn are 12.5 g C m⁻²"),
        (|a| a.source = None, "doi:10.1016"),
    ];
    let mut seen = BTreeSet::from([whole.clone()]);
    for (without, text) in parts {
        assert!(whole.contains(text), "{text}: {whole}");
        let rest = drawn(view, without);
        assert!(!rest.contains(text), "{text}: {rest}");
        assert!(seen.insert(rest), "{text}");
    }
}

#[test]
fn a_picture_without_annotations_or_room_keeps_its_bytes() {
    let image = |width: u32, height: u32| Image {
        width,
        height,
        rgba8: (0..width * height * 4)
            .map(|i| (i * 7 % 251) as u8)
            .collect(),
    };
    let plain = RenderJob {
        annotations: None,
        ..job(view(300, 200, 1e7, 0.0), all())
    };
    assert_eq!(
        annotated(&plain, &LIFTED, image(300, 200)).unwrap(),
        image(300, 200)
    );
    for (width, height) in [(1, 1), (16, 16), (4096, 16), (95, 95)] {
        let job = job(view(width, height, 1e7, 0.0), all());
        assert_eq!(
            annotated(&job, &LIFTED, image(width, height)).unwrap(),
            image(width, height)
        );
    }
    let small = job(view(300, 200, 1e7, 0.0), all());
    assert_ne!(
        annotated(&small, &LIFTED, image(300, 200)).unwrap(),
        image(300, 200)
    );
}

#[test]
fn the_largest_picture_has_room_for_the_finest_lines() {
    let svg = drawn(view(4096, 4096, 1.5e7, 0.0), |a| {
        a.graticule = Graticule::every(0.01).ok();
    });
    assert!(svg.len() < 8 << 20, "{} bytes", svg.len());
    let pixels = raster::pixels(&svg).unwrap();
    assert_eq!((pixels.width, pixels.height), (4096, 4096));
}

#[test]
fn hostile_words_are_words() {
    let hostile = "</text></svg><image href=\"file:///etc/passwd\"/> & <!-- ]]> 'x'";
    let label = || Label::cut(hostile);
    let svg = drawn(view(1600, 900, 4e6, 25.0), |a| {
        a.source = label();
        let shown = label().unwrap();
        a.date = Some(DateLabel {
            shown,
            note: label(),
        });
    });
    assert!(svg.contains("&lt;image href=&quot;file"), "{svg}");
    assert!(!svg.contains("<image") && !svg.contains("<!--") && !svg.contains("]]>"));
    assert_eq!(svg.matches("</svg>").count(), 1);
    raster::pixels(&svg).unwrap();
}

/// The height bar alone.
fn bar_of(view: View, height_m_per_kg_m2: f64, up_kg_m2: f64, down_kg_m2: f64) -> String {
    let height = all().height;
    let only = Annotations {
        height,
        ..Annotations::none()
    };
    let mut job = job(view, only);
    job.style.height_m_per_kg_m2 = height_m_per_kg_m2;
    let lifted = Lifted {
        up_kg_m2,
        down_kg_m2,
    };
    drawing(&job, &lifted).unwrap().unwrap()
}

/// How far down a drawing a text stands that begins so.
fn base_of(svg: &str, text: &str) -> f64 {
    let (before, _) = svg
        .split_once(&format!(">{text}"))
        .unwrap_or_else(|| panic!("{text}: {svg}"));
    let (_, tag) = before.rsplit_once(" y=\"").unwrap();
    tag.split('"').next().unwrap().parse().unwrap()
}

/// Pixels from the sea surface to a height in the middle of a picture.
fn expected_px(view: &View, height_m: f64) -> f64 {
    let projection = Projection::of(view).unwrap();
    let [width, height] = view.size_px().map(f64::from);
    let middle = projection.ground_at([width / 2.0, height / 2.0]).unwrap();
    let [foot, end] = [0.0, height_m].map(|height| projection.seen(middle, height).unwrap());
    (end.x_px - foot.x_px).hypot(end.y_px - foot.y_px)
}

#[test]
fn each_side_of_the_height_bar_is_as_long_as_its_columns_in_the_middle() {
    let view = view(1600, 900, 6e6, 25.0);
    let svg = bar_of(view, 8e6, 0.045, 0.062);
    let surface = base_of(&svg, "0 sea surface");
    // 45 g C m-2 are 360 km at 8000 km for a kilogram, 62 are 496.
    for (text, height_m) in [("45 given off", 360e3_f64), ("62 taken up", -496e3)] {
        let drawn = (surface - base_of(&svg, text)) * height_m.signum();
        let expected = expected_px(&view, height_m);
        assert!(
            (drawn - expected).abs() < 0.02,
            "{text}: {drawn} for {expected}: {svg}"
        );
    }
    // A round number between, on either side, without a sign.
    for (text, height_m) in [("25</text>", 200e3_f64), ("25</text>", -200e3)] {
        let written = format!(">{text}");
        let found = svg.match_indices(&written).map(|(at, _)| {
            let (_, tag) = svg[..at].rsplit_once(" y=\"").unwrap();
            tag.split('"').next().unwrap().parse::<f64>().unwrap()
        });
        let expected = surface - expected_px(&view, height_m) * height_m.signum();
        let nearest = found
            .map(|base| (base - expected).abs())
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.02, "{text}: {nearest}: {svg}");
    }
    assert!(
        svg.contains("Height: carbon given off, 45 at most"),
        "{svg}"
    );
    assert!(svg.contains("Depth: carbon taken up, 62 at most"), "{svg}");
}

#[test]
fn the_height_bar_has_the_sides_that_the_picture_has() {
    let view = view(1600, 900, 6e6, 25.0);
    let sinks = bar_of(view, 8e6, 0.0, 0.062);
    assert!(base_of(&sinks, "62 taken up") > base_of(&sinks, "0 sea surface"));
    assert!(
        !sinks.contains("Height: ") && !sinks.contains("given off"),
        "{sinks}"
    );
    let sources = bar_of(view, 8e6, 0.045, 0.0);
    assert!(base_of(&sources, "45 given off") < base_of(&sources, "0 sea surface"));
    assert!(
        !sources.contains("Depth: ") && !sources.contains("taken up"),
        "{sources}"
    );
    // A side too short for its number is told in words alone.
    let little = bar_of(view, 8e6, 0.002, 0.062);
    assert!(
        little.contains("Height: carbon given off, 2 at most"),
        "{little}"
    );
    assert!(!little.contains(">2 given off"), "{little}");
    let none = bar_of(view, 8e6, 0.0, 0.0);
    assert!(
        none.contains("No carbon given off or taken up here"),
        "{none}"
    );
    assert!(!none.contains("sea surface"), "{none}");
    // From below the sea nothing rises.
    let mut below = self::view(1600, 900, -4.5e5, 84.0);
    let View::Globe { angles, .. } = &mut below else {
        panic!("a globe")
    };
    angles.field_of_view_deg = 55.0;
    let hanging = bar_of(below, 8e6, 0.045, 0.062);
    assert!(!hanging.contains("given off"), "{hanging}");
    assert!(
        base_of(&hanging, "0 sea surface") < 900.0 && hanging.contains("62 at most"),
        "{hanging}"
    );
}

#[test]
fn both_sides_of_a_height_bar_are_to_one_scale_where_they_are_cut_short() {
    let near = view(1600, 900, 2.5e6, 45.0);
    let svg = bar_of(near, 2e7, 0.045, 0.030);
    // Neither end fits: the numbers are round, and those at most are told in words.
    assert!(
        !svg.contains(">45 given off") && !svg.contains(">30 taken up"),
        "{svg}"
    );
    assert!(
        svg.contains("given off, 45 at most") && svg.contains("taken up, 30 at most"),
        "{svg}"
    );
    let ends: Vec<(f64, f64)> = ["given off</text>", "taken up</text>"]
        .into_iter()
        .map(|what| {
            let (before, _) = svg.split_once(&format!(" {what}")).unwrap();
            let (before, number) = before.rsplit_once('>').unwrap();
            let (_, tag) = before.rsplit_once(" y=\"").unwrap();
            let base: f64 = tag.split('"').next().unwrap().parse().unwrap();
            (number.parse().unwrap(), base)
        })
        .collect();
    let surface = base_of(&svg, "0 sea surface");
    for ((number, base), sign) in ends.into_iter().zip([1.0, -1.0]) {
        let expected = expected_px(&near, sign * number * 2e4);
        assert!(
            (((surface - base) * sign) - expected).abs() < 0.02,
            "{number}: {svg}"
        );
    }
}

#[test]
fn a_shorter_side_that_is_cut_short_has_a_number_too() {
    let near = view(1600, 900, 2.5e6, 45.0);
    let svg = bar_of(near, 2e7, 0.0443, 0.0219);
    assert!(
        svg.contains("given off</text>") && svg.contains("taken up</text>"),
        "{svg}"
    );
}

#[test]
fn where_heights_end_is_told_on_the_bar_or_in_words() {
    // Seen from above it has no length, and nothing of that height is drawn where nothing lifts.
    let above = view(1600, 900, 6e6, 0.0);
    let svg = bar_of(above, 8e6, 0.2, 0.062);
    assert!(!svg.contains("sea surface"), "{svg}");
    assert!(svg.contains("more than 150 is cut off"), "{svg}");
    assert!(!bar_of(above, 8e6, 0.1, 0.062).contains("cut off"));
    let flat = {
        let mut job = job(above, all());
        job.style.height_m_per_kg_m2 = 0.0;
        drawing(&job, &LIFTED).unwrap().unwrap()
    };
    assert!(!flat.contains("Height"), "{flat}");
    // Where it fits as a whole, its end is marked, on the side that has it.
    let far = view(1600, 900, 1.2e7, 15.0);
    let svg = bar_of(far, 8e6, 0.2, 0.062);
    assert!(
        svg.contains("150 and more, cut off") && svg.contains("200 at most"),
        "{svg}"
    );
    assert!(!svg.contains("more than 150"), "{svg}");
    // Where it does not, it is told in words.
    let near = view(1600, 900, 3e6, 35.0);
    let svg = bar_of(near, 8e6, 0.2, 0.062);
    assert!(
        !svg.contains("150 and more") && svg.contains("more than 150 is cut off"),
        "{svg}"
    );
}

#[test]
fn a_flow_is_told_by_its_speed() {
    let mut job = job(view(1600, 900, 4e6, 0.0), all());
    job.mode = Mode::Flow;
    let annotations = job.annotations.as_mut().unwrap();
    annotations.legend = Some(Quantity::Current);
    let svg = drawing(&job, &LIFTED).unwrap().unwrap();
    assert!(svg.contains("Speed of the current") && !svg.contains("sea gives off"));
}
