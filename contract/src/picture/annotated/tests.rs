use super::*;
use crate::analysis::{CalendarBins, CorrelationStatistic, MapStatistic};
use crate::camera::CameraAngles;
use crate::computed::{Computation, Computed, MapRequest};
use crate::digest::Digest;
use crate::grid::Grid;
use crate::job::Mode;
use crate::key::ObjectKey;
use crate::manifest::{MANIFEST_SCHEMA, Step};
use crate::picture::{PictureOptions, PictureRequest, shown_time};
use crate::product::ProductId;
use crate::quantity::{Flag, OpenQuantity, OpenWords, Quantity};
use crate::time::{Period, TimeStep};

const GLOBE: View = View::Globe {
    lon_deg: 0.0,
    lat_deg: 0.0,
    height_m: 1.5e7,
    width_px: 640,
    height_px: 480,
    angles: CameraAngles::NADIR,
};

fn product(name: &str, quantity: Quantity, periods: Vec<Period>) -> Manifest {
    let product: ProductId = name.parse().unwrap();
    let step = |period: Period| Step {
        masked: None,
        period,
        field: ObjectKey::field(&product, &Digest::of(period.to_string().as_bytes())),
        raw_sha256: Digest::of(b""),
        origin: String::new(),
        valid_cells: 1,
        contributed: None,
    };
    Manifest {
        schema: MANIFEST_SCHEMA,
        number: 1,
        title: "Sea-air flux".to_owned(),
        quantity,
        synthetic: false,
        source: "Somebody et al. (2009)".to_owned(),
        grid: Grid {
            rows: 2,
            cols: 4,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 90.0,
            dlon_deg: 90.0,
        },
        steps: periods.into_iter().map(step).collect(),
        domain: ObjectKey::domain(&product, &Digest::of(b"d")),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
        product,
    }
}

fn months() -> Vec<Period> {
    (1..=12)
        .map(|month| Period::month(2000, month).unwrap())
        .collect()
}

fn asked(
    sources: &PictureSources<'_>,
    view: View,
    mode: Mode,
    wishes: &str,
) -> Result<Option<Annotations>, ContractError> {
    let request = PictureRequest {
        mode,
        view,
        time: "2000-07-15T18:00:00Z".parse().ok(),
        options: PictureOptions {
            annotations: wishes.parse()?,
            ..PictureOptions::default()
        },
    };
    Ok(request.job(sources)?.annotations)
}

#[test]
fn what_is_asked_for_is_there_and_nothing_else() {
    let flux = product("flux", Quantity::CarbonFlux, months());
    let sources = PictureSources::of(&flux);
    let date = asked(&sources, GLOBE, Mode::Map, "date").unwrap().unwrap();
    let text = serde_json::to_string(&date).unwrap();
    assert_eq!(
        text,
        r#"{"version":5,"date":{"shown":"15 July 2000","note":"monthly means"}}"#
    );
    let plain = PictureRequest {
        mode: Mode::Map,
        view: GLOBE,
        time: None,
        options: PictureOptions::default(),
    };
    assert_eq!(plain.job(&sources).unwrap().annotations, None);
}

#[test]
fn beyond_the_last_step_the_date_is_its_last_day_and_of_sums_the_instant() {
    let shown = |quantity, asked: &str| {
        let product = product("flux", quantity, months());
        let time = shown_time(&product, asked.parse().ok()).unwrap();
        let date = DateLabel::of(&product, time).unwrap();
        date.shown.as_str().to_owned()
    };
    for asked in ["2001-01-01", "2003-05-05"] {
        assert_eq!(shown(Quantity::CarbonFlux, asked), "31 December 2000");
        assert_eq!(shown(Quantity::AccumulatedCarbon, asked), "1 January 2001");
    }
    for quantity in [Quantity::CarbonFlux, Quantity::AccumulatedCarbon] {
        assert_eq!(shown(quantity, "2000-12-01"), "1 December 2000");
        assert_eq!(shown(quantity, "1999-05-05"), "1 January 2000");
    }
}

