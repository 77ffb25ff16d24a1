//! Stores of others behind HTTP: read by known names, and what a server can do wrong.

use std::path::PathBuf;

use contract::kind::Vouched;
use contract::manifest::Manifest;
use ingest::attach::{Request, refresh};
use serde_json::json;
use storage::{Store, fields};

use crate::attached::{Own, assert_same, expected, fixture, readable, request};
use crate::fixture::{Place, SmallFile};
use crate::web_server::{Answer, WebServer};

/// Serves the files of a folder under `/data/`; what is not there is 404.
async fn serve(folder: PathBuf) -> WebServer {
    WebServer::start(Box::new(move |path| {
        let name = path.trim_start_matches("/data/");
        match std::fs::read(folder.join(name)) {
            Ok(content) => Answer::Whole("200 OK", vec![], content),
            Err(_) => Answer::Whole("404 Not Found", vec![], vec![]),
        }
    }))
    .await
}

fn address(server: &WebServer) -> String {
    format!("http://{}/data", server.address)
}

#[tokio::test]
async fn stores_are_read_over_http_with_and_without_consolidated_metadata() {
    for name in [
        "v2-blosc.zarr",
        "v2-plain.zarr",
        "v3-zstd.zarr",
        "v3-gzip.zarr",
        "v3-sharded.zarr",
    ] {
        let server = serve(fixture(name)).await;
        let own = Own::new();
        let attached = own.ask(&request(&address(&server), "sst")).await.unwrap();
        assert_eq!(attached.steps, 3, "{name}");
        let newest = own.newest().await;
        for (step, expected) in expected(name).iter().enumerate() {
            let values = own.values(&newest, step).await.unwrap();
            assert_same(&values, expected, &format!("{name} step {step}"));
        }
    }
}

fn digests(version: &Manifest) -> Vec<Vouched> {
    let fields = version.steps.iter().map(|step| step.field.vouches());
    fields.collect()
}

/// Our own cube is a repository like any other. Nothing of it is listed: its state names all that is in it.
#[tokio::test]
async fn a_repository_is_read_over_http_in_the_state_that_it_had() {
    let mut place = Place::new();
    place.store = Store::open(place.path("data").to_str().unwrap()).unwrap();
    let file = place.path("a.nc");
    SmallFile::new().write_classic(&file);
    place.land(&[file]).await;
    let landed = place.newest("fgco2").await;
    let server = serve(place.path("data/cubes/fgco2")).await;
    let own = Own::new();
    let request = Request {
        product: Some("sst".parse().unwrap()),
        ..request(&address(&server), "carbon_flux")
    };
    let attached = own.ask(&request).await.unwrap();
    assert!(attached.snapshot.is_some(), "{attached:?}");
    let first = own.newest().await;
    assert_eq!(digests(&first), digests(&landed));
    for step in 0..first.steps.len() {
        let values = own.values(&first, step).await.unwrap();
        assert_same(&values, &place.values(&landed, step).await, "over HTTP");
    }
    // The branch moves: what was attached is what it was, and of what is only longer the new steps alone are read.
    let later = SmallFile {
        time_unit: Some("days since 2001-03-01"),
        ..SmallFile::new()
    };
    later.write_classic(&place.path("b.nc"));
    place.land(&[place.path("b.nc")]).await;
    let fresh = readable(&own.store.bare());
    let still = fields::read(&fresh, &first.steps[0].field, &first.grid).await;
    assert_same(&still.unwrap(), &place.values(&landed, 0).await, "pinned");
    let product = "sst".parse().unwrap();
    let next = refresh(&own.store, &product, &|_, _| ()).await.unwrap();
    assert_eq!((next.steps, next.read, next.version.number), (4, 2, 2));
    let landed = place.newest("fgco2").await;
    assert_eq!(digests(&own.newest().await), digests(&landed));
    // What was lost there is an error that names it: here all that says where chunks lie.
    std::fs::remove_dir_all(place.path("data/cubes/fgco2/manifests")).unwrap();
    let fresh = readable(&own.store.bare());
    let read = fields::read(&fresh, &first.steps[0].field, &first.grid).await;
    let error = read.unwrap_err().to_string();
    for part in [&server.address.to_string()[..], "array carbon_flux"] {
        assert!(error.contains(part), "{part}: {error}");
    }
}

