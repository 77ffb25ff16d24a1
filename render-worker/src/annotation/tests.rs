use std::collections::BTreeSet;

use super::*;
use contract::annotation::{Annotations, DateLabel, Graticule, HeightScale, Label};
use contract::camera::CameraAngles;
use contract::job::{Mode, View};
use contract::quantity::Quantity;
use render_proof::ocean;

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
    drawing(&job).unwrap().unwrap()
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
    assert_eq!(annotated(&plain, image(300, 200)).unwrap(), image(300, 200));
    for (width, height) in [(1, 1), (16, 16), (4096, 16), (95, 95)] {
        let job = job(view(width, height, 1e7, 0.0), all());
        assert_eq!(
            annotated(&job, image(width, height)).unwrap(),
            image(width, height)
        );
    }
    let small = job(view(300, 200, 1e7, 0.0), all());
    assert_ne!(annotated(&small, image(300, 200)).unwrap(), image(300, 200));
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

#[test]
fn the_height_bar_is_as_high_as_the_plumes_in_the_middle() {
    let view = view(1600, 900, 3e6, 35.0);
    let svg = drawn(view, |a| {
        *a = Annotations {
            height: a.height,
            ..Annotations::none()
        };
    });
    let projection = Projection::of(&view).unwrap();
    let middle = projection.ground_at([800.0, 450.0]).unwrap();
    // 20 g C m-2 are 160 km at 8000 km for a kilogram.
    let [foot, top] = [0.0, 160e3].map(|height| projection.seen(middle, height).unwrap());
    let expected = (top.x_px - foot.x_px).hypot(top.y_px - foot.y_px);
    let base = |text: &str| -> f64 {
        let (before, _) = svg.split_once(&format!(">{text}")).unwrap();
        let (_, tag) = before.rsplit_once(" y=\"").unwrap();
        tag.split('"').next().unwrap().parse().unwrap()
    };
    let drawn = base("0 sea surface") - base("20</text>");
    assert!(
        (drawn - expected).abs() < 0.02,
        "{drawn} for {expected}: {svg}"
    );
    // Seen from above it has no length, and nothing of that height is drawn where nothing lifts.
    let above = self::view(1600, 900, 6e6, 0.0);
    assert!(!drawn_of(above, 8e6).contains("sea surface"));
    assert!(drawn_of(above, 8e6).contains("more than 150 is cut off"));
    assert!(!drawn_of(above, 0.0).contains("Height"));
    // Where it fits as a whole, its end is marked.
    assert!(!drawn_of(view, 8e6).contains("150 and more"));
    let far = self::view(1600, 900, 1.2e7, 15.0);
    assert!(
        drawn_of(far, 8e6).contains("150 and more"),
        "{}",
        drawn_of(far, 8e6)
    );
}

fn drawn_of(view: View, height_m_per_kg_m2: f64) -> String {
    let mut job = job(view, all());
    job.style.height_m_per_kg_m2 = height_m_per_kg_m2;
    drawing(&job).unwrap().unwrap()
}

#[test]
fn a_flow_is_told_by_its_speed() {
    let mut job = job(view(1600, 900, 4e6, 0.0), all());
    job.mode = Mode::Flow;
    let annotations = job.annotations.as_mut().unwrap();
    annotations.legend = Some(Quantity::Current);
    let svg = drawing(&job).unwrap().unwrap();
    assert!(svg.contains("Speed of the current") && !svg.contains("sea gives off"));
}