#[test]
fn all_is_all_that_the_picture_has_to_tell() {
    let flux = product("flux", Quantity::CarbonFlux, months());
    let carbon = product("flux-accumulated", Quantity::AccumulatedCarbon, months());
    let alone = PictureSources::of(&flux);
    let lifted = PictureSources {
        accumulated: Some(&carbon),
        ..alone.clone()
    };
    let all =
        |sources: &PictureSources<'_>, mode| asked(sources, GLOBE, mode, "all").unwrap().unwrap();
    let volume = all(&lifted, Mode::Volume);
    assert_eq!(volume.legend, Some(Quantity::CarbonFlux));
    assert_eq!(volume.graticule, Graticule::every(30.0).ok());
    assert!(volume.names && volume.scale);
    assert_eq!(volume.height.unwrap().since, "2000".parse().unwrap());
    let source = volume.source.unwrap();
    assert_eq!(source.as_str(), "Sea-air flux: Somebody et al. (2009)");
    assert_eq!(all(&alone, Mode::Volume).height, None);
    assert_eq!(all(&lifted, Mode::Map).height, None, "a map lifts nothing");
}

#[test]
fn what_is_asked_for_by_name_and_has_nothing_to_tell_is_refused() {
    let flux = product("flux", Quantity::CarbonFlux, months());
    let sources = PictureSources::of(&flux);
    let refused = asked(&sources, GLOBE, Mode::Volume, "legend,height").unwrap_err();
    assert!(refused.to_string().contains("leave it out"), "{refused}");
    let tile = View::Tile {
        tile: crate::tile::Tile { z: 0, x: 0, y: 0 },
        size_px: 256,
    };
    for wishes in ["all", "legend"] {
        let refused = asked(&sources, tile, Mode::Map, wishes).unwrap_err();
        assert!(
            refused.to_string().contains("map tiles carry none"),
            "{refused}"
        );
    }
}

#[test]
fn a_product_of_one_step_is_named_by_it() {
    let label = |quantity, periods: Vec<Period>| {
        let product = product("p", quantity, periods);
        let label = DateLabel::of(&product, "2000-07-15T18:00:00Z".parse().unwrap()).unwrap();
        let note = label.note.map(String::from).unwrap_or_default();
        format!("{} | {note}", label.shown.as_str())
    };
    let july = vec![Period::month(2000, 7).unwrap()];
    assert_eq!(
        label(Quantity::WindSpeed, july.clone()),
        "July 2000 | monthly mean"
    );
    let year = vec![Period::year(2000).unwrap()];
    assert_eq!(label(Quantity::WindSpeed, year), "2000 | yearly mean");
    assert_eq!(
        label(Quantity::AccumulatedCarbon, july),
        "15 July 2000 | added up since 1 July 2000"
    );
    let hours =
        |from: &str, to: &str| Period::new(from.parse().unwrap(), to.parse().unwrap()).unwrap();
    let six = vec![
        hours("2000-07-15T12:00:00Z", "2000-07-15T18:00:00Z"),
        hours("2000-07-15T18:00:00Z", "2000-07-16T00:00:00Z"),
    ];
    assert_eq!(
        label(Quantity::WindSpeed, six),
        "15 July 2000, 18:00 UTC | 6-hour means"
    );
}

#[test]
fn what_has_no_mean_over_time_is_not_called_one() {
    let note = |quantity, periods: Vec<Period>| {
        let product = product("p", quantity, periods);
        let label = DateLabel::of(&product, "2008-07-15T18:00:00Z".parse().unwrap()).unwrap();
        label.note.map(String::from)
    };
    let words = OpenWords {
        name: "basin".to_owned(),
        unit: "1".to_owned(),
        title: "Basin".to_owned(),
        range: None,
        flags: vec![Flag {
            value: 3,
            meaning: "pacific".to_owned(),
        }],
        is_standard_name: false,
    };
    let codes = Quantity::Open(OpenQuantity::new(words).unwrap());
    let crest = Quantity::open("sst_annual_phase", "day", "Day of the crest").unwrap();
    assert!(crest.is_day_of_year());
    let of_no_time = [
        codes,
        crest,
        Quantity::Elevation,
        Quantity::LandAreaFraction,
        Quantity::SeaAreaFraction,
    ];
    for quantity in of_no_time {
        let year = vec![Period::year(2008).unwrap()];
        assert_eq!(note(quantity, year), None, "{}", quantity.word());
        assert_eq!(note(quantity, months()), None, "{}", quantity.word());
    }
    let measured = Quantity::open("dust", "kg m-2", "Dust").unwrap();
    let year = vec![Period::year(2008).unwrap()];
    assert_eq!(note(measured, year).as_deref(), Some("yearly mean"));
}

