//! Products by keys of Zarr: as they lie in the store, each version for itself, whole or in parts.

use std::ops::Range;
use std::sync::Arc;

use async_trait::async_trait;
use axum::body::{Body, to_bytes};
use axum::http::{Request, StatusCode, header};
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::quantity::{Flag, OpenQuantity, OpenWords, Quantity};
use contract::time::Period;
use serde_json::{Value, json};
use storage::attached::{Attachment, Failure, Reference, Source, StoreKind};
use storage::{Store, domain, fields, manifests};
use tower::ServiceExt as _;

use crate::app::{GRID, TestApp};

#[tokio::test]
async fn the_group_describes_all_arrays_and_their_chunks_are_there() {
    let app = TestApp::new().await;
    let answer = app.get("/zarr/flux/zarr.json").await;
    assert_eq!(answer.status, StatusCode::OK);
    let group: Value = serde_json::from_slice(&answer.body).unwrap();
    let id = group["attributes"]["id"].as_str().unwrap();
    let arrays = group["consolidated_metadata"]["metadata"]
        .as_object()
        .unwrap();
    assert!(arrays.len() > 7, "{arrays:?}");
    for (name, metadata) in arrays {
        let own = app.get(&format!("/zarr/flux/{name}/zarr.json")).await;
        assert_eq!(own.json(), *metadata, "{name}");
    }
    for key in [
        "carbon_flux/c/0/0/0",
        "time/c/0",
        "time_bnds/c/0/0",
        "lat/c/0",
    ] {
        let whole = app.get(&format!("/zarr/flux/{key}")).await;
        assert_eq!(whole.status, StatusCode::OK, "{key}");
        let sum = crc32c(&whole.body[..whole.body.len() - 4]);
        assert_eq!(
            whole.body[whole.body.len() - 4..],
            sum.to_le_bytes(),
            "{key}"
        );
        let pinned = app.get(&format!("/zarr/{id}/{key}")).await;
        assert_eq!(pinned.body, whole.body);
    }
}

/// The checksum that chunks end in, bit by bit (RFC 3720, B.4).
fn crc32c(bytes: &[u8]) -> u32 {
    let step = |sum: u32, byte: &u8| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _bit| {
            (sum >> 1) ^ if sum & 1 == 1 { 0x82F6_3B78 } else { 0 }
        })
    };
    !bytes.iter().fold(!0, step)
}

#[tokio::test]
async fn what_there_is_not_is_not_found() {
    let app = TestApp::new().await;
    for (key, said) in [
        ("flux/.zgroup", "nothing at this address"),
        ("flux/.zmetadata", "nothing at this address"),
        ("flux/nothing/zarr.json", "nothing at this address"),
        ("flux/carbon_flux/c/999/0/0", "nothing at this address"),
        ("flux/carbon_flux/c/0/0", "nothing at this address"),
        ("flux/carbon_flux/c/x/0/0", "nothing at this address"),
        ("flux/../repo", "nothing at this address"),
        ("flux/carbon_flux", "nothing at this address"),
        ("flux/c", "nothing at this address"),
        ("flux/c/0/0/0", "nothing at this address"),
        ("flux/c/c/c/0", "nothing at this address"),
        ("flux/timec/0", "nothing at this address"),
        ("flux//zarr.json", "nothing at this address"),
        ("flux/time//zarr.json", "nothing at this address"),
        ("flux/time/%2E/zarr.json", "nothing at this address"),
        ("flux/time/%2E/c/0", "nothing at this address"),
        ("flux/time/c/+0", "nothing at this address"),
        ("flux/time/c/00", "nothing at this address"),
        ("nothing/zarr.json", "no product"),
        ("flux@99/zarr.json", "no version"),
        ("flux@x/zarr.json", "no version"),
        ("flux@01/zarr.json", "no version"),
        ("flux@+1/zarr.json", "no version"),
        ("flux@1-00000000/zarr.json", "no version"),
    ] {
        let answer = app.get(&format!("/zarr/{key}")).await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND, "{key}");
        let text = String::from_utf8_lossy(&answer.body).into_owned();
        assert!(text.contains(said), "{key}: {text}");
    }
}

