//! Axes that are no latitudes and longitudes are refused with the attribute that says so; those that are must prove it.

use contract::event::RejectReason;
use ingest::{Outcome, Profile};

use crate::fixture::{Place, refusal};
use crate::made::{Made, MadeFile, Values};

async fn land(file: &MadeFile) -> Outcome {
    let place = Place::new();
    file.write(&place.path("a.nc"));
    place.land(&[place.path("a.nc")]).await.remove(0)
}

async fn assert_refused(file: &MadeFile, words: &[&str]) {
    let (reason, line) = refusal(&[land(file).await]);
    assert_eq!(reason, RejectReason::Grid, "{line}");
    for word in words {
        assert!(line.contains(word), "{word:?} is not in {line:?}");
    }
    eprintln!("{line}");
}

/// What was taken for granted when a file landed.
fn assumed(outcome: &Outcome) -> Vec<String> {
    match outcome {
        Outcome::Landed { assumptions, .. } => assumptions.clone(),
        other => panic!("{other}"),
    }
}

/// The map on other axes: `y` and `x`, with these attributes beside `axis`.
fn on_axes(
    names: [&'static str; 2],
    numbers: [&[f64]; 2],
    attributes: &[[(&'static str, &'static str); 2]],
) -> MadeFile {
    let mut file = MadeFile::sst(2);
    file.variables.retain(|v| !matches!(v.name, "lat" | "lon"));
    file.dimensions[1].0 = names[0];
    file.dimensions[2].0 = names[1];
    let file = file.but("sst", |v| Made {
        dimensions: vec!["time", names[0], names[1]],
        ..v
    });
    let axis = |at: usize| {
        let made = Made::new(
            names[at],
            &[names[at]],
            Values::Doubles(numbers[at].to_vec()),
        );
        let made = made.text("axis", ["Y", "X"][at]);
        attributes
            .iter()
            .fold(made, |made, pair| made.text(pair[at].0, pair[at].1))
    };
    let (y, x) = (axis(0), axis(1));
    file.with(y).with(x)
}

const LAT: [f64; 4] = [67.5, 22.5, -22.5, -67.5];
const LON: [f64; 8] = [-157.5, -112.5, -67.5, -22.5, 22.5, 67.5, 112.5, 157.5];

#[tokio::test]
async fn axes_in_kilometres_are_refused_with_their_unit() {
    for unit in ["km", "m", "metres"] {
        let file = on_axes(
            ["y", "x"],
            [&LAT, &LON],
            &[[("units", unit), ("units", unit)]],
        );
        assert_refused(
            &file,
            &["y: ", "units", unit, "no latitude", "regrid", "gdalwarp"],
        )
        .await;
    }
    let named = on_axes(
        ["lat", "lon"],
        [&LAT, &LON],
        &[[("units", "km"), ("units", "km")]],
    );
    assert_refused(&named, &["lat: ", "\"km\"", "regrid"]).await;
}

#[tokio::test]
async fn projection_coordinates_are_refused_with_their_standard_name() {
    let names = [
        ("standard_name", "projection_y_coordinate"),
        ("standard_name", "projection_x_coordinate"),
    ];
    for units in ["km", "degrees"] {
        let file = on_axes(["y", "x"], [&LAT, &LON], &[names, [("units", units); 2]]);
        assert_refused(&file, &["projection_y_coordinate", "regrid"]).await;
    }
}

#[tokio::test]
async fn a_rotated_pole_is_refused_even_with_degrees_as_units() {
    let names = [
        ("standard_name", "grid_latitude"),
        ("standard_name", "grid_longitude"),
    ];
    for units in [
        [("units", "degrees"); 2],
        [("units", "degrees_north"), ("units", "degrees_east")],
    ] {
        let file = on_axes(["rlat", "rlon"], [&LAT, &LON], &[names, units]);
        assert_refused(&file, &["rlat: ", "grid_latitude", "regrid", "cdo"]).await;
    }
    // Beside two-dimensional latitudes the reason is the pole, not a swath.
    let plane = Values::Doubles(vec![0.0; 32]);
    let lat = Made::new("lat", &["rlat", "rlon"], plane).text("units", "degrees_north");
    let file = on_axes(["rlat", "rlon"], [&LAT, &LON], &[names]).with(lat);
    assert_refused(&file, &["rlat: ", "grid_latitude"]).await;
}

#[tokio::test]
async fn a_grid_mapping_other_than_latitude_longitude_is_refused_with_its_name() {
    for mapping in [
        "rotated_latitude_longitude",
        "polar_stereographic",
        "mercator",
        "lambert_azimuthal_equal_area",
    ] {
        let crs = Made::new("crs", &["two"], Values::Shorts(vec![0, 0]))
            .text("grid_mapping_name", mapping);
        let file = MadeFile::sst(2)
            .with(crs)
            .but("sst", |v| v.text("grid_mapping", "crs"));
        assert_refused(&file, &["sst: ", "crs", mapping, "regrid"]).await;
    }
}

/// A profile names axes; it cannot make kilometres degrees.
#[tokio::test]
async fn a_profile_does_not_make_a_projection_a_grid() {
    let text = |grid: &str| {
        format!(
            "name = 'p'\nproduct = 'p'\ntitle = 't'\nsource = 's'\nquantity = 'sea_surface_temperature'\n[variable]\nname = 'sst'\n{grid}"
        )
    };
    let named = Profile::parse("p", &text("[grid]\nlatitude = 'y'\nlongitude = 'x'")).unwrap();
    let place = Place::new();
    let files = [place.path("a.nc")];
    on_axes(["y", "x"], [&LAT, &LON], &[[("units", "km"); 2]]).write(&files[0]);
    let (reason, line) = refusal(&place.land_with(&files, Some(&named)).await);
    assert_eq!(reason, RejectReason::Grid, "{line}");
    assert!(line.contains("y: ") && line.contains("km"), "{line}");
    // Of axes that say nothing, a profile may.
    on_axes(["y", "x"], [&LAT, &LON], &[]).write(&files[0]);
    let outcomes = place.land_with(&files, Some(&named)).await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    let crs = Made::new("crs", &["two"], Values::Shorts(vec![0, 0]))
        .text("grid_mapping_name", "mercator");
    let stated = "[grid.stated]\nrows = 4\ncols = 8\nnorth_deg = 90.0\nwest_deg = -180.0\ndlat_deg = 45.0\ndlon_deg = 45.0\nnorth_first = true";
    let stated = Profile::parse("p", &text(stated)).unwrap();
    MadeFile::sst(2)
        .with(crs)
        .but("sst", |v| v.text("grid_mapping", "crs"))
        .write(&files[0]);
    let (_, line) = refusal(&place.land_with(&files, Some(&stated)).await);
    assert!(line.contains("mercator"), "{line}");
}

#[tokio::test]
async fn an_axis_that_says_only_its_direction_is_refused() {
    let file = on_axes(["y", "x"], [&LAT, &LON], &[[("units", "degrees"); 2]]);
    assert_refused(&file, &["sst: ", "axis = \"Y\"", "degrees_north", "[grid]"]).await;
}

#[tokio::test]
async fn latitudes_by_name_alone_land_with_a_note_if_they_can_be_true() {
    let file = on_axes(["lat", "lon"], [&LAT, &LON], &[]);
    let outcome = land(&file).await;
    let said = assumed(&outcome);
    for axis in [
        "lat: is taken for the latitude",
        "lon: is taken for the longitude",
    ] {
        assert!(said.iter().any(|line| line.starts_with(axis)), "{said:?}");
    }
    assert!(outcome.to_string().contains("assumed: lat"), "{outcome}");
    let far: Vec<f64> = (0..4).map(|i| 500.0 - 100.0 * f64::from(i)).collect();
    let file = on_axes(["lat", "lon"], [&far, &LON], &[]);
    assert_refused(&file, &["lat: ", "500", "no latitude", "profile"]).await;
    let far: Vec<f64> = (0..8).map(|i| 1000.0 + 45.0 * f64::from(i)).collect();
    let file = on_axes(["lat", "lon"], [&LAT, &far], &[]);
    assert_refused(&file, &["lon: ", "1000", "no longitude"]).await;
}

#[tokio::test]
async fn latitudes_that_say_so_land_without_a_note_about_them() {
    for pairs in [
        [("units", "degrees_north"), ("units", "degrees_east")],
        [("units", "degrees North"), ("units", "degrees East")],
        [
            ("standard_name", "latitude"),
            ("standard_name", "longitude"),
        ],
    ] {
        let said = assumed(&land(&on_axes(["y", "x"], [&LAT, &LON], &[pairs])).await);
        assert!(
            !said.iter().any(|line| line.contains("by its name")),
            "{said:?}"
        );
    }
    let crs = Made::new("crs", &["two"], Values::Shorts(vec![0, 0]))
        .text("grid_mapping_name", "latitude_longitude");
    let file = MadeFile::sst(2)
        .with(crs)
        .but("sst", |v| v.text("grid_mapping", "crs"));
    assert!(
        !assumed(&land(&file).await)
            .iter()
            .any(|line| line.contains("grid_mapping"))
    );
    let lost = MadeFile::sst(2).but("sst", |v| v.text("grid_mapping", "crs"));
    let said = assumed(&land(&lost).await);
    assert!(
        said.iter()
            .any(|line| line.contains("\"crs\" is not in the file")),
        "{said:?}"
    );
}
