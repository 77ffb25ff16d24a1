use super::*;
use crate::digest::Digest;
use crate::job::{Mode, RenderJob, View};
use crate::key::ObjectKey;
use crate::manifest::{MANIFEST_SCHEMA, Step};
use crate::picture::{PictureOptions, PictureRequest, PictureSources};
use crate::time::Period;

const VIEW: View = View::Globe {
    lon_deg: 0.0,
    lat_deg: 0.0,
    height_m: 1e6,
    width_px: 640,
    height_px: 480,
    angles: crate::camera::CameraAngles::NADIR,
};

/// Days of January 2002.
fn product(name: &str, quantity: Quantity, days: std::ops::RangeInclusive<u32>) -> Manifest {
    let product: ProductId = name.parse().unwrap();
    let step = |day: u32| Step {
        masked: None,
        period: Period {
            start: TimeMs::from_ymd(2002, 1, day).unwrap(),
            end: TimeMs::from_ymd(2002, 1, day + 1).unwrap(),
        },
        field: ObjectKey::field(&product, &Digest::of(format!("{name}{day}").as_bytes())),
        raw_sha256: Digest::of(b""),
        origin: String::new(),
        valid_cells: 1,
        contributed: None,
    };
    let rows = if quantity == Quantity::Current { 2 } else { 1 };
    Manifest {
        schema: MANIFEST_SCHEMA,
        number: 1,
        title: "Eastward surface current".to_owned(),
        quantity,
        synthetic: false,
        source: "Somebody (2010)".to_owned(),
        grid: Grid {
            rows,
            cols: 4,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 180.0 / f64::from(rows),
            dlon_deg: 90.0,
        },
        steps: days.map(step).collect(),
        domain: ObjectKey::domain(&product, &Digest::of(b"d")),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
        product,
    }
}

struct Sea {
    flux: Manifest,
    east: Manifest,
    north: Manifest,
}

impl Sea {
    fn new() -> Self {
        Self {
            flux: product("flux", Quantity::CarbonFlux, 1..=9),
            east: product("sea-east", Quantity::Current, 1..=9),
            north: product("sea-north", Quantity::Current, 1..=9),
        }
    }

    fn asked(
        &self,
        drawn: &Manifest,
        mode: Mode,
        time: &str,
        own: Option<&str>,
    ) -> Result<RenderJob, ContractError> {
        let sources = PictureSources {
            northward: (mode == Mode::Flow).then_some(&self.north),
            trails: Some(TrailSources {
                eastward: &self.east,
                northward: &self.north,
                time: own.map(|time| time.parse().unwrap()),
            }),
            ..PictureSources::of(drawn)
        };
        let request = PictureRequest {
            mode,
            view: VIEW,
            time: Some(time.parse().unwrap()),
            options: PictureOptions {
                annotations: "all".parse().unwrap(),
                ..PictureOptions::default()
            },
        };
        request.job(&sources)
    }

    fn over_flux(&self, time: &str, own: Option<&str>) -> Result<RenderJob, ContractError> {
        self.asked(&self.flux, Mode::Volume, time, own)
    }
}

fn reason(job: Result<RenderJob, ContractError>) -> String {
    job.unwrap_err().to_string()
}

#[test]
fn trails_have_the_grid_and_the_instant_of_their_vector() {
    let sea = Sea::new();
    let job = sea.over_flux("2002-01-03T18:00:00Z", None).unwrap();
    let trails = job.trails.as_ref().unwrap();
    assert_eq!((trails.grid, job.grid), (sea.east.grid, sea.flux.grid));
    assert_ne!(trails.grid, job.grid);
    assert_eq!(trails.eastward.product(), "sea-east");
    assert_eq!(trails.flow.northward.product(), "sea-north");
    let weight = trails.eastward.after.as_ref().unwrap().weight;
    assert_eq!(weight.to_bits(), 0.25f64.to_bits());
    let back: RenderJob = serde_json::from_str(&serde_json::to_string(&job).unwrap()).unwrap();
    assert_eq!((back.digest(), &back), (job.digest(), &job));
    let alone = job.trails_alone().unwrap();
    alone.validate().unwrap();
    assert_eq!((alone.mode, alone.view), (Mode::Flow, job.view));
}

