//! Render jobs, which name pictures: a job of before is read as it was, and its picture keeps its name.

use contract::colour::{Palette, TransferFunction};
use contract::context::{Context, Relief};
use contract::digest::Digest;
use contract::flow::Flow;
use contract::job::{Mode, RENDERER_VERSION, RenderJob, Style, View};
use contract::key::ObjectKey;
use contract::manifest::MANIFEST_SCHEMA;
use contract::observation::{PlatformKind, Quality};
use contract::quantity::Quantity;
use contract::sun::Subsolar;
use contract::tile::Tile;
use contract::time_sample::{After, Counts, TimeSample};

use super::{GRID, frozen, to_freeze};

/// The renderer that these jobs ask for. Another one is another name, and no other form: it needs no new jobs here.
const RENDERER: u32 = 5;

/// What a product is made of at an instant, one part of it for each of these.
fn time_sample(product: &str, weight: Option<f64>) -> TimeSample {
    let (id, of) = (product.parse().unwrap(), |part: &str| {
        Digest::of(part.as_bytes())
    });
    TimeSample {
        domain: ObjectKey::domain(&id, &of("domain")),
        before: Some(ObjectKey::field(&id, &of("before"))),
        after: weight.map(|weight| After {
            field: ObjectKey::field(&id, &of("after")),
            weight,
        }),
        contributed: None,
    }
}

/// A tile that says no more than it must.
fn plain() -> RenderJob {
    let transfer = TransferFunction::linear(Palette::Balance, -2e-9, 2e-9);
    RenderJob {
        renderer_version: RENDERER,
        grid: GRID,
        value: time_sample("flux", Some(0.25)),
        accumulated: None,
        relief: None,
        flow: None,
        trails: None,
        mode: Mode::Map,
        view: View::Tile {
            tile: Tile { z: 2, x: 3, y: 1 },
            size_px: 256,
        },
        style: Style::with_transfer(transfer),
        annotations: None,
    }
}

/// A view of the globe that says all that a job may say.
pub(super) fn full() -> RenderJob {
    let mut job = RenderJob {
        accumulated: Some(TimeSample {
            before: None,
            ..time_sample("flux-accumulated", Some(1.0 / 3.0))
        }),
        relief: Some(Relief {
            field: ObjectKey::field(&"etopo".parse().unwrap(), &Digest::of(b"relief")),
            grid: GRID,
            exaggeration: 15.0,
        }),
        mode: Mode::Volume,
        view: View::Globe {
            lon_deg: -170.5,
            lat_deg: 0.1 + 0.2,
            height_m: 1.2e7,
            width_px: 1920,
            height_px: 1080,
            angles: contract::camera::CameraAngles::NADIR,
        },
        ..plain()
    };
    let id = "flux".parse().unwrap();
    let counts = |of: &[u8]| Some(ObjectKey::contributed(&id, &Digest::of(of)));
    job.value.contributed = Some(Counts {
        before: counts(b"before"),
        after: counts(b"after"),
    });
    let style = &mut job.style;
    style.transfer.colours = "-1e-9:#102030,1e-9:#ffeedd".parse().unwrap();
    style.transfer.opacity = "0:0.5".parse().unwrap();
    style.transfer.size = "0:0.25".parse().unwrap();
    (style.height_m_per_kg_m2, style.optical_depth) = (4.5e6, 0.7);
    (style.slices, style.particles_per_cell) = (128, 8);
    (style.sun.azimuth_deg, style.sun.elevation_deg) = (123.4, 56.7);
    style.sun.subsolar = Some(Subsolar {
        lon_deg: 12.34,
        lat_deg: -23.4,
    });
    (style.globe_surface, style.uncertainty) = (true, true);
    style.context = Context {
        sea_opacity: 0.4,
        coastlines: true,
        ..Context::default()
    };
    job
}

/// Particles that drift with a current, in colours that are turned round.
fn flow() -> RenderJob {
    let mut job = RenderJob {
        value: time_sample("current-east", None),
        flow: Some(Flow {
            northward: time_sample("current-north", None),
            clock_s: 978_350_400.125,
            look: None,
        }),
        mode: Mode::Flow,
        ..plain()
    };
    job.style.transfer.reversed = true;
    job
}

#[test]
fn frozen_jobs_are_read_as_they_were_and_their_pictures_keep_their_names() {
    let jobs = [("flow", flow()), ("full", full()), ("plain", plain())];
    let names = jobs
        .iter()
        .map(|(name, job)| format!("{name} {}\n", job.key()));
    let names: String = names.collect();
    if let Some(folder) = to_freeze().map(|folder| folder.join("jobs")) {
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("names.txt"), &names).unwrap();
        for (name, job) in &jobs {
            let text = serde_json::to_string(job).unwrap();
            std::fs::write(folder.join(format!("{name}.json")), text).unwrap();
        }
    }
    let folder = frozen(MANIFEST_SCHEMA).join("jobs");
    let text = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    assert_eq!(text("names.txt"), names);
    for (name, job) in jobs {
        let text = text(&format!("{name}.json"));
        assert_eq!(
            serde_json::from_str::<RenderJob>(&text).unwrap(),
            job,
            "{name}"
        );
        assert_eq!(serde_json::to_string(&job).unwrap(), text, "{name}");
        let of_now = RenderJob {
            renderer_version: RENDERER_VERSION,
            ..job
        };
        of_now.validate().unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

/// Words that stand for something in what is stored and told, each in the order of its list.
#[test]
fn frozen_words_stand_for_what_they_stood_for() {
    let quality = (1..=4).map(|flag| Quality::from_flag(flag).unwrap());
    let words = serde_json::json!({
        "mode": Mode::ALL,
        "palette": Palette::ALL,
        "platform": PlatformKind::ALL,
        "quality": quality.collect::<Vec<_>>(),
        "quantity": Quantity::ALL,
    });
    let now = format!("{words:#}\n");
    if let Some(folder) = to_freeze() {
        std::fs::write(folder.join("words.json"), &now).unwrap();
    }
    let then = std::fs::read_to_string(frozen(MANIFEST_SCHEMA).join("words.json")).unwrap();
    assert_eq!(then, now);
}

/// How stored numbers are to be understood: a unit that changes makes other values of every field.
#[test]
fn units_of_stored_values_are_what_they_were() {
    let units = Quantity::ALL.map(|quantity| format!("{quantity:?} {}\n", quantity.unit()));
    if let Some(folder) = to_freeze() {
        std::fs::write(folder.join("units.txt"), units.concat()).unwrap();
    }
    let then = std::fs::read_to_string(frozen(MANIFEST_SCHEMA).join("units.txt")).unwrap();
    assert_eq!(then, units.concat());
}
