//! Every question finds what it names, in one order, page by page.

use contract::observation::{Observation, PlatformKind, Quality};
use contract::product::ProductId;
use contract::region::{Polygon, Region};
use observations::{ErrorClass, Filter, TrackQuery};

use super::all;
use crate::homes::Home;
use crate::sample::{START_MS, at, many, observation, time};

pub(crate) async fn rows_come_by_time_and_then_by_the_bytes_of_their_names(home: &Home) {
    let store = home.store();
    let names = [
        "a",
        "b",
        "B",
        "A-b",
        "A_b",
        "é",
        "z",
        "Z",
        "\u{10348}",
        "\u{ff5e}",
        "a b",
    ];
    let mut rows: Vec<_> = names.iter().map(|name| observation(name, 1, 1.0)).collect();
    rows.push(observation("zz", 0, 1.0));
    rows.push(Observation {
        depth_m: -4.0,
        ..observation("a", 1, 1.0)
    });
    store.upsert(&rows).await.unwrap();
    let found = all(store, Filter::default()).await;
    let mut expected = names;
    expected.sort_unstable();
    let in_order: Vec<_> = found.iter().map(|o| o.platform.as_str()).collect();
    assert_eq!(in_order[0], "zz");
    let deduped: Vec<_> = in_order[1..].iter().filter(|n| **n != "a").collect();
    assert_eq!(
        deduped,
        expected.iter().filter(|n| **n != "a").collect::<Vec<_>>()
    );
    let depths: Vec<_> = found
        .iter()
        .filter(|o| o.platform == "a")
        .map(|o| o.depth_m)
        .collect();
    assert_eq!(depths, [-4.0, 0.5]);
}

pub(crate) async fn pages_join_to_the_whole(home: &Home) {
    let store = home.store();
    let rows = many(1000);
    store.upsert(&rows).await.unwrap();
    let whole = all(
        store,
        Filter {
            limit: 1000,
            ..Filter::default()
        },
    )
    .await;
    assert_eq!(whole.len(), 1000);
    let mut filter = Filter {
        limit: 37,
        ..Filter::default()
    };
    let mut joined = vec![];
    loop {
        let page = store.query(&filter).await.unwrap();
        assert!(page.observations.len() <= 37);
        joined.extend(page.observations);
        filter.after = page.next;
        if filter.after.is_none() {
            break;
        }
    }
    assert_eq!(joined, whole);
}

pub(crate) async fn the_date_line_cuts_nothing(home: &Home) {
    let store = home.store();
    let lons = [-180.0, -179.5, -175.0, 0.0, 175.0, 179.5];
    let mut rows: Vec<_> = lons.iter().map(|lon| at(*lon, 0.0)).collect();
    // The same place as -170, counted from 0 to 360.
    rows.push(at(190.0, 0.0));
    store.upsert(&rows).await.unwrap();
    let within = async |region: &str| {
        let region: Region = region.parse().unwrap();
        let found = all(
            store,
            Filter {
                region,
                ..Filter::default()
            },
        )
        .await;
        let mut lons: Vec<_> = found.iter().map(|o| o.lon_deg).collect();
        lons.sort_by(f64::total_cmp);
        lons
    };
    assert_eq!(within("179.5,-1,-179.5,1").await, [-180.0, -179.5, 179.5]);
    assert_eq!(
        within("175,-1,190,1").await,
        [-180.0, -179.5, -175.0, -170.0, 175.0, 179.5]
    );
    assert_eq!(within("-180,-1,-176,1").await, [-180.0, -179.5]);
    assert_eq!(within("170,-1,180,1").await, [-180.0, 175.0, 179.5]);
    assert_eq!(within("0,-1,360,1").await.len(), 7);
    assert!(within("0,1,360,2").await.is_empty());
    assert_eq!(within("global").await.len(), 7);
}

pub(crate) async fn edges_of_a_polygon_belong_to_it_and_those_of_its_hole_too(home: &Home) {
    let store = home.store();
    // A rhomb around (180, 0) with a square hole in its middle.
    let polygon = Polygon {
        outer: vec![[170.0, 0.0], [180.0, -10.0], [190.0, 0.0], [180.0, 10.0]],
        holes: vec![vec![
            [178.0, -2.0],
            [182.0, -2.0],
            [182.0, 2.0],
            [178.0, 2.0],
        ]],
    };
    let inside = [
        [170.0, 0.0],
        [175.0, 5.0],
        [-175.0, -5.0],
        [-180.0, 10.0],
        [-180.0, 5.0],
        [177.0, 0.0],
        [178.0, 1.0],
        [-178.0, 2.0],
    ];
    let outside = [
        [-180.0, 0.0],
        [179.0, 1.0],
        [-179.0, -1.0],
        [175.0, 5.5],
        [169.5, 0.0],
        [0.0, 0.0],
    ];
    let rows: Vec<_> = inside
        .iter()
        .chain(&outside)
        .map(|[lon, lat]| at(*lon, *lat))
        .collect();
    store.upsert(&rows).await.unwrap();
    let filter = Filter {
        region: Region::Polygons(vec![polygon]),
        ..Filter::default()
    };
    let mut found: Vec<_> = all(store, filter)
        .await
        .iter()
        .map(|o| [o.lon_deg, o.lat_deg])
        .collect();
    let mut expected = inside.to_vec();
    let order = |a: &[f64; 2], b: &[f64; 2]| a.partial_cmp(b).unwrap();
    found.sort_by(order);
    expected.sort_by(order);
    assert_eq!(found, expected);
}