#[test]
fn another_instant_of_the_vector_is_another_picture_and_the_caption_says_it() {
    let sea = Sea::new();
    let job = |own| sea.over_flux("2002-01-03", own).unwrap();
    let caption = |job: &RenderJob| {
        let annotations = job.annotations.as_ref().unwrap();
        String::from(annotations.trails.clone().unwrap())
    };
    let (same, other) = (job(None), job(Some("2002-01-05")));
    assert_ne!(same.key(), other.key());
    assert_eq!(caption(&same), "trails: Surface current (Somebody (2010))");
    assert_eq!(
        caption(&other),
        "trails: Surface current on 5 January 2002 (Somebody (2010))"
    );
}

#[test]
fn vectors_are_named_by_themselves_or_by_a_part() {
    let of = |name: &str| eastward_part(&name.parse().unwrap()).unwrap().to_string();
    for name in ["sea", "sea-east", "sea-north"] {
        assert_eq!(of(name), "sea-east");
    }
    let long: ProductId = "a".repeat(64).parse().unwrap();
    assert!(eastward_part(&long).is_err());
}

#[test]
fn what_leaves_no_trails_is_refused_with_its_reason() {
    let sea = Sea::new();
    let late = reason(sea.over_flux("2002-01-03", Some("2003-01-01")));
    assert!(late.contains("it covers 2002-01-01"), "{late}");
    let mut short = Sea::new();
    short.north.steps.truncate(3);
    assert!(short.over_flux("2002-01-02", None).is_ok());
    assert!(reason(short.over_flux("2002-01-07", None)).contains("different steps"));
    short.east.steps.truncate(3);
    assert!(reason(short.over_flux("2002-01-07", None)).contains("an instant of its own"));
    let mut other = Sea::new();
    other.north = product("lake-north", Quantity::Current, 1..=9);
    assert!(reason(other.over_flux("2002-01-03", None)).contains("NAME-north"));
    let own = reason(sea.asked(&sea.east, Mode::Flow, "2002-01-03", None));
    assert!(own.contains("drawn as a flow"), "{own}");
    sea.asked(&sea.east, Mode::Map, "2002-01-03", None).unwrap();
    assert!(
        no_vector(&"flux".parse().unwrap())
            .to_string()
            .contains("NAME-east")
    );
}

#[test]
fn trails_beyond_a_limit_are_refused_and_each_part_of_them_is_in_the_name() {
    let job = Sea::new().over_flux("2002-01-03T18:00:00Z", None).unwrap();
    let changed = |change: &dyn Fn(&mut Trails)| {
        let mut job = job.clone();
        change(job.trails.as_mut().unwrap());
        job
    };
    let look =
        |change: fn(&mut TrailLook)| changed(&|trails| change(trails.flow.look.as_mut().unwrap()));
    let valid = [
        changed(&|trails| trails.flow.clock_s += 1.0),
        changed(&|trails| trails.eastward.after = None),
        changed(&|trails| trails.transfer.high *= 2.0),
        look(|look| look.radius_px = 2.0),
        look(|look| look.area_px = 100.0),
        look(|look| look.depth = 1.0),
        RenderJob {
            trails: None,
            ..job.clone()
        },
    ];
    let mut names = vec![job.key()];
    for job in valid {
        job.validate().unwrap();
        names.push(job.key());
    }
    let count = names.len();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), count);
    for broken in [
        look(|look| look.radius_px = 0.0),
        look(|look| look.area_px = f64::NAN),
        look(|look| look.depth = 1e3),
        changed(&|trails| trails.grid.rows = u32::MAX),
        changed(&|trails| trails.transfer.high = f64::NAN),
        changed(&|trails| trails.eastward.domain = "frames/p/a".parse().unwrap()),
    ] {
        broken.validate().unwrap_err();
    }
}

#[test]
fn a_job_without_trails_says_nothing_of_them() {
    let job = Sea::new().over_flux("2002-01-03", None).unwrap();
    let plain = RenderJob {
        trails: None,
        annotations: None,
        ..job
    };
    assert!(!serde_json::to_string(&plain).unwrap().contains("trails"));
}