#[tokio::test]
async fn parts_are_those_of_the_whole_and_copies_are_known_again() {
    let app = TestApp::new().await;
    let path = "/zarr/flux@1/carbon_flux/c/0/0/0";
    let whole = app.get_with(path, &[("accept-encoding", "gzip")]).await;
    assert_eq!(whole.headers.get(header::CONTENT_ENCODING), None);
    let length = whole.body.len();
    for (range, part) in [
        ("bytes=0-9", 0..10),
        ("bytes=5-", 5..length),
        ("bytes=-4", length - 4..length),
    ] {
        let answer = app.get_with(path, &[("range", range)]).await;
        assert_eq!(answer.status, StatusCode::PARTIAL_CONTENT);
        assert_eq!(answer.body, whole.body[part.clone()], "{range}");
        let place = format!("bytes {}-{}/{length}", part.start, part.end - 1);
        assert_eq!(answer.headers[header::CONTENT_RANGE], place.as_str());
    }
    let metadata = app.get("/zarr/flux/zarr.json").await;
    let answer = app
        .get_with("/zarr/flux/zarr.json", &[("range", "bytes=2-7")])
        .await;
    assert_eq!(answer.body, metadata.body[2..8]);
    let beyond = format!("bytes={length}-");
    let beyond = app.get_with(path, &[("range", &beyond)]).await;
    assert_eq!(beyond.status, StatusCode::RANGE_NOT_SATISFIABLE);
    let all = format!("bytes */{}", whole.body.len());
    assert_eq!(beyond.header("content-range"), all);
    let tag = whole.headers[header::ETAG].to_str().unwrap();
    let again = app.get_with(path, &[("if-none-match", tag)]).await;
    assert_eq!(
        (again.status, again.body.len()),
        (StatusCode::NOT_MODIFIED, 0)
    );
    let any = app.get_with(path, &[("if-none-match", "*")]).await;
    assert_eq!(any.status, StatusCode::NOT_MODIFIED);
    // HEAD is told of all of it, whatever part it asks for.
    let head = Request::head(path).header(header::RANGE, "bytes=0-9");
    let head = app.send(head.body(Body::empty()).unwrap()).await;
    assert_eq!(
        (head.status, head.header("content-length")),
        (StatusCode::OK, length.to_string().as_str())
    );
    assert_eq!(head.header("content-range"), "");
    // Who has a part of it wants the rest, or all of what came since.
    for (tag, status) in [
        (tag, StatusCode::PARTIAL_CONTENT),
        ("\"another\"", StatusCode::OK),
    ] {
        let headers = [("range", "bytes=5-"), ("if-range", tag)];
        let answer = app.get_with(path, &headers).await;
        assert_eq!(answer.status, status, "{tag}");
        let start = if status == StatusCode::OK { 0 } else { 5 };
        assert_eq!(answer.body, whole.body[start..], "{tag}");
    }
    // Nobody has a right copy of what is not there.
    let nothing = path.replace("carbon_flux", "nothing");
    let nothing = app.get_with(&nothing, &[("if-none-match", tag)]).await;
    assert_eq!(nothing.status, StatusCode::NOT_FOUND);
    let cached = |answer: &crate::app::Answer| answer.headers[header::CACHE_CONTROL].clone();
    assert!(cached(&whole).to_str().unwrap().contains("immutable"));
    assert!(!cached(&metadata).to_str().unwrap().contains("immutable"));
}

#[tokio::test]
async fn version_2_has_the_same_chunks_without_their_checksums_and_whole_metadata() {
    let app = TestApp::new().await;
    let answer = app.get("/zarr2/flux/.zmetadata").await;
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    let all = answer.json()["metadata"].clone();
    for key in [".zgroup", ".zattrs", "carbon_flux/.zarray", "time/.zattrs"] {
        let own = app.get(&format!("/zarr2/flux/{key}")).await;
        assert_eq!(own.json(), all[key], "{key}");
    }
    for (of_2, of_3) in [
        ("carbon_flux/0.0.0", "carbon_flux/c/0/0/0"),
        ("time/0", "time/c/0"),
    ] {
        let path = format!("/zarr2/flux@1/{of_2}");
        let whole = app.get(&path).await;
        let stored = app.get(&format!("/zarr/flux@1/{of_3}")).await;
        assert_eq!(whole.body, stored.body[..stored.body.len() - 4], "{of_2}");
        assert_eq!(whole.headers[header::ETAG], stored.headers[header::ETAG]);
        let part = app.get_with(&path, &[("range", "bytes=3-9")]).await;
        assert_eq!(part.status, StatusCode::PARTIAL_CONTENT);
        assert_eq!(part.body, whole.body[3..10]);
        let beyond = format!("bytes={}-", whole.body.len());
        let beyond = app.get_with(&path, &[("range", &beyond)]).await;
        assert_eq!(beyond.status, StatusCode::RANGE_NOT_SATISFIABLE);
    }
    for none in [
        "flux/zarr.json",
        "flux/carbon_flux/c/0/0/0",
        "flux/carbon_flux/9.0.0",
        "flux/../repo",
        "flux@9/.zgroup",
        "no/.zgroup",
    ] {
        let answer = app.get(&format!("/zarr2/{none}")).await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND, "{none}");
    }
}

