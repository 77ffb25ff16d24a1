//! What is stored comes back as it was, once, whoever stores it.

use contract::observation::{Observation, PlatformKind, Quality};
use observations::{Counts, ErrorClass, Filter};

use super::{all, values};
use crate::homes::Home;
use crate::sample::{many, observation};

fn counts(new: u64, replaced: u64, same: u64) -> Counts {
    Counts {
        new,
        replaced,
        same,
    }
}

pub(crate) async fn storing_twice_changes_nothing(home: &Home) {
    let store = home.store();
    let rows = [observation("a", 0, 280.0), observation("b", 0, 281.0)];
    assert_eq!(store.upsert(&rows).await.unwrap(), counts(2, 0, 0));
    assert_eq!(store.upsert(&rows).await.unwrap(), counts(0, 0, 2));
    assert_eq!(all(store, Filter::default()).await, rows);
    assert_eq!(store.upsert(&[]).await.unwrap(), counts(0, 0, 0));
}

pub(crate) async fn a_new_value_replaces_the_old_one(home: &Home) {
    let store = home.store();
    let first = [observation("a", 0, 280.0), observation("b", 0, 281.0)];
    store.upsert(&first).await.unwrap();
    // Of two in one call the last one counts, and is counted once.
    let second = [
        observation("a", 0, 1.0),
        observation("a", 0, 2.0),
        observation("b", 0, 281.0),
        observation("c", 0, 3.0),
    ];
    assert_eq!(store.upsert(&second).await.unwrap(), counts(1, 1, 1));
    assert_eq!(values(store, Filter::default()).await, [2.0, 281.0, 3.0]);
    let changes: [fn(&mut Observation); 5] = [
        |o| o.quality = Quality::Bad,
        |o| "degC".clone_into(&mut o.unit),
        |o| o.kind = PlatformKind::Ship,
        |o| o.lon_deg = 1.0,
        |o| o.lat_deg = f64::from_bits(o.lat_deg.to_bits() + 1),
    ];
    let mut row = observation("c", 0, 3.0);
    for change in changes {
        change(&mut row);
        let row = [row.clone()];
        assert_eq!(
            store.upsert(&row).await.unwrap(),
            counts(0, 1, 0),
            "{row:?}"
        );
        assert_eq!(all(store, Filter::default()).await[2..], row);
    }
    // Another depth is another name.
    row.depth_m = 0.75;
    assert_eq!(store.upsert(&[row]).await.unwrap(), counts(1, 0, 0));
}

pub(crate) async fn one_bad_observation_stops_all_of_its_call(home: &Home) {
    let store = home.store();
    let mut bad = observation("b", 0, 1.0);
    bad.value = f64::NAN;
    let error = store
        .upsert(&[observation("a", 0, 1.0), bad])
        .await
        .unwrap_err();
    assert_eq!(error.class(), ErrorClass::BadRequest);
    assert_eq!(all(store, Filter::default()).await, []);
}

pub(crate) async fn every_instant_comes_back_to_the_millisecond(home: &Home) {
    let store = home.store();
    let times = [
        "0001-01-01T00:00:00Z",
        "1583-10-15T12:34:56.789Z",
        "1969-12-31T23:59:59.999Z",
        "1970-01-01T00:00:00Z",
        "2012-02-29T23:59:59.001Z",
        "9998-12-31T23:59:59.999Z",
    ];
    let rows: Vec<_> = times
        .iter()
        .map(|text| Observation {
            time: text.parse().unwrap(),
            ..observation("a", 0, 1.0)
        })
        .collect();
    store.upsert(&rows).await.unwrap();
    assert_eq!(all(store, Filter::default()).await, rows);
    let filter = Filter {
        from: Some(times[2].parse().unwrap()),
        to: Some(times[4].parse().unwrap()),
        ..Filter::default()
    };
    assert_eq!(all(store, filter).await, rows[2..4], "half open");
}

pub(crate) async fn every_number_comes_back_with_all_of_its_bits(home: &Home) {
    let store = home.store();
    let values = [
        f64::MIN_POSITIVE,
        f64::MAX,
        f64::MIN,
        5e-324,
        0.1 + 0.2,
        -1.0 / 3.0,
        0.0,
    ];
    let rows: Vec<_> = (0..)
        .zip(values)
        .map(|(i, value)| observation("a", i, value))
        .collect();
    store.upsert(&rows).await.unwrap();
    let bits = |rows: &[Observation]| rows.iter().map(|o| o.value.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&all(store, Filter::default()).await), bits(&rows));
    let mut row = observation("b", 0, -0.0);
    (row.lat_deg, row.depth_m) = (-0.0, -0.0);
    store.upsert(&[row]).await.unwrap();
    let filter = Filter {
        platforms: vec!["b".to_owned()],
        ..Filter::default()
    };
    let found = all(store, filter).await.remove(0);
    let zeros = [found.value, found.lat_deg, found.depth_m].map(f64::to_bits);
    assert_eq!(zeros, [0; 3], "there is one zero");
}

pub(crate) async fn many_writers_at_once_lose_nothing(home: &Home) {
    /// Rows of one writer; neighbours share half of them.
    const ROWS: i64 = 200;
    let writers: Vec<_> = (0..8i64)
        .map(|writer| {
            let store = home.shared();
            tokio::spawn(async move {
                let mut sum = Counts::default();
                for part in 0..4 {
                    let first = writer * ROWS / 2 + part * ROWS / 4;
                    let rows: Vec<_> = (first..first + ROWS / 4)
                        .rev()
                        .map(|minute| observation("a", minute * 30, minute as f64))
                        .collect();
                    sum += store.upsert(&rows).await.unwrap();
                }
                sum
            })
        })
        .collect();
    let mut sum = Counts::default();
    for writer in writers {
        sum += writer.await.unwrap();
    }
    let different = (8 - 1) * ROWS / 2 + ROWS;
    assert_eq!(
        sum,
        counts(different as u64, 0, (8 * ROWS - different) as u64)
    );
    let found = values(
        home.store(),
        Filter {
            limit: 10_000,
            ..Filter::default()
        },
    )
    .await;
    let expected: Vec<f64> = (0..different).map(|minute| minute as f64).collect();
    assert_eq!(found, expected);
}

pub(crate) async fn a_hundred_thousand_rows_are_stored_and_found(home: &Home) {
    let store = home.store();
    let rows = many(100_000);
    let start = std::time::Instant::now();
    assert_eq!(store.upsert(&rows).await.unwrap(), counts(100_000, 0, 0));
    let stored = start.elapsed();
    assert_eq!(store.upsert(&rows).await.unwrap(), counts(0, 0, 100_000));
    let again = start.elapsed().saturating_sub(stored);
    let asked = std::time::Instant::now();
    let filter = Filter {
        region: "-30,-10,30,10".parse().unwrap(),
        properties: vec!["wind_speed".to_owned()],
        limit: 10_000,
        ..Filter::default()
    };
    let found = all(store, filter).await;
    let within = |o: &&Observation| {
        o.lon_deg.abs() <= 30.0 && o.lat_deg.abs() <= 10.0 && o.property == "wind_speed"
    };
    assert_eq!(found.len(), rows.iter().filter(within).count());
    let answered = asked.elapsed();
    let summed = std::time::Instant::now();
    let platforms = store.platforms(&Filter::default()).await.unwrap().platforms;
    assert_eq!(platforms.iter().map(|p| p.count).sum::<u64>(), 100_000);
    println!(
        "100000 rows: stored in {stored:?}, again in {again:?}; region answered in {answered:?} ({} rows), platforms in {:?}",
        found.len(),
        summed.elapsed()
    );
}
