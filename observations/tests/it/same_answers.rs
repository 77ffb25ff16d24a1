//! The same calls to both homes: the same answers, byte for byte as JSON.

use contract::observation::{PlatformKind, Quality};
use contract::region::{Polygon, Region};
use observations::{Filter, TrackQuery};

use crate::homes::Home;
use crate::sample::{START_MS, many, time};

/// A star around a place, its arms straight in longitude and latitude.
fn star(lon: f64, lat: f64) -> Region {
    let corner = |i: usize| {
        let angle = i as f64 * std::f64::consts::TAU / 14.0;
        let reach = if i.is_multiple_of(2) { 60.0 } else { 20.0 };
        [lon + reach * angle.cos(), lat + reach * angle.sin()]
    };
    let hole = vec![
        [lon - 5.0, lat - 5.0],
        [lon + 5.0, lat - 5.0],
        [lon, lat + 5.0],
    ];
    Region::Polygons(vec![Polygon {
        outer: (0..14).map(corner).collect(),
        holes: vec![hole],
    }])
}

fn questions() -> Vec<Filter> {
    let of = |change: fn(&mut Filter)| {
        let mut filter = Filter {
            limit: 500,
            ..Filter::default()
        };
        change(&mut filter);
        filter
    };
    vec![
        of(|_| {}),
        of(|f| f.region = "150,-40,-120,60".parse().unwrap()),
        of(|f| f.region = "equatorial-pacific".parse().unwrap()),
        of(|f| f.region = star(175.0, 10.0)),
        of(|f| f.region = star(-100.0, -20.0)),
        of(|f| {
            f.kinds = vec![PlatformKind::Ship, PlatformKind::Station];
            f.worst = Quality::Questionable;
        }),
        of(|f| {
            f.from = Some(time(START_MS + 86_400_000 * 20));
            f.to = Some(time(START_MS + 86_400_000 * 40));
            f.properties = vec!["wind_speed".to_owned()];
        }),
        of(|f| {
            f.datasets = vec!["ships".parse().unwrap()];
            f.platforms = vec!["platform-3".to_owned()];
        }),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn both_homes_give_the_same_bytes() {
    let (files, postgis) = (Home::files(), Home::postgis());
    let rows = many(20_000);
    for part in rows.chunks(7000).rev() {
        let counts = [
            files.store().upsert(part).await.unwrap(),
            postgis.store().upsert(part).await.unwrap(),
        ];
        assert_eq!(counts[0], counts[1]);
    }
    let mut answers = 0;
    for question in questions() {
        let mut filter = question;
        // A few pages of each.
        for _ in 0..4 {
            let a = files.store().query(&filter).await.unwrap();
            let b = postgis.store().query(&filter).await.unwrap();
            let [json_a, json_b] = [&a, &b].map(|page| serde_json::to_string(page).unwrap());
            assert_eq!(json_a, json_b, "{filter:?}");
            answers += a.observations.len();
            filter.after = a.next;
            if filter.after.is_none() {
                break;
            }
        }
        filter.after = None;
        let a = files.store().platforms(&filter).await.unwrap();
        let b = postgis.store().platforms(&filter).await.unwrap();
        let [json_a, json_b] = [&a, &b].map(|all| serde_json::to_string(all).unwrap());
        assert_eq!(json_a, json_b, "{filter:?}");
    }
    assert!(
        answers > 5000,
        "{answers} rows were compared: too few to tell"
    );
    for platform in 0..10 {
        let dataset = ["buoys", "ships"][platform % 2].parse().unwrap();
        let mut query = TrackQuery::new(dataset, format!("platform-{platform}"));
        // Half of them by a limit.
        if platform >= 5 {
            query.limit = 7;
        }
        let a = files.store().track(&query).await.unwrap();
        let b = postgis.store().track(&query).await.unwrap();
        assert!(!a.is_empty());
        let [json_a, json_b] = [&a, &b].map(|all| serde_json::to_string(all).unwrap());
        assert_eq!(json_a, json_b);
    }
    postgis.close().await;
}
