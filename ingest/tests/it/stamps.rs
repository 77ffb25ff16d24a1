//! Which period a step covers: bounds, cell methods, spacing, coverage; and what is said where none of them tells.

use contract::event::{Body, RejectReason};
use contract::time::Period;
use contract::topic::Topic;
use ingest::{Outcome, Profile};

use crate::fixture::{Place, events, refusal};
use crate::made::{Made, MadeFile, Says, Values};

/// Periods and assumptions of a file that lands.
async fn told(file: &MadeFile, profile: Option<&Profile>) -> (Vec<Period>, Vec<String>) {
    let place = Place::new();
    file.write(&place.path("a.nc"));
    let outcome = place
        .land_with(&[place.path("a.nc")], profile)
        .await
        .remove(0);
    let Outcome::Landed {
        periods,
        assumptions,
        ..
    } = outcome
    else {
        panic!("{outcome}")
    };
    (periods, assumptions)
}

async fn assert_refused(file: &MadeFile, words: &[&str]) {
    let place = Place::new();
    file.write(&place.path("a.nc"));
    let (reason, line) = refusal(&place.land(&[place.path("a.nc")]).await);
    assert_eq!(reason, RejectReason::Time, "{line}");
    for word in words {
        assert!(line.contains(word), "{word:?} is not in {line:?}");
    }
    eprintln!("{line}");
}

fn period(start: &str, end: &str) -> Period {
    Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
}

fn with_bounds(file: MadeFile, attribute: &'static str, bounds: &[f64]) -> MadeFile {
    let bounds = Made::new("edges", &["time", "two"], Values::Doubles(bounds.to_vec()));
    file.but("time", |v| v.text(attribute, "edges"))
        .with(bounds)
}

fn method(file: MadeFile, text: &'static str) -> MadeFile {
    file.but("sst", |v| v.text("cell_methods", text))
}

#[tokio::test]
async fn bounds_say_it_whatever_the_stamps_are() {
    let file = with_bounds(
        MadeFile::sst(2).numbers("time", &[4.0, 12.0]),
        "bounds",
        &[0.0, 8.0, 8.0, 16.0],
    );
    let (periods, assumptions) = told(&file, None).await;
    assert_eq!(
        periods,
        [
            period("2001-01-01", "2001-01-09"),
            period("2001-01-09", "2001-01-17")
        ]
    );
    assert_eq!(assumptions, Vec::<String>::new());
}

