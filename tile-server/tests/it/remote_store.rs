//! A store behind a network that goes silent: what is in memory is served, the rest is refused within seconds.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use axum::Router;
use axum::body::Bytes;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use axum::routing::any;
use contract::digest::Digest;
use contract::quantity::Quantity;
use contract::time::TimeMs;
use storage::Store;
use storage::store::{RetryLimits, Settings};

use crate::app::TestApp;

/// As much of S3 as this server uses: objects are put, replaced by who knows them, read in parts and listed.
#[derive(Default)]
struct Bucket {
    objects: Mutex<BTreeMap<String, Bytes>>,
    /// Requests are taken and never answered.
    is_silent: AtomicBool,
    unanswered: AtomicUsize,
    /// Requests for what belongs to a cube are answered, and fail.
    cubes_fail: AtomicBool,
    /// Method and key of every request.
    requests: Mutex<Vec<(Method, String)>>,
}

async fn object(
    State(bucket): State<Arc<Bucket>>,
    path: Option<Path<String>>,
    Query(query): Query<BTreeMap<String, String>>,
    method: Method,
    asked: HeaderMap,
    content: Bytes,
) -> Response {
    if bucket.is_silent.load(Ordering::SeqCst) {
        bucket.unanswered.fetch_add(1, Ordering::SeqCst);
        std::future::pending::<()>().await;
    }
    let key = path.map(|Path(key)| key).unwrap_or_default();
    let request = (method.clone(), key.clone());
    bucket.requests.lock().unwrap().push(request);
    if bucket.cubes_fail.load(Ordering::SeqCst) && key.starts_with("cubes/") {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    }
    if key.is_empty() {
        let prefix = query.get("prefix").map_or("", String::as_str);
        return listing(&bucket, prefix, query.contains_key("delimiter"));
    }
    let mut objects = bucket.objects.lock().unwrap();
    let dated = |content: &Bytes| {
        let mut headers = HeaderMap::new();
        headers.insert(header::LAST_MODIFIED, date().parse().unwrap());
        let tag = format!("\"{}\"", Digest::of(content));
        headers.insert(header::ETAG, tag.parse().unwrap());
        headers
    };
    match method {
        Method::PUT if objects.contains_key(&key) && !asked.contains_key(header::IF_MATCH) => {
            StatusCode::PRECONDITION_FAILED.into_response()
        }
        Method::PUT => {
            let headers = dated(&content);
            objects.insert(key, content);
            headers.into_response()
        }
        _ => match (objects.get(&key).cloned(), part_of(&asked)) {
            (Some(content), None) => (dated(&content), content).into_response(),
            (Some(content), Some((first, last))) => {
                let length = content.len();
                let (first, end) = (first.min(length), (last + 1).min(length));
                let part = content.slice(first..end);
                let mut headers = dated(&content);
                let place = format!("bytes {first}-{}/{length}", end - 1);
                headers.insert(header::CONTENT_RANGE, place.parse().unwrap());
                (StatusCode::PARTIAL_CONTENT, headers, part).into_response()
            }
            (None, _) => StatusCode::NOT_FOUND.into_response(),
        },
    }
}

/// Now, as servers say it: whoever commits to a cube compares it with its own clock.
fn date() -> String {
    const MONTHS: [&str; 12] = [
        "Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec",
    ];
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    let now = TimeMs::new(since.as_millis() as i64).unwrap().to_string();
    let (year, month, day, time) = (&now[..4], &now[5..7], &now[8..10], &now[11..19]);
    let month = MONTHS[month.parse::<usize>().unwrap() - 1];
    format!("{day} {month} {year} {time} GMT")
}

/// The first and the last byte that are asked for.
fn part_of(asked: &HeaderMap) -> Option<(usize, usize)> {
    let range = asked.get(header::RANGE)?.to_str().unwrap();
    let (first, last) = range.strip_prefix("bytes=")?.split_once('-')?;
    Some((first.parse().unwrap(), last.parse().unwrap()))
}

fn listing(bucket: &Bucket, prefix: &str, is_of_folders: bool) -> Response {
    let entry = |(key, content): (&String, &Bytes)| {
        format!(
            "<Contents><Key>{key}</Key><Size>{}</Size><LastModified>2000-01-01T00:00:00.000Z</LastModified><ETag>\"1\"</ETag></Contents>",
            content.len()
        )
    };
    let objects = bucket.objects.lock().unwrap();
    let own = objects.iter().filter(|(key, _)| key.starts_with(prefix));
    let found: String = if is_of_folders {
        let folder = |(key, _): (&String, &Bytes)| {
            let (name, _inside) = key[prefix.len()..].split_once('/')?;
            Some(format!("{prefix}{name}/"))
        };
        let folders: BTreeSet<String> = own.filter_map(folder).collect();
        let entry = |name| format!("<CommonPrefixes><Prefix>{name}</Prefix></CommonPrefixes>");
        folders.into_iter().map(entry).collect()
    } else {
        own.map(entry).collect()
    };
    format!("<ListBucketResult><IsTruncated>false</IsTruncated>{found}</ListBucketResult>")
        .into_response()
}

async fn remote() -> (Arc<Bucket>, Store) {
    let bucket = Arc::new(Bucket::default());
    let router = Router::new()
        .route("/bucket", any(object))
        .route("/bucket/{*key}", any(object))
        .with_state(Arc::clone(&bucket));
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let endpoint = format!("http://{}", listener.local_addr().unwrap());
    tokio::spawn(async { axum::serve(listener, router).await.unwrap() });
    let variables = [
        ("AWS_ENDPOINT", endpoint.as_str()),
        ("AWS_ACCESS_KEY_ID", "a"),
        ("AWS_SECRET_ACCESS_KEY", "a"),
        ("AWS_REGION", "us-east-1"),
        ("AWS_ALLOW_HTTP", "true"),
    ];
    let owned = variables.map(|(name, value)| (name.to_owned(), value.to_owned()));
    let mut settings = Settings::from_variables(owned);
    settings.retry_limits = RetryLimits::interactive();
    let store = Store::open_with("s3://bucket", &settings).unwrap();
    (bucket, store)
}