/// Is an observation wanted?
type Wanted = fn(&Observation) -> bool;

pub(crate) async fn a_filter_finds_what_it_names_and_nothing_else(home: &Home) {
    let store = home.store();
    let rows = many(2000);
    store.upsert(&rows).await.unwrap();
    let filters: [(Filter, Wanted); 7] = [
        (
            Filter {
                datasets: vec!["ships".parse().unwrap(), "absent".parse().unwrap()],
                ..Filter::default()
            },
            |o| o.dataset.as_str() == "ships",
        ),
        (
            Filter {
                platforms: vec!["platform-3".to_owned(), "platform-4".to_owned()],
                ..Filter::default()
            },
            |o| o.platform == "platform-3" || o.platform == "platform-4",
        ),
        (
            Filter {
                properties: vec!["wind_speed".to_owned()],
                ..Filter::default()
            },
            |o| o.property == "wind_speed",
        ),
        (
            Filter {
                kinds: vec![PlatformKind::Ship],
                ..Filter::default()
            },
            |o| o.kind == PlatformKind::Ship,
        ),
        (
            Filter {
                worst: Quality::NotEvaluated,
                ..Filter::default()
            },
            |o| o.quality.flag() <= 2,
        ),
        (
            Filter {
                from: Some(time(START_MS + 6_000_000)),
                to: Some(time(START_MS + 12_000_000)),
                ..Filter::default()
            },
            |o| (START_MS + 6_000_000..START_MS + 12_000_000).contains(&o.time.ms()),
        ),
        (
            Filter {
                datasets: vec!["absent".parse().unwrap()],
                ..Filter::default()
            },
            |_| false,
        ),
    ];
    for (mut filter, wanted) in filters {
        filter.limit = 10_000;
        let found = all(store, filter.clone()).await;
        let expected = rows.iter().filter(|o| wanted(o)).count();
        assert!(found.iter().all(wanted), "{filter:?}");
        assert_eq!(found.len(), expected, "{filter:?}");
    }
}

pub(crate) async fn platforms_are_summed_up_over_what_is_wanted(home: &Home) {
    let store = home.store();
    let ship = |minute: i64, lon_deg: f64, property: &str| Observation {
        lon_deg,
        property: property.to_owned(),
        kind: PlatformKind::Ship,
        ..observation("ship", minute, 1.0)
    };
    let rows = [
        ship(0, 179.0, "wind_speed"),
        ship(45_000, -179.0, "wind_speed"),
        ship(45_000, -179.0, "air_temperature"),
        observation("buoy", 3, 1.0),
    ];
    store.upsert(&rows).await.unwrap();
    let all = store.platforms(&Filter::default()).await.unwrap();
    assert!(all.is_complete);
    let found = all.platforms;
    let names: Vec<_> = found
        .iter()
        .map(|p| (p.platform.as_str(), p.count))
        .collect();
    assert_eq!(names, [("buoy", 1), ("ship", 3)]);
    let ship = &found[1];
    assert_eq!(ship.kind, PlatformKind::Ship);
    assert_eq!(ship.bounds_deg, [179.0, 43.25, 181.0, 43.25]);
    assert_eq!((ship.lon_deg, ship.lat_deg), (-179.0, 43.25));
    assert_eq!(ship.properties, ["air_temperature", "wind_speed"]);
    assert_eq!((ship.first, ship.last), (rows[0].time, rows[1].time));
    let early = Filter {
        to: Some(rows[1].time),
        ..Filter::default()
    };
    let found = store.platforms(&early).await.unwrap().platforms;
    assert_eq!((found[1].count, found[1].lon_deg), (1, 179.0));
    for (limit, is_complete) in [(1, false), (2, true)] {
        let some = Filter {
            limit,
            ..Filter::default()
        };
        let found = store.platforms(&some).await.unwrap();
        assert_eq!(found.platforms.len(), limit as usize);
        assert_eq!(found.is_complete, is_complete, "{limit} of two");
    }
}

pub(crate) async fn every_dataset_is_named_however_many_platforms_others_have(home: &Home) {
    let store = home.store();
    assert_eq!(store.datasets().await.unwrap(), []);
    let mut rows: Vec<_> = (0..20)
        .map(|number| observation(&format!("platform-{number}"), 0, 1.0))
        .collect();
    for name in ["ships", "a-first", "z-last"] {
        rows.push(Observation {
            dataset: name.parse().unwrap(),
            ..observation("one", 0, 1.0)
        });
    }
    store.upsert(&rows).await.unwrap();
    let found = store.datasets().await.unwrap();
    let names: Vec<_> = found.iter().map(ProductId::as_str).collect();
    assert_eq!(names, ["a-first", "buoys", "ships", "z-last"]);
}