#[tokio::test]
async fn bounds_that_lie_otherwise_are_read_where_that_has_one_meaning() {
    let file = |dimensions: &[&'static str], numbers: &[f64]| {
        let numbers = Values::Doubles(numbers.to_vec());
        let mut file = MadeFile::sst(3)
            .numbers("time", &[4.0, 12.0, 20.0])
            .but("time", |v| v.text("bounds", "edges"))
            .with(Made::new("edges", dimensions, numbers));
        file.dimensions.extend([("edge", 4), ("one", 1)]);
        file
    };
    let wanted = [
        period("2001-01-01", "2001-01-09"),
        period("2001-01-09", "2001-01-17"),
        period("2001-01-17", "2001-01-25"),
    ];
    let pairs = [0.0, 8.0, 8.0, 16.0, 16.0, 24.0];
    let lying: [(&[&'static str], &[f64], bool); 4] = [
        (&["time", "one", "two"], &pairs, false),
        (&["one", "time", "two"], &pairs, false),
        (&["two", "time"], &[0.0, 8.0, 16.0, 8.0, 16.0, 24.0], true),
        (&["edge"], &[0.0, 8.0, 16.0, 24.0], true),
    ];
    for (dimensions, numbers, is_told) in lying {
        let (periods, assumptions) = told(&file(dimensions, numbers), None).await;
        assert_eq!(periods, wanted, "{dimensions:?}");
        let about = assumptions.iter().filter(|line| line.contains("edges"));
        assert_eq!(about.count(), usize::from(is_told), "{assumptions:?}");
    }
    let three = file(&["time"], &[0.0, 8.0, 16.0]);
    let words = ["time: ", "\"edges\"", "[3]", "shape [3, 2]", "the time"];
    assert_refused(&three, &words).await;
}

/// Packed in tenths, as their stamps are not.
#[tokio::test]
async fn bounds_that_are_packed_are_unpacked() {
    let file = MadeFile::sst(2).numbers("time", &[0.5, 1.5]);
    let file = with_bounds(file, "bounds", &[0.0, 10.0, 10.0, 20.0]);
    let file = file.but("edges", |v| v.says("scale_factor", Says::Doubles(&[0.1])));
    let (periods, _) = told(&file, None).await;
    let days = [
        period("2001-01-01", "2001-01-02"),
        period("2001-01-02", "2001-01-03"),
    ];
    assert_eq!(periods, days);
}

#[tokio::test]
async fn bounds_that_miss_their_stamps_are_refused_and_lost_ones_are_noted() {
    let file = with_bounds(
        MadeFile::sst(2).numbers("time", &[4.0, 99.0]),
        "bounds",
        &[0.0, 8.0, 8.0, 16.0],
    );
    assert_refused(
        &file,
        &["time: ", "2001-04-10", "\"edges\"", "2001-01-09", "profile"],
    )
    .await;
    let lost = MadeFile::sst(2).but("time", |v| v.text("bounds", "edges"));
    let (_, assumptions) = told(&lost, None).await;
    assert!(
        assumptions[0].contains("\"edges\"") && assumptions[0].contains("not there"),
        "{assumptions:?}"
    );
}

#[tokio::test]
async fn a_climatology_lies_in_the_years_of_its_stamps() {
    // January and February of 1961 to 1990, as days since 2001.
    let days = [-14_610.0, -3_987.0, -14_579.0, -3_959.0];
    let file = MadeFile::sst(2).numbers("time", &[15.0, 45.0]);
    let file = method(
        with_bounds(file, "climatology", &days),
        "time: mean within years time: mean over years",
    );
    let (periods, assumptions) = told(&file, None).await;
    assert_eq!(
        periods,
        [
            Period::month(2001, 1).unwrap(),
            Period::month(2001, 2).unwrap()
        ]
    );
    assert!(
        assumptions[0].contains("climatology of 1961 to 1990"),
        "{assumptions:?}"
    );
    let hours = method(
        file.clone(),
        "time: maximum within days time: mean over days",
    );
    assert_refused(&hours, &["time: ", "within days", "whole days"]).await;
    let mut lost = file;
    lost.variables.retain(|v| v.name != "edges");
    assert_refused(&lost, &["time: ", "climatology", "\"edges\"", "profile"]).await;
}

#[tokio::test]
async fn instants_stand_for_the_time_around_their_stamps() {
    let hours = MadeFile::sst(3).numbers("time", &[0.0, 0.25, 0.5]);
    let (periods, assumptions) = told(&method(hours.clone(), "time: point"), None).await;
    assert_eq!(
        periods[0],
        period("2000-12-31T21:00:00Z", "2001-01-01T03:00:00Z")
    );
    assert_eq!(
        periods[2],
        period("2001-01-01T09:00:00Z", "2001-01-01T15:00:00Z")
    );
    assert!(assumptions[0].contains("instants"), "{assumptions:?}");
    // Bounds that are their stamps say the same.
    let empty = with_bounds(hours.clone(), "bounds", &[0.0, 0.0, 0.25, 0.25, 0.5, 0.5]);
    assert_eq!(told(&empty, None).await.0, periods);
    let (means, assumptions) = told(&method(hours, "time: mean"), None).await;
    assert_eq!(means[0], period("2001-01-01", "2001-01-01T06:00:00Z"));
    assert!(
        assumptions[0].contains("starts of the steps"),
        "{assumptions:?}"
    );
}

#[tokio::test]
async fn centred_stamps_are_told_by_where_they_stand() {
    let noons = MadeFile::sst(2).numbers("time", &[0.5, 1.5]);
    let (periods, assumptions) = told(&noons, None).await;
    assert_eq!(
        (periods[0], assumptions.len()),
        (period("2001-01-01", "2001-01-02"), 0)
    );
    let pentads = MadeFile::sst(2).numbers("time", &[2.5, 7.5]);
    let (periods, assumptions) = told(&pentads, None).await;
    assert_eq!(
        (periods[0], assumptions.len()),
        (period("2001-01-01", "2001-01-06"), 0)
    );
    let months = MadeFile::sst(3).numbers("time", &[15.0, 45.0, 74.0]);
    assert_eq!(
        told(&months, None).await,
        (
            (1..=3).map(|m| Period::month(2001, m).unwrap()).collect(),
            vec![]
        )
    );
}

#[tokio::test]
async fn where_nothing_tells_the_assumption_is_printed_and_stored() {
    let place = Place::new();
    MadeFile::sst(2)
        .numbers("time", &[3.0, 11.0])
        .write(&place.path("a.nc"));
    let outcomes = place.land(&[place.path("a.nc")]).await;
    let line = outcomes[0].to_string();
    assert!(
        line.contains("assumed: time: has no bounds; stamps are taken for the starts"),
        "{line}"
    );
    assert!(line.contains("stamp = \"middle\""), "{line}");
    let notes = place.store.list("readings").await.unwrap();
    let note = place.store.get(&notes[0]).await.unwrap();
    let note: serde_json::Value = serde_json::from_slice(&note).unwrap();
    let stored = note["assumptions"][0].as_str().unwrap();
    assert!(line.ends_with(stored), "{line} {stored}");
    let landed = events(&place.log, Topic::GranuleLanded).await;
    let Body::GranuleLanded { assumptions, .. } = &landed[0].body else {
        panic!("{landed:?}")
    };
    assert_eq!(assumptions, &[stored]);
}

#[tokio::test]
async fn a_profile_says_where_stamps_stand() {
    let profile = |stamp: &str| {
        let text = format!(
            "name = 'p'\nproduct = 'p'\ntitle = 't'\nsource = 's'\nquantity = 'sea_surface_temperature'\n[variable]\nname = 'sst'\n[time]\nfrom = {{ variable = {{ name = 'time' }} }}\ncovers = '8 days'\n{stamp}"
        );
        Profile::parse("p", &text)
    };
    let file = MadeFile::sst(2).numbers("time", &[8.0, 16.0]);
    for (stamp, start, end) in [
        ("", "2001-01-09", "2001-01-17"),
        ("stamp = 'start'", "2001-01-09", "2001-01-17"),
        ("stamp = 'middle'", "2001-01-05", "2001-01-13"),
        ("stamp = 'end'", "2001-01-01", "2001-01-09"),
    ] {
        let (periods, _) = told(&file, Some(&profile(stamp).unwrap())).await;
        assert_eq!(periods[0], period(start, end), "{stamp}");
    }
    let error = profile("stamp = 'centre'").unwrap_err().to_string();
    assert!(
        error.contains("centre") && error.contains("middle"),
        "{error}"
    );
}

/// Attributes of a file without a time axis.
fn covering(start: &'static str, end: &'static str) -> MadeFile {
    let mut file = MadeFile::sst(1);
    file.variables.retain(|v| v.name != "time");
    let map = |v: Made| Made {
        dimensions: vec!["lat", "lon"],
        ..v
    };
    file.but("sst", map)
        .text("time_coverage_start", start)
        .text("time_coverage_end", end)
}

#[tokio::test]
async fn the_hour_of_a_compact_date_is_kept() {
    let file = covering("20231231T120000Z", "20231231T180000Z");
    let (periods, assumptions) = told(&file, None).await;
    assert_eq!(
        periods,
        [period("2023-12-31T12:00:00Z", "2023-12-31T18:00:00Z")]
    );
    assert!(assumptions.is_empty());
    let text = "name = 'p'\nproduct = 'p'\ntitle = 't'\nsource = 's'\nquantity = 'sea_surface_temperature'\n[variable]\nname = 'sst'\n[time]\nfrom = { attribute = 'time_coverage_start' }\ncovers = '6 hours'\n";
    let profile = Profile::parse("p", text).unwrap();
    assert_eq!(told(&file, Some(&profile)).await.0, periods);
    assert_refused(
        &covering("20231231 at noon", "20231231T180000Z"),
        &["file: ", "profile"],
    )
    .await;
}

/// Months and eight days as NASA's maps of MODIS have them, one after the other: whole days, and no overlap.
#[tokio::test]
async fn coverage_that_passes_midnight_by_an_orbit_is_of_whole_days() {
    for coverage in [
        [
            ("2010-01-01T00:05:00Z", "2010-02-01T00:10:00Z"),
            ("2010-02-01T00:05:00Z", "2010-03-01T00:10:00Z"),
        ],
        [
            ("2010-01-01T00:05:00.000Z", "2010-01-09T02:59:59.000Z"),
            ("2010-01-09T00:00:01.000Z", "2010-01-17T02:54:59.000Z"),
        ],
        [
            ("2009-12-31T22:35:01.000Z", "2010-01-02T01:19:59.000Z"),
            ("2010-01-01T22:40:00.000Z", "2010-01-03T01:29:59.000Z"),
        ],
    ] {
        let place = Place::new();
        let files: Vec<_> = (0..2).map(|i| place.path(&format!("{i}.nc"))).collect();
        for ((start, end), path) in coverage.iter().zip(&files) {
            covering(start, end).write(path);
        }
        let outcomes = place.land(&files).await;
        for outcome in &outcomes {
            let Outcome::Landed {
                periods,
                assumptions,
                ..
            } = outcome
            else {
                panic!("{outcome}")
            };
            assert_eq!(
                (
                    periods[0].start.ms() % 86_400_000,
                    periods[0].end.ms() % 86_400_000
                ),
                (0, 0),
                "{outcome}"
            );
            assert!(
                assumptions[0].contains("time_coverage_start"),
                "{assumptions:?}"
            );
        }
        let steps = place.newest("sst").await.steps;
        assert_eq!(steps[0].period.end, steps[1].period.start);
        assert_eq!(&steps[0].period.start.to_string()[..10], "2010-01-01");
    }
    let (periods, _) = told(
        &covering("2010-01-01T00:05:00Z", "2010-02-01T00:10:00Z"),
        None,
    )
    .await;
    assert_eq!(periods, [Period::month(2010, 1).unwrap()]);
}

#[tokio::test]
async fn coverage_that_means_what_it_says_stays() {
    for (start, end, from, to) in [
        // The last second, and a day without a time, are within.
        (
            "2010-01-01T00:00:00Z",
            "2010-01-31T23:59:59Z",
            "2010-01-01",
            "2010-02-01",
        ),
        ("2010-01-01", "2010-01-31", "2010-01-01", "2010-02-01"),
        ("20100101", "20100131", "2010-01-01", "2010-02-01"),
        // So are a month and a year.
        ("2010-01", "2010-03", "2010-01-01", "2010-04-01"),
        ("2010", "2010", "2010-01-01", "2011-01-01"),
        // Days of their own, parts of a day.
        (
            "2010-01-01T03:00:00Z",
            "2010-01-02T03:00:00Z",
            "2010-01-01T03:00:00Z",
            "2010-01-02T03:00:00Z",
        ),
        (
            "2010-01-01T12:00:00Z",
            "2010-01-03T00:00:00Z",
            "2010-01-01T12:00:00Z",
            "2010-01-03",
        ),
        (
            "2010-01-01T00:05:00Z",
            "2010-01-01T06:05:00Z",
            "2010-01-01T00:05:00Z",
            "2010-01-01T06:05:00Z",
        ),
    ] {
        let (periods, assumptions) = told(&covering(start, end), None).await;
        assert_eq!(periods, [period(from, to)], "{start} {end}");
        assert!(assumptions.is_empty(), "{assumptions:?}");
    }
}

#[tokio::test]
async fn one_stamp_and_the_coverage_must_agree() {
    let file = |day: f64, resolution: Option<&'static str>| {
        let file = MadeFile::sst(1).numbers("time", &[day]);
        let file = file
            .text("time_coverage_start", "2001-01-01T00:00:00Z")
            .text("time_coverage_end", "2001-02-01T00:00:00Z");
        resolution.into_iter().fold(file, |file, text| {
            file.text("time_coverage_resolution", text)
        })
    };
    for resolution in [None, Some("P1M")] {
        // In the month, and at its end.
        for day in [0.0, 15.0, 31.0] {
            let (periods, _) = told(&file(day, resolution), None).await;
            assert_eq!(
                periods,
                [Period::month(2001, 1).unwrap()],
                "{day} {resolution:?}"
            );
        }
        assert_refused(
            &file(60.0, resolution),
            &["time: ", "2001-03-02", "time_coverage_start", "profile"],
        )
        .await;
    }
    let lone = MadeFile::sst(1).text("time_coverage_resolution", "P1M");
    let (periods, assumptions) = told(&lone, None).await;
    assert_eq!(periods, [Period::month(2001, 1).unwrap()]);
    assert!(
        assumptions[0].contains("start of the step"),
        "{assumptions:?}"
    );
    assert_eq!(
        told(&lone.numbers("time", &[15.0]), None).await.1,
        Vec::<String>::new()
    );
}

/// What is stated of the length of a step may be how far values are apart, and no more.
#[tokio::test]
async fn a_stated_length_and_the_coverage_must_agree() {
    let file = |day: f64, resolution, [start, end]: [&'static str; 2]| {
        MadeFile::sst(1)
            .numbers("time", &[day])
            .text("time_coverage_resolution", resolution)
            .text("time_coverage_start", start)
            .text("time_coverage_end", end)
    };
    let january = ["2001-01-01T00:00:00Z", "2001-02-01T00:00:00Z"];
    for (day, resolution) in [(0.0, "P1D"), (0.0, "P1Y"), (3.0, "P8D")] {
        assert_refused(
            &file(day, resolution, january),
            &[
                "file: ",
                "time_coverage_resolution",
                "2001-02-01",
                "profile",
            ],
        )
        .await;
    }
    // As long, and elsewhere.
    let between = ["2001-01-16T00:00:00Z", "2001-02-15T00:00:00Z"];
    let (periods, assumptions) = told(&file(31.0, "P1M", between), None).await;
    assert_eq!(periods, [period("2001-01-16", "2001-02-15")]);
    assert!(assumptions[0].contains("length alone"), "{assumptions:?}");
    // Within the step.
    let noon = ["2001-01-01T10:00:00Z", "2001-01-01T13:30:00Z"];
    let (periods, assumptions) = told(&file(0.5, "P1D", noon), None).await;
    assert_eq!(periods, [period("2001-01-01", "2001-01-02")]);
    assert!(assumptions[0].contains("lie within"), "{assumptions:?}");
    // The last day by its midnight.
    let days = ["2001-01-01T00:00:00Z", "2001-01-31T00:00:00Z"];
    let month = vec![Period::month(2001, 1).unwrap()];
    assert_eq!(told(&file(15.0, "P1M", days), None).await, (month, vec![]));
}

/// Of composites of eight days some are counted anew with each year, others run on.
#[tokio::test]
async fn the_coverage_says_whether_a_composite_ends_with_its_year() {
    let file = |end: &'static str| {
        MadeFile::sst(1)
            .numbers("time", &[360.0])
            .text("time_coverage_resolution", "P8D")
            .text("time_coverage_start", "2001-12-27T00:00:00Z")
            .text("time_coverage_end", end)
    };
    for end in [
        "2002-01-04T00:00:00Z",
        "2002-01-03T23:59:59Z",
        "2002-01-03T00:00:00Z",
    ] {
        let running = vec![period("2001-12-27", "2002-01-04")];
        assert_eq!(told(&file(end), None).await, (running, vec![]), "{end}");
    }
    for end in ["2002-01-01T00:00:00Z", "2001-12-31T23:59:59Z"] {
        let (periods, assumptions) = told(&file(end), None).await;
        assert_eq!(periods, [period("2001-12-27", "2002-01-01")], "{end}");
        assert!(assumptions[0].contains("ends with its year"), "{end}");
    }
}