#[tokio::test]
async fn what_a_server_answers_wrong_is_refused() {
    let own = Own::with("v3-gzip.zarr");
    let folder = own.path();
    let answers = move |path: &str| {
        let (way, name) = path.trim_start_matches('/').split_once('/').unwrap();
        let whole = || std::fs::read(folder.join(name)).ok();
        let is_chunk = name.contains("sst/c/");
        match (way, whole()) {
            ("closed", _) => Answer::Whole("403 Forbidden", vec![], vec![]),
            ("inner", _) => {
                let location = "Location: http://169.254.169.254/latest".to_owned();
                Answer::Whole("302 Found", vec![location], vec![])
            }
            ("half", Some(content)) if is_chunk => Answer::Half(content),
            ("other", Some(content)) if is_chunk => {
                let part = vec!["content-range: bytes 1-10/99999".to_owned()];
                Answer::Whole("206 Partial Content", part, content[..10].to_vec())
            }
            // One that was never written would be no data here.
            ("gone", Some(_)) if is_chunk => Answer::Whole("410 Gone", vec![], vec![]),
            // Nothing says beforehand how long it is.
            ("endless", Some(_)) if name == "zarr.json" => {
                let spaces = vec![b' '; 17 << 20];
                let mut body = format!("{:x}\r\n", spaces.len()).into_bytes();
                body.extend([&spaces[..], b"\r\n0\r\n\r\n"].concat());
                let chunked = vec!["transfer-encoding: chunked".to_owned()];
                Answer::Whole("200 OK", chunked, body)
            }
            ("huge", Some(content)) if name == "zarr.json" => {
                let mut content = content;
                content.resize(17 << 20, b' ');
                Answer::Whole("200 OK", vec![], content)
            }
            (_, Some(content)) => Answer::Whole("200 OK", vec![], content),
            (_, None) => Answer::Whole("404 Not Found", vec![], vec![]),
        }
    };
    let server = WebServer::start(Box::new(answers)).await;
    for (way, said) in [
        ("closed", "403 Forbidden"),
        (
            "inner",
            "leads to 169.254.169.254, which is no address of the public network",
        ),
        ("huge", "17825792 bytes, at most 16777216 are read"),
        ("endless", "at most 16777216 are read"),
        ("half", "sst/c/0/0/0"),
        ("other", "answered bytes 1-10/99999 with 10 bytes"),
        ("gone", "410 Gone: it was there and was taken away"),
    ] {
        let address = format!("http://{}/{way}", server.address);
        let error = own.ask(&request(&address, "sst")).await.unwrap_err();
        assert!(error.contains(said), "{way}: {error}");
        assert!(!error.contains("--allow-host"), "{error}");
    }
    for (address, said) in [
        ("http://user:secret@127.0.0.1/x", "name or a password"),
        ("https://127.0.0.1/x?token=secret", "behind ? or #"),
        ("ftp://127.0.0.1/x", "http: or https:"),
    ] {
        let error = own.ask(&request(address, "sst")).await.unwrap_err();
        assert!(error.contains(said) && !error.contains("secret"), "{error}");
    }
}

#[tokio::test]
async fn what_changed_behind_http_is_an_error_that_names_it() {
    let own = Own::with("v2-plain.zarr");
    own.edit(".zattrs", |it| it["title"] = json!("over HTTP"));
    let server = serve(own.path()).await;
    own.ask(&request(&address(&server), "sst")).await.unwrap();
    let newest = own.newest().await;
    std::fs::copy(own.path().join("sst/0.0.0"), own.path().join("sst/1.0.0")).unwrap();
    let later = readable(&own.store.bare());
    let error = fields::read(&later, &newest.steps[1].field, &newest.grid)
        .await
        .unwrap_err();
    assert!(!error.is_retryable(), "{error}");
    assert!(error.to_string().contains("/data array sst"), "{error}");
    assert!(
        error
            .to_string()
            .contains("has changed since it was attached"),
        "{error}"
    );
}
