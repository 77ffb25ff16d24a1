//! The handle itself: addresses, and what is shown of it. What every store must do is in the conformance suite.

use super::*;
use bytes::Bytes;
use object_store::ObjectStoreExt as _;

fn keys() -> Settings {
    let of = |name: &str, value: &str| (name.to_owned(), value.to_owned());
    Settings::from_variables([
        of("AWS_ACCESS_KEY_ID", "me"),
        of("AWS_SECRET_ACCESS_KEY", "hunter2"),
    ])
}

#[test]
fn a_store_shows_where_it_is_and_nothing_else() {
    let store = Store::open_with("s3a://bucket/a/b/", &keys()).unwrap();
    assert_eq!(format!("{store:?}"), r#"Store("s3://bucket/a/b/")"#);
    let error = Store::open_with("s3://me:hunter2@bucket", &keys()).unwrap_err();
    assert!(!error.to_string().contains("hunter2"), "{error}");
}

#[test]
fn addresses_name_the_same_object_for_people_and_for_scans() {
    let key: ObjectKey = "frames/p/x.parquet".parse().unwrap();
    for (location, url, root) in [
        (
            "s3://bucket",
            "s3://bucket/frames/p/x.parquet",
            "s3://bucket/",
        ),
        (
            "s3://bucket/a/b",
            "s3://bucket/a/b/frames/p/x.parquet",
            "s3://bucket/",
        ),
        (
            "hdfs://localhost:1/a",
            "hdfs://localhost:1/a/frames/p/x.parquet",
            "hdfs://localhost:1/",
        ),
        ("memory:", "memory:///frames/p/x.parquet", "memory:///"),
    ] {
        let store = Store::open_with(location, &keys()).unwrap();
        assert_eq!(store.url_of(&key), url);
        assert_eq!(store.sql_url(&key).as_str(), url);
        assert_eq!(store.sql_root().0.as_str(), root);
        assert_eq!(
            Store::open_with(store.url(), &keys()).unwrap().url(),
            store.url()
        );
    }
}

#[tokio::test]
async fn scans_find_an_object_in_a_folder_with_an_odd_name() {
    let folder = tempfile::tempdir().unwrap();
    let odd = folder.path().join("a b%20c#d[1]é");
    let store = Store::open(odd.to_str().unwrap()).unwrap();
    let key: ObjectKey = "a/b".parse().unwrap();
    store.put_new(&key, Bytes::from("x")).await.unwrap();
    let (root_url, root) = store.sql_root();
    let url = store.sql_url(&key);
    assert!(url.as_str().starts_with(root_url.as_str()));
    let path = Path::from_url_path(url.path()).unwrap();
    assert_eq!(root.get(&path).await.unwrap().bytes().await.unwrap(), "x");
    let again = Store::open(store.url()).unwrap();
    assert!(again.exists(&key).await.unwrap());
}

#[tokio::test]
async fn a_missing_object_is_told_from_a_broken_store() {
    let missing = Store::memory().get(&"a/b".parse().unwrap()).await;
    let error = missing.unwrap_err();
    assert!(error.is_not_found() && !error.is_retryable());
}

#[tokio::test]
async fn a_folder_tells_the_file_of_an_object_unless_a_layer_is_to_see_requests() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().join("a b%20c#d").to_str().unwrap()).unwrap();
    let key: ObjectKey = "cubes/p/chunks/0123".parse().unwrap();
    store.put_new(&key, Bytes::from("x")).await.unwrap();
    let file = store.file(&key).unwrap();
    assert_eq!(std::fs::read(file).unwrap(), b"x");
    assert!(store.through(|objects| objects).file(&key).is_none());
    assert!(store.counted().0.file(&key).is_none());
    assert!(Store::memory().file(&key).is_none());
}