/// A map of a forecast has two times of one number each.
#[tokio::test]
async fn when_a_forecast_was_begun_is_no_time_of_its_values() {
    let begun = Made::new(
        "forecast_reference_time",
        &["time"],
        Values::Doubles(vec![-10.0]),
    );
    let begun = begun
        .text("standard_name", "forecast_reference_time")
        .text("units", "days since 2001-01-01");
    let map = |v: Made| Made {
        dimensions: vec!["lat", "lon"],
        ..v
    };
    let mut file = MadeFile::sst(1).text("time_coverage_resolution", "P1D");
    file.variables.insert(0, begun);
    let (periods, _) = told(&file.but("sst", map), None).await;
    assert_eq!(periods, [period("2001-01-01", "2001-01-02")]);
}

/// Those of eight days begin anew on the first of January, as their makers count them.
#[tokio::test]
async fn composites_of_days_end_with_their_year() {
    let last = period("2001-12-27", "2002-01-01");
    let days: Vec<f64> = (0..46).map(|step| f64::from(8 * step)).collect();
    let year = MadeFile::sst(46).numbers("time", &days);
    let stated = MadeFile::sst(1)
        .numbers("time", &[360.0])
        .text("time_coverage_resolution", "P8D");
    let text = "name = 'p'\nproduct = 'p'\ntitle = 't'\nsource = 's'\nquantity = 'sea_surface_temperature'\n[variable]\nname = 'sst'\n[time]\nfrom = { variable = { name = 'time' } }\ncovers = '8 days'\n";
    let profile = Profile::parse("p", text).unwrap();
    let lone = MadeFile::sst(1).numbers("time", &[360.0]);
    for (file, profile) in [(year, None), (stated, None), (lone, Some(&profile))] {
        let (periods, assumptions) = told(&file, profile).await;
        assert_eq!(periods.last(), Some(&last));
        let is_told = |line: &String| line.contains("counted from 1 January: that from 2001-12-27");
        assert!(assumptions.iter().any(is_told), "{assumptions:?}");
    }
    // Stamps that go on over New Year say so.
    let on = MadeFile::sst(3).numbers("time", &[352.0, 360.0, 368.0]);
    let (periods, assumptions) = told(&on, None).await;
    assert_eq!(periods[1], period("2001-12-27", "2002-01-04"));
    assert!(
        !assumptions.iter().any(|line| line.contains("January")),
        "{assumptions:?}"
    );
}

