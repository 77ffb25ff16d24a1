//! `/globe/{product}/{mode}.png`.

use axum::http::StatusCode;
use contract::job::View;

use crate::app::TestApp;

#[tokio::test]
async fn a_view_is_the_picture_of_the_job_its_address_means() {
    let app = TestApp::new().await;
    let path = "/globe/flux/volume.png?lon=200&lat=-12.5&height_km=9000&time=2000-02-03&width=640&height=360";
    let answer = app.get(path).await;
    assert_eq!(
        (answer.status, answer.header("content-type")),
        (StatusCode::OK, "image/png")
    );
    let job = app.drawer.last_job();
    let [lon_deg, lat_deg, height_m] = [-160.0, -12.5, 9e6];
    assert_eq!(
        job.view,
        View::Globe {
            lon_deg,
            lat_deg,
            height_m,
            width_px: 640,
            height_px: 360
        }
    );
    assert_eq!(job.value, app.time_sample("flux", "2000-02-03").await);
    assert!(job.style.globe_surface);
    assert_eq!(answer.header("etag"), format!("\"{}\"", job.digest()));
}

#[tokio::test]
async fn everything_has_a_default() {
    let app = TestApp::new().await;
    assert_eq!(
        app.get("/globe/sst/points.png").await.status,
        StatusCode::OK
    );
    assert_eq!(app.drawer.last_job().view.size_px(), [512, 512]);
}

#[tokio::test]
async fn particles_can_be_drawn_without_a_globe_behind_them() {
    let app = TestApp::new().await;
    app.get("/globe/flux/volume.png?surface=false").await;
    assert!(!app.drawer.last_job().style.globe_surface);
}