pub(crate) async fn a_track_has_one_place_for_each_time(home: &Home) {
    let store = home.store();
    let place = |minute: i64, lon_deg: f64, depth_m: f64| Observation {
        lon_deg,
        depth_m,
        ..observation("ship", minute, 1.0)
    };
    let mut rows = vec![
        place(50_000, 3.0, 0.0),
        place(0, 1.0, 0.0),
        place(0, 1.5, 10.0),
        place(1, 2.0, 0.0),
        observation("other", 1, 1.0),
    ];
    rows.push(Observation {
        dataset: "ships".parse().unwrap(),
        ..place(2, 9.0, 0.0)
    });
    store.upsert(&rows).await.unwrap();
    let query = TrackQuery::new("buoys".parse().unwrap(), "ship");
    let lons = async |query: &TrackQuery| -> Vec<f64> {
        let track = store.track(query).await.unwrap();
        assert!(track.is_sorted_by_key(|point| point.time));
        track.iter().map(|point| point.lon_deg).collect()
    };
    assert_eq!(lons(&query).await, [1.0, 2.0, 3.0]);
    let two = TrackQuery {
        limit: 2,
        ..query.clone()
    };
    assert_eq!(lons(&two).await, [1.0, 3.0]);
    let late = TrackQuery {
        from: Some(rows[3].time),
        to: Some(rows[0].time),
        ..query.clone()
    };
    assert_eq!(lons(&late).await, [2.0]);
    let nobody = TrackQuery {
        platform: "nobody".to_owned(),
        ..query
    };
    assert!(lons(&nobody).await.is_empty());
    let asked = [two, nobody, late];
    let together = store.tracks(&asked).await.unwrap();
    assert_eq!(together.len(), asked.len());
    for (query, track) in asked.iter().zip(together) {
        assert_eq!(track, store.track(query).await.unwrap(), "{query:?}");
    }
    assert!(store.tracks(&[]).await.unwrap().is_empty());
}

pub(crate) async fn a_long_track_is_thinned_and_ends_where_it_ends(home: &Home) {
    let store = home.store();
    // Over some months, so that it lies in several files.
    let way: Vec<_> = (0..5000)
        .map(|at| Observation {
            lon_deg: f64::from(at) / 100.0,
            ..observation("ship", i64::from(at) * 30, 1.0)
        })
        .collect();
    store.upsert(&way).await.unwrap();
    for (limit, expected) in [(1, 1), (2, 2), (100, 100), (4999, 2501), (5000, 5000)] {
        let query = TrackQuery {
            limit,
            ..TrackQuery::new("buoys".parse().unwrap(), "ship")
        };
        let track = store.track(&query).await.unwrap();
        assert_eq!(track.len(), expected, "{limit}");
        assert!(track.is_sorted_by_key(|point| point.time));
        let last = &track[track.len() - 1];
        assert_eq!((last.time, last.lon_deg), (way[4999].time, 49.99));
        if limit > 1 {
            assert_eq!((track[0].time, track[0].lon_deg), (way[0].time, 0.0));
            let every = (track[1].lon_deg * 100.0).round() as usize;
            assert_eq!(track[1].time, way[every].time, "the places of the way");
        }
    }
}

pub(crate) async fn questions_beyond_their_limits_are_refused(home: &Home) {
    let store = home.store();
    let none = Filter {
        limit: 0,
        ..Filter::default()
    };
    let null = Filter {
        platforms: vec!["a\0b".to_owned()],
        ..Filter::default()
    };
    for filter in [none, null] {
        let error = store.query(&filter).await.unwrap_err();
        assert_eq!(error.class(), ErrorClass::BadRequest);
        let error = store.platforms(&filter).await.unwrap_err();
        assert_eq!(error.class(), ErrorClass::BadRequest);
    }
    let quote = Filter {
        platforms: vec!["'; DROP TABLE observation; --".to_owned()],
        properties: vec!["\\".to_owned()],
        ..Filter::default()
    };
    assert_eq!(all(store, quote).await, []);
    store
        .upsert(&[observation("'; DROP TABLE observation; --", 0, 1.0)])
        .await
        .unwrap();
    assert_eq!(all(store, Filter::default()).await.len(), 1);
}

pub(crate) async fn an_empty_home_is_ready_and_answers_with_nothing(home: &Home) {
    let store = home.store();
    store.ready().await.unwrap();
    assert_eq!(all(store, Filter::default()).await, []);
    let none = store.platforms(&Filter::default()).await.unwrap();
    assert_eq!((none.platforms, none.is_complete), (vec![], true));
}