#[test]
fn a_statistic_over_time_is_not_called_a_mean() {
    let label = |quantity, how: Computation, base: Option<&str>, periods: Vec<Period>| {
        let mut product = product("p", quantity, periods);
        let map = base.map(|base| MapRequest {
            base: base.parse().ok(),
            bins: CalendarBins::Month,
            anomaly_step: None,
            region: None,
            crop: false,
            once: false,
        });
        product.computed = Some(Computed {
            how,
            inputs: vec![],
            from: None,
            to: None,
            map,
        });
        let label = DateLabel::of(&product, "2000-07-15T18:00:00Z".parse().unwrap()).unwrap();
        let note = label.note.map(String::from).unwrap_or_default();
        format!("{} | {note}", label.shown.as_str())
    };
    let of = |statistic| Computation::Statistic {
        statistic,
        step: TimeStep::Month,
        least_percent: 50,
    };
    let year = || vec![Period::year(2000).unwrap()];
    let p90: MapStatistic = "p90".parse().unwrap();
    for (statistic, expected) in [
        (MapStatistic::Mean, "2000 | yearly mean"),
        (MapStatistic::Max, "2000 | highest of this time"),
        (MapStatistic::Min, "2000 | lowest of this time"),
        (p90, "2000 | p90 of this time"),
        (MapStatistic::Trend, "2000 | "),
    ] {
        let found = label(Quantity::WindSpeed, of(statistic), None, year());
        assert_eq!(found, expected);
    }
    let correlation = Computation::Correlation {
        statistic: CorrelationStatistic::Coefficient,
        lag_steps: 0,
        step: TimeStep::Month,
        deseasonalised: false,
        least_percent: 50,
    };
    assert_eq!(
        label(Quantity::WindSpeed, correlation, None, year()),
        "2000 | "
    );
    let climatology = of(MapStatistic::Climatology);
    assert_eq!(
        label(
            Quantity::WindSpeed,
            climatology.clone(),
            Some("1991/2020"),
            months()
        ),
        "15 July 2000 | climatology of 1991/2020"
    );
    // Of sums of carbon too: a map of the highest of them was not added up.
    assert_eq!(
        label(Quantity::AccumulatedCarbon, climatology, None, months()),
        "15 July 2000 | climatology"
    );
    let highest = of(MapStatistic::Max);
    assert_eq!(
        label(Quantity::AccumulatedCarbon, highest, None, year()),
        "2000 | highest of this time"
    );
}

#[test]
fn hostile_words_of_a_product_become_one_short_line() {
    let mut flux = product("flux", Quantity::CarbonFlux, months());
    flux.title = "<script>\u{202e}\n".repeat(2_000);
    flux.source = "&]]>\"'\0".repeat(2_000);
    flux.synthetic = true;
    let sources = PictureSources::of(&flux);
    let source = asked(&sources, GLOBE, Mode::Map, "source")
        .unwrap()
        .unwrap()
        .source;
    let source = String::from(source.unwrap());
    assert!(source.chars().count() <= crate::annotation::MAX_LABEL_CHARS);
    assert!(
        source.starts_with("<script> <script>") && source.ends_with('…'),
        "{source}"
    );
    for empty in ["", " \n"] {
        (flux.title, flux.source) = (empty.to_owned(), empty.to_owned());
        flux.synthetic = false;
        let sources = PictureSources::of(&flux);
        assert_eq!(asked(&sources, GLOBE, Mode::Map, "source").unwrap(), None);
    }
}