#[tokio::test]
async fn a_store_that_goes_silent_is_told_of_within_seconds_and_what_is_known_is_served() {
    let (bucket, store) = remote().await;
    let app = TestApp::over(store, |settings| settings.catalogue_age_ms = 1000);
    app.land("flux", Quantity::CarbonFlux, 1).await;
    let tile = "/tiles/flux/map/0/0/0.png";
    let first = app.get(tile).await;
    assert_eq!(first.status, StatusCode::OK, "{}", first.text());
    bucket.is_silent.store(true, Ordering::SeqCst);
    tokio::time::sleep(Duration::from_millis(1100)).await;
    // A crowd, of which some ask for what is in memory and others for what must be drawn without the store.
    app.drawer.is_slow.store(true, Ordering::SeqCst);
    let begun = Instant::now();
    let known = (0..10).map(|_| app.get(tile));
    let paths: Vec<String> = (0..3)
        .map(|x| format!("/tiles/flux/map/2/{x}/0.png"))
        .collect();
    let unknown = paths.iter().map(|path| app.get(path));
    let (known, unknown) = tokio::join!(
        futures::future::join_all(known),
        futures::future::join_all(unknown)
    );
    let took = begun.elapsed();
    assert!(took < Duration::from_secs(40), "{took:?}");
    println!("a crowd was answered within {took:?}");
    assert!(
        bucket.unanswered.load(Ordering::SeqCst) > 0,
        "the fault took place"
    );
    for answer in known {
        assert_eq!((answer.status, &answer.body), (StatusCode::OK, &first.body));
    }
    for answer in unknown {
        assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
        assert!(!answer.header("retry-after").is_empty());
        assert!(answer.reason().contains("store"), "{}", answer.reason());
    }
    bucket.is_silent.store(false, Ordering::SeqCst);
    app.drawer.is_slow.store(false, Ordering::SeqCst);
    assert_eq!(app.get(&paths[0]).await.status, StatusCode::OK);
}

#[tokio::test]
async fn a_crowd_that_comes_while_nothing_is_known_waits_for_one_failure_only() {
    let (bucket, store) = remote().await;
    bucket.is_silent.store(true, Ordering::SeqCst);
    let app = TestApp::over(store, |_settings| {});
    let begun = Instant::now();
    let crowd = (0..20).map(|_| app.get("/tiles/flux/map/0/0/0.png"));
    for answer in futures::future::join_all(crowd).await {
        assert_eq!(answer.status, StatusCode::SERVICE_UNAVAILABLE);
        assert!(!answer.header("retry-after").is_empty());
    }
    let took = begun.elapsed();
    assert!(took < Duration::from_secs(30), "{took:?}");
    assert_eq!(
        bucket.unanswered.load(Ordering::SeqCst),
        1,
        "asked once for all"
    );
}

#[tokio::test]
async fn a_picture_that_was_never_drawn_is_one_look_up_and_one_write() {
    let (bucket, store) = remote().await;
    let app = TestApp::over(store, |_settings| {});
    app.land("flux", Quantity::CarbonFlux, 1).await;
    let tile = "/tiles/flux/map/0/0/0.png";
    assert_eq!(app.get(tile).await.status, StatusCode::OK);
    let of_pictures = || -> Vec<Method> {
        let requests = bucket.requests.lock().unwrap();
        let pictures = requests.iter().filter(|(_, key)| key.starts_with("tiles/"));
        pictures.map(|(method, _)| method.clone()).collect()
    };
    assert_eq!(of_pictures(), [Method::GET, Method::PUT]);
    assert_eq!(app.get(tile).await.status, StatusCode::OK);
    assert_eq!(of_pictures().len(), 2, "in memory");
    // What was not to be stored is looked for again, and nothing else.
    app.drawer.stores_nothing.store(true, Ordering::SeqCst);
    let other = "/tiles/flux/map/1/0/0.png";
    assert_eq!(app.get(other).await.status, StatusCode::OK);
    assert_eq!(of_pictures()[2..], [Method::GET], "who draws is who writes");
}

#[tokio::test]
async fn a_store_that_fails_while_a_cube_is_read_is_away_and_no_fault_of_ours() {
    let (bucket, store) = remote().await;
    let app = TestApp::over(store, |_settings| {});
    app.land("flux", Quantity::CarbonFlux, 1).await;
    let (group, chunk) = ("/zarr/flux@1/zarr.json", "/zarr/flux@1/carbon_flux/c/0/0/0");
    // While it is opened, and when it is open.
    for path in [group, chunk] {
        bucket.cubes_fail.store(true, Ordering::SeqCst);
        let failed = app.get(path).await;
        assert_eq!(failed.status, StatusCode::SERVICE_UNAVAILABLE, "{path}");
        assert!(!failed.header("retry-after").is_empty(), "{path}");
        assert!(failed.reason().contains("store"), "{}", failed.reason());
        bucket.cubes_fail.store(false, Ordering::SeqCst);
        let answer = app.get(path).await;
        assert_eq!(answer.status, StatusCode::OK, "{path}: {}", answer.text());
        // It is forgotten with a failure, and has to be open for the next.
        assert_eq!(app.get(group).await.status, StatusCode::OK);
    }
}