/// A temperature of as many degrees as the step is of the file.
fn numbered(days: &[f64]) -> MadeFile {
    let values = (0..days.len()).flat_map(|step| [step as f32; 32]).collect();
    let numbered = |v: Made| Made {
        values: Values::Floats(values),
        ..v
    };
    MadeFile::sst(days.len())
        .numbers("time", days)
        .but("sst", numbered)
}

#[tokio::test]
async fn an_axis_that_goes_backwards_is_read_as_it_is() {
    for (file, last) in [
        (
            numbered(&[2.0, 1.0, 0.0]),
            period("2001-01-03", "2001-01-04"),
        ),
        (
            method(numbered(&[2.0, 1.0, 0.0]), "time: point"),
            period("2001-01-02T12:00:00Z", "2001-01-03T12:00:00Z"),
        ),
        // Both bounds in the order of the axis, as the conventions have it.
        (
            with_bounds(
                numbered(&[2.5, 1.5, 0.5]),
                "bounds",
                &[3.0, 2.0, 2.0, 1.0, 1.0, 0.0],
            ),
            period("2001-01-03", "2001-01-04"),
        ),
    ] {
        let place = Place::new();
        file.write(&place.path("a.nc"));
        let outcome = place.land(&[place.path("a.nc")]).await.remove(0);
        assert!(!outcome.is_rejected(), "{outcome}");
        let manifest = place.newest("sst").await;
        assert_eq!(manifest.steps[2].period, last);
        for (step, degrees) in [(0, 2.0f64), (1, 1.0), (2, 0.0)] {
            let wanted = (degrees + 273.15) as f32;
            assert_eq!(place.values(&manifest, step).await[5], wanted, "{step}");
        }
    }
}

#[tokio::test]
async fn times_that_are_there_twice_or_in_no_order_are_refused_with_their_places() {
    assert_refused(
        &numbered(&[0.0, 1.0, 1.0, 2.0]),
        &["time: ", "2001-01-02 twice", "steps 2 and 3"],
    )
    .await;
    assert_refused(
        &numbered(&[0.0, 2.0, 1.0, 3.0]),
        &[
            "time: ",
            "neither up nor down",
            "step 3",
            "2001-01-02, after 2001-01-03",
        ],
    )
    .await;
}

#[tokio::test]
async fn parts_of_a_second_since_a_date_are_read() {
    for (unit, second) in [
        ("milliseconds since 2001-01-01", 1e3),
        ("microseconds since 2001-01-01", 1e6),
        ("nanoseconds since 2001-01-01", 1e9),
    ] {
        let file = numbered(&[0.0, 86_400.0 * second]);
        let file = file.but("time", |v| v.text("units", unit));
        let (periods, _) = told(&file, None).await;
        assert_eq!(periods[1], period("2001-01-02", "2001-01-03"), "{unit}");
    }
}