#[tokio::test]
async fn pages_of_other_origins_may_ask_for_parts_and_are_told_which_they_have() {
    let app = TestApp::new().await;
    let path = "/zarr/flux@1/carbon_flux/c/0/0/0";
    let request = Request::builder()
        .method("OPTIONS")
        .uri(path)
        .header("origin", "http://map.example")
        .header("access-control-request-method", "GET")
        .header("access-control-request-headers", "if-range,range");
    let answer = app.send(request.body(Body::empty()).unwrap()).await;
    let allowed = answer.header("access-control-allow-headers");
    let allowed: Vec<&str> = allowed.split(',').map(str::trim).collect();
    for name in ["range", "if-range", "if-none-match"] {
        assert!(allowed.contains(&name), "{name}: {allowed:?}");
    }
    let headers = [("origin", "http://map.example"), ("range", "bytes=-4")];
    let answer = app.get_with(path, &headers).await;
    assert_eq!(answer.status, StatusCode::PARTIAL_CONTENT);
    let exposed = answer.header("access-control-expose-headers");
    for name in ["content-range", "etag"] {
        assert!(exposed.contains(name), "{name}: {exposed}");
    }
}

#[tokio::test]
async fn what_nobody_takes_counts_as_held_until_it_is_gone() {
    let app = TestApp::new().await;
    let path = "/zarr/flux@1/carbon_flux/c/0/0/0";
    let held = async || app.metric("fluxglobe_tile_server_zarr_bytes").await;
    let ask = async |range: Option<&str>| {
        let mut request = Request::builder().uri(path);
        if let Some(range) = range {
            request = request.header(header::RANGE, range);
        }
        let request = request.body(Body::empty()).unwrap();
        app.router.clone().oneshot(request).await.unwrap()
    };
    let length = app.get(path).await.body.len() as u64;
    assert_eq!(held().await, 0);
    let whole = ask(None).await;
    assert_eq!(whole.status(), StatusCode::OK);
    assert_eq!(held().await, length);
    let part = ask(Some("bytes=0-9")).await;
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(held().await, length + 10);
    drop(whole);
    assert_eq!(held().await, 10);
    let taken = to_bytes(part.into_body(), 64).await.unwrap();
    assert_eq!(taken.len(), 10);
    drop(taken);
    assert_eq!(held().await, 0);
}

#[tokio::test]
async fn a_version_stays_what_it_is_and_the_newest_becomes_another() {
    let app = TestApp::new().await;
    let path = |version: &str| format!("/zarr/flux{version}/carbon_flux/c/0/0/0");
    let first = app.get(&path("")).await;
    let id = app.land("flux", Quantity::CarbonFlux, 2).await;
    let second = app.get(&path("")).await;
    assert_ne!(second.body, first.body);
    assert_ne!(second.headers[header::ETAG], first.headers[header::ETAG]);
    assert_eq!(app.get(&path("@1")).await.body, first.body);
    assert_eq!(app.get(&path("@2")).await.body, second.body);
    let digest = id.to_string();
    let digest = digest.strip_prefix("flux").unwrap();
    assert_eq!(app.get(&path(digest)).await.body, second.body);
}

#[tokio::test]
async fn a_number_that_another_version_has_now_is_not_answered_with_the_old_one() {
    let app = TestApp::new().await;
    app.land("flux", Quantity::CarbonFlux, 2).await;
    let taken = ObjectKey::manifest(&"flux".parse().unwrap(), 2);
    app.store.remove(&taken).await.unwrap();
    let (quantity, number) = (Quantity::CarbonFlux, 2);
    app.land_last_month("flux", quantity, number, None).await;
    let answer = app.get("/zarr/flux@2/zarr.json").await;
    assert_eq!(answer.status, StatusCode::NOT_FOUND, "{}", answer.text());
    let answer = app.get("/zarr/flux@1/zarr.json").await;
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
}

/// A store of others that nobody needs to read.
#[derive(Debug)]
struct Theirs;

#[async_trait]
impl Source for Theirs {
    async fn values(
        &self,
        _attachment: &Arc<Attachment>,
        _reference: &Reference,
        _rows: Range<u32>,
    ) -> Result<Vec<f32>, Failure> {
        Ok(vec![290.0; GRID.cell_count()])
    }
}

