//! `/globe/{product}/{mode}.png`.

use axum::http::StatusCode;
use contract::base_map::{Background, BaseMap};
use contract::camera::CameraAngles;
use contract::grid::LonLatDeg;
use contract::job::{Mode, View};
use contract::look_at::LookAt;
use contract::picture::PictureOptions;
use contract::quantity::Quantity;

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
            height_px: 360,
            angles: CameraAngles::NADIR,
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

#[tokio::test]
async fn a_globe_has_its_map_unless_told_otherwise_and_a_tile_has_none() {
    let app = TestApp::new().await;
    let context = async |path: &str| {
        let answer = app.get(path).await;
        assert_eq!(answer.status, StatusCode::OK, "{path}: {}", answer.text());
        app.drawer.last_job().style.context
    };
    // What the command line asks for is the same function of the same words.
    let usual = PictureOptions {
        globe_surface: true,
        ..PictureOptions::default()
    };
    let time = "2000-02-03".parse().unwrap();
    let usual = usual.style(Quantity::CarbonFlux, Mode::Volume, time);
    let globe = context("/globe/flux/volume.png").await;
    assert_eq!(globe, usual.unwrap().context);
    assert!(globe.coastlines && globe.borders && globe.sea_floor);
    assert!(context("/tiles/flux/volume/0/0/0.png").await.is_empty());
    assert!(
        context("/globe/flux/volume.png?surface=false")
            .await
            .is_empty()
    );
    let bare = "/globe/flux/volume.png?coastlines=false&borders=true&sea_floor=false";
    let bare = context(bare).await;
    assert!(!bare.coastlines && bare.borders && !bare.sea_floor);
    for name in ["mask_land", "mask-land"] {
        let masked = context(&format!("/globe/flux/map.png?{name}=true")).await;
        assert!(masked.mask_land && !globe.mask_land);
    }
    for name in ["base_map", "base-map"] {
        let light = format!("/globe/flux/volume.png?{name}=light&background=sky");
        let light = context(&light).await;
        assert_eq!(
            (light.base_map, light.background),
            (BaseMap::Light, Background::Sky)
        );
    }
    for (query, reason) in [
        ("borders=1", "true or false"),
        ("sea_floor=", "true or false"),
        ("mask_land=true", "thematic maps"),
        ("base_map=grey", "dark or light"),
        ("background=stars", "none or sky"),
        ("background=sky&surface=false", "draw the globe"),
    ] {
        let answer = app.get(&format!("/globe/flux/volume.png?{query}")).await;
        assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{query}");
        assert!(
            answer.reason().contains(reason),
            "{query}: {}",
            answer.reason()
        );
    }
}

#[tokio::test]
async fn a_camera_is_turned_and_looks_at_a_place() {
    let app = TestApp::new().await;
    let turned = "heading=-30&tilt=50&roll=5&fov=60";
    let angles = CameraAngles {
        heading_deg: -30.0,
        tilt_deg: 50.0,
        roll_deg: 5.0,
        field_of_view_deg: 60.0,
    };
    app.get(&format!("/globe/flux/volume.png?lat=10&{turned}"))
        .await;
    let View::Globe {
        lat_deg,
        angles: own,
        ..
    } = app.drawer.last_job().view
    else {
        panic!("a globe")
    };
    assert_eq!((lat_deg, own), (10.0, angles));
    let path = format!("/globe/flux/volume.png?look_at=-95,0&distance_km=3000&{turned}");
    assert_eq!(app.get(&path).await.status, StatusCode::OK);
    let look_at = LookAt {
        target: LonLatDeg {
            lon: -95.0,
            lat: 0.0,
        },
        distance_m: 3e6,
        angles,
    };
    assert_eq!(
        app.drawer.last_job().view,
        look_at.view([512, 512]).unwrap()
    );
}

#[tokio::test]
async fn a_camera_that_cannot_be_is_refused_with_what_can() {
    let app = TestApp::new().await;
    for (query, said) in [
        ("fov=0", "1 to 120"),
        ("fov=180", "1 to 120"),
        ("tilt=80", "the earth is seen with a tilt of 0 to"),
        ("tilt=-1", "0 to 180"),
        ("height_km=0.5", "1 km"),
        ("height_km=-1500", "1000 km below"),
        ("heading=nan", "-360 to 360"),
        ("look_at=5", "LON,LAT"),
        ("look_at=0,91", "-90 to 90"),
        ("look_at=0,0&lon=3", "either"),
        ("look_at=0,0&tilt=95", "0 to 90"),
        ("distance_km=5", "only with look_at"),
        ("width=100000&height=1000", "1 to 7680"),
        ("width=7680&height=4321", "as many pixels as 7680 x 4320"),
    ] {
        let answer = app.get(&format!("/globe/flux/volume.png?{query}")).await;
        assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{query}");
        assert!(answer.text().contains(said), "{query}: {}", answer.text());
    }
}
