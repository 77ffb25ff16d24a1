//! Calendars of models: what the real calendar has too lands with a note, and what it has not is refused.

use contract::event::RejectReason;
use contract::time::Period;
use ingest::{Outcome, Profile};

use crate::fixture::{Place, refusal};
use crate::made::{Made, MadeFile, Values};

/// A temperature at these days since a date of a calendar; with bounds, two numbers a step.
fn file(
    calendar: &'static str,
    since: &'static str,
    days: &[f64],
    bounds: Option<&[f64]>,
) -> MadeFile {
    let file = MadeFile::sst(days.len()).numbers("time", days);
    let file = file.but("time", |v| {
        v.text("units", since).text("calendar", calendar)
    });
    match bounds {
        None => file,
        Some(bounds) => {
            let bounds = Values::Doubles(bounds.to_vec());
            file.but("time", |v| v.text("bounds", "edges"))
                .with(Made::new("edges", &["time", "two"], bounds))
        }
    }
}

async fn land(file: &MadeFile, profile: Option<&Profile>) -> (Place, Outcome) {
    let place = Place::new();
    let files = [place.path("a.nc")];
    file.write(&files[0]);
    let outcome = place.land_with(&files, profile).await.remove(0);
    (place, outcome)
}

/// Periods, and the one note about the calendar, which is kept with the reading.
async fn told(file: &MadeFile) -> (Vec<Period>, String) {
    let (place, outcome) = land(file, None).await;
    let Outcome::Landed {
        periods,
        assumptions,
        ..
    } = outcome
    else {
        panic!("{outcome}")
    };
    let notes = place.store.list("readings").await.unwrap();
    let note = place.store.get(&notes[0]).await.unwrap();
    let note: serde_json::Value = serde_json::from_slice(&note).unwrap();
    let mut about = assumptions.iter().filter(|line| line.contains("calendar"));
    let (Some(only), None) = (about.next(), about.next()) else {
        panic!("{assumptions:?}")
    };
    let kept = note["assumptions"].as_array().unwrap();
    assert!(kept.iter().any(|line| line == only.as_str()), "{kept:?}");
    (periods, only.clone())
}

async fn assert_refused(file: &MadeFile, profile: Option<&Profile>, words: &[&str]) {
    let (_place, outcome) = land(file, profile).await;
    let (reason, line) = refusal(&[outcome]);
    assert_eq!(reason, RejectReason::Time, "{line}");
    for word in words {
        assert!(line.contains(word), "{word:?} is not in {line:?}");
    }
}

fn period(start: &str, end: &str) -> Period {
    Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
}

#[tokio::test]
async fn days_of_a_calendar_without_leap_days_land_and_the_missing_one_is_told() {
    // 27 and 28 February, 1 and 2 March, four years of 365 days after the reference.
    let stamps = [1517.5, 1518.5, 1519.5, 1520.5];
    let edges = [
        1517.0, 1518.0, 1518.0, 1519.0, 1519.0, 1520.0, 1520.0, 1521.0,
    ];
    let wanted = [
        period("2004-02-27", "2004-02-28"),
        period("2004-02-28", "2004-02-29"),
        period("2004-03-01", "2004-03-02"),
        period("2004-03-02", "2004-03-03"),
    ];
    for bounds in [None, Some(&edges[..])] {
        let days = file("noleap", "days since 2000-01-01", &stamps, bounds);
        let (periods, note) = told(&days).await;
        assert_eq!(periods, wanted, "{bounds:?}");
        assert!(
            note.contains("calendar noleap") && note.contains("29 February is in no step"),
            "{note}"
        );
    }
}

#[tokio::test]
async fn months_of_calendars_of_models_are_the_real_ones_and_their_lengths_are_told() {
    let months = |year| (1..=2).map(move |month| Period::month(year, month).unwrap());
    let edges = [0.0, 31.0, 31.0, 59.0];
    let noleap = |since| file("365_day", since, &[15.0, 45.0], Some(&edges));
    let (periods, note) = told(&noleap("days since 2004-01-01")).await;
    assert!(periods.into_iter().eq(months(2004)));
    assert!(
        note.contains("1 of 2 steps") && note.contains("29 days for 28"),
        "{note}"
    );
    let (_, note) = told(&noleap("days since 2001-01-01")).await;
    assert!(!note.contains("another length"), "{note}");

    // The second stamp is 30 February.
    for bounds in [None, Some(&[0.0, 30.0, 30.0, 60.0][..])] {
        let since = "days since 2001-01-01";
        let days360 = file("360_day", since, &[29.0, 59.0], bounds);
        let (periods, note) = told(&days360).await;
        assert!(periods.into_iter().eq(months(2001)), "{bounds:?}");
        assert!(
            note.contains("2 of 2 steps") && note.contains("31 days for 30"),
            "{note}"
        );
    }
    let years = file("360_day", "days since 2001-01-01", &[180.0, 540.0], None);
    let (periods, _) = told(&years).await;
    assert_eq!(periods[1], Period::year(2002).unwrap());
}

#[tokio::test]
async fn days_that_the_real_calendar_does_not_have_are_refused_with_the_date() {
    let since = "days since 2001-01-01";
    let days360 = |days: &[f64]| file("360_day", since, days, None);
    assert_refused(
        &days360(&[0.0, 1.0]),
        None,
        &["time: ", "360_day", "no whole month"],
    )
    .await;
    assert_refused(
        &days360(&[58.0, 59.0]),
        None,
        &["time: ", "2001-02-29", "360_day"],
    )
    .await;
    let text = "name = 'p'\nproduct = 'p'\ntitle = 't'\nsource = 's'\nquantity = 'sea_surface_temperature'\n[variable]\nname = 'sst'\n[time]\nfrom = { variable = { name = 'time' } }\ncovers = 'day'\n";
    let daily = Profile::parse("p", text).unwrap();
    assert_refused(&days360(&[0.0, 1.0]), Some(&daily), &["no whole month"]).await;
    let leap = file("366_day", since, &[59.0, 60.0], None);
    assert_refused(&leap, None, &["time: ", "2001-02-29", "all_leap"]).await;
    // The 28th ends where it begins.
    for bounds in [None, Some(&[57.0, 58.0, 58.0, 59.0][..])] {
        let (periods, _) = told(&file("366_day", since, &[57.5, 58.5], bounds)).await;
        assert_eq!(periods[1], period("2001-02-28", "2001-03-01"), "{bounds:?}");
    }
}
