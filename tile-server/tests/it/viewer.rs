//! The viewer's files.

use axum::body::Body;
use axum::http::{Request, StatusCode, header};

use crate::app::TestApp;

async fn with_viewer() -> (tempfile::TempDir, TestApp) {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("dist");
    for (name, content) in [
        ("index.html", "<title>Fluxglobe</title>"),
        ("favicon.svg", "<svg/>"),
        ("assets/index-abc123.js", "console.log(1)"),
        ("cesium/Workers/w.js", "self"),
    ] {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }
    std::fs::write(root.path().join("secret.txt"), "secret").unwrap();
    let app = TestApp::with(|settings| settings.viewer = Some(folder)).await;
    (root, app)
}

#[tokio::test]
async fn the_page_is_asked_for_anew_and_hashed_files_are_kept() {
    let (_folder, app) = with_viewer().await;
    for (path, cache_control) in [
        ("/", "no-cache"),
        ("/index.html", "no-cache"),
        ("/favicon.svg", "no-cache"),
        (
            "/assets/index-abc123.js",
            "public, max-age=31536000, immutable",
        ),
        ("/cesium/Workers/w.js", "public, max-age=3600"),
    ] {
        let answer = app.get(path).await;
        assert_eq!(answer.status, StatusCode::OK, "{path}");
        assert_eq!(answer.header("cache-control"), cache_control, "{path}");
    }
    assert!(
        app.get("/")
            .await
            .text()
            .contains("<title>Fluxglobe</title>")
    );
    assert!(
        app.get("/")
            .await
            .header("content-type")
            .starts_with("text/html")
    );
}

#[tokio::test]
async fn the_page_may_load_from_here_only() {
    let (_folder, app) = with_viewer().await;
    let answer = app.get("/").await;
    let policy = answer.header("content-security-policy");
    assert!(
        policy.starts_with("default-src 'self';") && policy.contains("frame-ancestors"),
        "{policy}"
    );
    assert!(
        !policy.contains("http:") && !policy.contains("https:") && !policy.contains('*'),
        "{policy}"
    );
    assert!(!policy.contains("'unsafe-eval'"), "{policy}");
    assert_eq!(answer.header("x-content-type-options"), "nosniff");
    assert_eq!(answer.header("referrer-policy"), "no-referrer");
}

#[tokio::test]
async fn paths_that_leave_the_folder_are_nothing() {
    let (_folder, app) = with_viewer().await;
    for path in [
        "/../secret.txt",
        "/%2e%2e/secret.txt",
        "/..%2fsecret.txt",
        "/%2e%2e%2fsecret.txt",
        "/assets/../../secret.txt",
        "/assets/%2e%2e/%2e%2e/secret.txt",
        "/..%5csecret.txt",
        "/%00",
        "//etc/passwd",
        "/%2fetc/passwd",
        "/assets",
        "/assets/",
        "/index.html/x",
    ] {
        let answer = app.get(path).await;
        assert_eq!(
            answer.status,
            StatusCode::NOT_FOUND,
            "{path}: {}",
            answer.text()
        );
        assert!(!answer.text().contains("secret"), "{path}");
        assert!(!answer.reason().is_empty());
    }
}

#[tokio::test]
async fn without_a_built_viewer_a_page_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let empty = TestApp::with(|settings| settings.viewer = Some(folder.path().to_owned())).await;
    for app in [TestApp::new().await, empty] {
        let answer = app.get("/").await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND);
        assert!(answer.text().contains("The viewer has not been built"));
        assert_eq!(app.get("/assets/a.js").await.status, StatusCode::NOT_FOUND);
        assert_eq!(app.get("/api/products").await.status, StatusCode::OK);
    }
}

#[tokio::test]
async fn text_is_compressed_and_pictures_are_not() {
    let (_folder, app) = with_viewer().await;
    let asked = [("accept-encoding", "gzip")];
    let products = app.get_with("/api/products", &asked).await;
    assert_eq!(products.header("content-encoding"), "gzip");
    let plain = app.get("/api/products").await;
    assert!(products.body.len() < plain.body.len() / 2);
    // A copy that is right was compressed or not as well, which caches on the way are told.
    let tag = [("if-none-match", products.header("etag"))];
    let again = app.get_with("/api/products", &tag).await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
    for answer in [&products, &plain, &again] {
        assert_eq!(answer.header("vary"), "accept-encoding");
    }
    assert_eq!(
        app.get_with("/tiles/flux/map/0/0/0.png", &asked)
            .await
            .header("content-encoding"),
        ""
    );
}

#[tokio::test]
async fn parts_of_a_file_and_why_there_are_none_are_told_as_elsewhere() {
    let (_folder, app) = with_viewer().await;
    let part = app
        .get_with("/favicon.svg", &[("range", "bytes=1-3")])
        .await;
    assert_eq!(part.status, StatusCode::PARTIAL_CONTENT);
    assert_eq!(part.text(), "svg");
    let beyond = [("range", "bytes=6-")];
    let beyond = app.get_with("/favicon.svg", &beyond).await;
    assert_eq!(beyond.status, StatusCode::RANGE_NOT_SATISFIABLE);
    assert_eq!(beyond.header("content-range"), "bytes */6");
    assert!(beyond.reason().contains("6 bytes"), "{}", beyond.reason());
    // Several may be answered with all, and to HEAD none means anything.
    let several = [("range", "bytes=0-1,3-4")];
    let several = app.get_with("/favicon.svg", &several).await;
    assert_eq!(several.status, StatusCode::OK);
    assert_eq!(several.text(), "<svg/>");
    let head = Request::head("/favicon.svg").header(header::RANGE, "bytes=6-");
    let head = app.send(head.body(Body::empty()).unwrap()).await;
    assert_eq!(head.status, StatusCode::OK);
    let other = [("if-match", "\"another\"")];
    let other = app.get_with("/favicon.svg", &other).await;
    assert_eq!(other.status, StatusCode::PRECONDITION_FAILED);
    assert!(other.reason().contains("If-Match"), "{}", other.reason());
}

#[tokio::test]
async fn a_file_is_sent_once() {
    let (_folder, app) = with_viewer().await;
    let since = app.get("/").await.header("last-modified").to_owned();
    let again = app.get_with("/", &[("if-modified-since", &since)]).await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
}