/// Publishes a product whose one step lies in a store of others.
async fn attached(store: &Store, product: &str, place: &str) {
    let (product, period) = (product.parse().unwrap(), Period::month(2000, 1).unwrap());
    let values = vec![290.0; GRID.cell_count()];
    let there = (place.to_owned(), StoreKind::Zarr3, None);
    let attachment = Attachment::new(product, there, "sst".to_owned(), Value::Null);
    let name = store.put_attachment(&attachment).await.unwrap();
    let shape = [GRID.rows, GRID.cols];
    let reference = Reference::new(name, (0, period), shape, [1.0, 0.0]);
    let digest: Digest = fields::digest_of(&GRID, &values, period);
    let product = attachment.product;
    let field = store.put_reference(&product, &digest, &reference).await;
    let known = vec![true; GRID.cell_count()];
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        number: 1,
        title: "Theirs".to_owned(),
        quantity: Quantity::SeaSurfaceTemperature,
        synthetic: false,
        source: "Others".to_owned(),
        grid: GRID,
        steps: vec![Step {
            masked: None,
            period,
            field: field.unwrap(),
            raw_sha256: name,
            origin: place.to_owned(),
            valid_cells: GRID.cell_count() as u64,
            contributed: None,
        }],
        domain: domain::write(store, &product, &known).await.unwrap(),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
        product,
    };
    manifests::commit(store, &manifest).await.unwrap();
}

#[tokio::test]
async fn of_an_attached_product_it_is_told_where_it_lies_unless_that_is_a_folder() {
    let store = Store::memory().with_attached(Arc::new(Theirs));
    attached(&store, "open", "s3://theirs/sst.zarr").await;
    attached(&store, "closed", "/srv/secret/sst.zarr").await;
    let app = TestApp::over(store, |_settings| {});
    for name in ["open", "open@1"] {
        let answer = app.get(&format!("/zarr/{name}/zarr.json")).await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND, "{name}");
        assert!(
            answer.reason().contains("s3://theirs/sst.zarr"),
            "{}",
            answer.reason()
        );
    }
    let answer = app.get("/zarr/closed/zarr.json").await;
    assert_eq!(answer.status, StatusCode::NOT_FOUND);
    let reason = answer.reason();
    assert!(
        reason.contains("not given out") && !reason.contains("secret"),
        "{reason}"
    );
}

#[tokio::test]
async fn a_cube_that_was_made_again_is_opened_again() {
    let app = TestApp::new().await;
    let path = "/zarr/flux@1/carbon_flux/c/0/0/0";
    // Opened, and nothing of it read.
    let before = app.get("/zarr/flux@1/zarr.json").await;
    assert_eq!(before.status, StatusCode::OK);
    let newest = manifests::latest(&app.store, &"flux".parse().unwrap()).await;
    let newest = newest.unwrap().unwrap();
    for key in app.store.list("cubes/flux").await.unwrap() {
        app.store.remove(&key).await.unwrap();
    }
    let failed = app.get(path).await;
    assert_eq!(failed.status, StatusCode::INTERNAL_SERVER_ERROR);
    cube::keep_up(&app.store, &newest).await;
    let answer = app.get(path).await;
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    assert_ne!(answer.headers[header::ETAG], before.headers[header::ETAG]);
}

#[tokio::test]
async fn a_mask_says_what_its_codes_mean_as_cf_has_it() {
    let app = TestApp::new().await;
    let plain = Quantity::open("basin", "1", "Basin").unwrap();
    app.land("basins", plain, 1).await;
    let flag = |value, meaning: &str| Flag {
        value,
        meaning: meaning.to_owned(),
    };
    let Quantity::Open(open) = plain else {
        panic!("{plain:?} is built in")
    };
    let words = OpenWords {
        flags: vec![flag(5, "southern"), flag(12, "arctic")],
        ..open.words().clone()
    };
    let told = Quantity::Open(OpenQuantity::new(words).unwrap());
    let attributes = async |version: &str| -> Value {
        let path = format!("/zarr/basins{version}/basin/zarr.json");
        let answer = app.get(&path).await;
        assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
        answer.json()["attributes"].clone()
    };
    assert!(attributes("").await.get("flag_values").is_none());
    // Told by a later version of the same steps.
    app.land("basins", told, 2).await;
    for version in ["", "@2"] {
        let own = attributes(version).await;
        assert_eq!(own["flag_values"], json!([5.0, 12.0]));
        assert_eq!(own["flag_meanings"], "southern arctic");
    }
    assert!(attributes("@1").await.get("flag_values").is_none());
    let products = app.get("/api/products").await.json();
    let all = products["products"].as_array().unwrap();
    let listed = all.iter().find(|one| one["product"] == "basins").unwrap();
    let flags = json!([{"value": 5, "meaning": "southern"}, {"value": 12, "meaning": "arctic"}]);
    assert_eq!(listed["quantity"]["flags"], flags);
}
