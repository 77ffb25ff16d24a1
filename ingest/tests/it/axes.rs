//! Axes that are no latitudes and longitudes are refused with the attribute that says so; those that are must prove it.

use contract::event::RejectReason;
use ingest::{Outcome, Profile};

use crate::fixture::{Place, SmallFile, refusal};
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

#[tokio::test]
async fn a_column_that_is_there_twice_is_left_out_and_told() {
    let (narrow, wide) = (Place::new(), Place::new());
    let small = SmallFile::new();
    small.write_classic(&narrow.path("a.nc"));
    narrow.land(&[narrow.path("a.nc")]).await;
    let wider = SmallFile {
        lon: (0..9).map(|i| -157.5 + 45.0 * f64::from(i)).collect(),
        values: small
            .values
            .chunks(8)
            .flat_map(|row| [row, &[77.0][..]].concat())
            .collect(),
        ..small
    };
    wider.write_classic(&wide.path("a.nc"));
    let outcome = wide.land(&[wide.path("a.nc")]).await.remove(0);
    let told = assumed(&outcome);
    assert!(
        told.iter()
            .any(|line| line.contains("a turn apart") && line.contains("the last is left out")),
        "{told:?}"
    );
    let bits = async |place: &Place| -> Vec<u32> {
        let values = place.values(&place.newest("fgco2").await, 0).await;
        values.into_iter().map(f32::to_bits).collect()
    };
    assert_eq!(bits(&wide).await, bits(&narrow).await);
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

/// Two numbers a cell.
fn bounds(name: &'static str, axis: &'static str, edges: &[[f64; 2]]) -> Made {
    Made::new(
        name,
        &[axis, "two"],
        Values::Doubles(edges.as_flattened().to_vec()),
    )
}

/// Labels name corners of cells, and bounds say so; others are no cells side by side.
#[tokio::test]
async fn labels_at_corners_with_bounds_land_where_these_say() {
    let (lat, lon) = (
        vec![40.0, 30.0, 20.0, 10.0],
        (0..8)
            .map(|col| 10.0 * f64::from(col))
            .collect::<Vec<f64>>(),
    );
    let file = || {
        let file = MadeFile::sst(2).numbers("lat", &lat).numbers("lon", &lon);
        let named = |name: &'static str| move |v: Made| v.text("bounds", name);
        file.but("lat", named("lat_bnds"))
            .but("lon", named("lon_bnds"))
    };
    let step = |labels: &[f64]| labels[1] - labels[0];
    let from = |labels: &[f64], low: f64, high: f64| -> Vec<[f64; 2]> {
        let cell = step(labels).abs();
        labels
            .iter()
            .map(|label| [label + low * cell, label + high * cell])
            .collect()
    };
    let landed = async |lat_edges: Vec<[f64; 2]>, lon_edges: Vec<[f64; 2]>| {
        let file = file()
            .with(bounds("lat_bnds", "lat", &lat_edges))
            .with(bounds("lon_bnds", "lon", &lon_edges));
        let place = Place::new();
        file.write(&place.path("a.nc"));
        let outcome = place.land(&[place.path("a.nc")]).await.remove(0);
        (place, outcome)
    };
    let (place, outcome) = landed(from(&lat, -0.5, 0.5), from(&lon, -0.5, 0.5)).await;
    assert!(
        assumed(&outcome).iter().all(|line| !line.contains("bnds")),
        "{outcome}"
    );
    let Outcome::Landed { manifest, .. } = &outcome else {
        panic!("{outcome}")
    };
    let middle = place.newest(manifest.product.as_str()).await.grid;
    // South-western corners are the labels.
    let (place, outcome) = landed(from(&lat, 0.0, 1.0), from(&lon, 0.0, 1.0)).await;
    let told = assumed(&outcome);
    for name in ["lat_bnds", "lon_bnds"] {
        assert!(told.iter().any(|line| line.contains(name)), "{told:?}");
    }
    let corner = place.newest(manifest.product.as_str()).await.grid;
    assert_eq!((corner.rows, corner.cols), (middle.rows, middle.cols));
    assert_eq!([middle.north_deg, middle.west_deg], [45.0, -5.0]);
    assert_eq!([corner.north_deg, corner.west_deg], [50.0, 0.0]);
    let (_place, outcome) = landed(from(&lat, -0.1, 0.1), from(&lon, -0.5, 0.5)).await;
    let (reason, line) = refusal(&[outcome]);
    assert!(
        reason == RejectReason::Grid && line.contains("no cells side by side"),
        "{line}"
    );
}

/// Bounds that are there say where cells are: what is no two numbers a cell is not taken for none.
#[tokio::test]
async fn bounds_of_another_shape_are_read_where_it_has_one_meaning_and_refused_elsewhere() {
    let edges = [45.0, 90.0, 0.0, 45.0, -45.0, 0.0, -90.0, -45.0];
    let file = |dimensions: &[&'static str], numbers: Vec<f64>| {
        let mut file = MadeFile::sst(2)
            .but("lat", |v| v.text("bounds", "lat_bnds"))
            .with(Made::new("lat_bnds", dimensions, Values::Doubles(numbers)));
        file.dimensions.extend([("edge", 5), ("one", 1)]);
        file
    };
    // They say where cells are, and so is what is read of them.
    let rows = [45.0, 0.0, -45.0, -90.0, 90.0, 45.0, 0.0, -45.0];
    let between = [90.0, 45.0, 0.0, -45.0, -90.0];
    let lying: [(&[&'static str], &[f64], &str); 3] = [
        (&["two", "lat"], &rows, "two rows"),
        (&["edge"], &between, "one number more than there are labels"),
        (&["lat", "one", "two"], &edges, ""),
    ];
    for (dimensions, numbers, told) in lying {
        let lines = assumed(&land(&file(dimensions, numbers.to_vec())).await);
        let about: Vec<&String> = lines.iter().filter(|line| line.contains("bnds")).collect();
        assert!(about.iter().all(|line| line.contains(told)), "{about:?}");
        assert_eq!(about.len(), usize::from(!told.is_empty()), "{about:?}");
        let moved: Vec<f64> = numbers.iter().map(|edge| edge / 4.0).collect();
        let words = ["lat_bnds: ", "no cells side by side"];
        assert_refused(&file(dimensions, moved), &words).await;
    }
    let plain = file(&["lat"], vec![0.0; 4]);
    let words = ["lat: ", "\"lat_bnds\"", "[4]", "shape [4, 2]", "the grid"];
    assert_refused(&plain, &words).await;
    let letters = Values::Bytes(vec![0; 4]);
    let plain = plain.with(Made::new("lat_bnds", &["lat"], letters));
    assert_refused(&plain, &["lat: ", "\"lat_bnds\"", "int8", "[4]"]).await;
    let repeated = file(&["time", "lat", "two"], edges.repeat(2));
    let told = assumed(&land(&repeated).await);
    let is_told = |line: &String| line.contains("\"lat_bnds\" have more dimensions");
    assert!(told.iter().any(is_told), "{told:?}");
    // They are read: what are no cells of the labels is refused.
    let narrow = file(&["time", "lat", "two"], vec![1.0; 16]);
    assert_refused(&narrow, &["lat_bnds: ", "no cells side by side"]).await;
}

/// Of one latitude, or one longitude, its bounds alone say how wide the cell is.
#[tokio::test]
async fn one_row_or_one_column_lands_where_its_bounds_say_how_wide_it_is() {
    let one = |name: &'static str, label: f64| {
        let mut file = MadeFile::sst(2);
        let axis = file.dimensions.iter_mut().find(|(own, _)| *own == name);
        let before = std::mem::replace(&mut axis.unwrap().1, 1);
        let file = file.numbers(name, &[label]);
        file.but("sst", |v| Made {
            values: Values::Floats(vec![20.0; 2 * 32 / before]),
            ..v
        })
    };
    let bounded = |name: &'static str, label: f64, held: &'static str, edges: [f64; 2]| {
        one(name, label)
            .but(name, |v| v.text("bounds", held))
            .with(bounds(held, name, &[edges]))
    };
    for name in ["lat", "lon"] {
        let start = format!("{name}: has one label and no bounds");
        assert_refused(
            &one(name, 0.0),
            &[start.as_str(), "(bounds)", "in a profile"],
        )
        .await;
    }
    let beside = bounded("lat", 10.0, "lat_bnds", [-5.0, 5.0]);
    let words = ["lat_bnds: ", "from -5 to 5 at the label 10"];
    assert_refused(&beside, &words).await;
    let grid = async |file: &MadeFile| {
        let place = Place::new();
        file.write(&place.path("a.nc"));
        let outcome = place.land(&[place.path("a.nc")]).await.remove(0);
        let Outcome::Landed { manifest, .. } = &outcome else {
            panic!("{outcome}")
        };
        let manifest = place.newest(manifest.product.as_str()).await;
        assert!(place.values(&manifest, 1).await.len() < 32);
        manifest.grid
    };
    let row = grid(&bounded("lat", 0.0, "lat_bnds", [5.0, -5.0])).await;
    assert_eq!((row.rows, row.cols), (1, 8));
    assert_eq!(row.shown_bounds_deg(), [-180.0, -5.0, 180.0, 5.0]);
    // A mean over all longitudes.
    let column = grid(&bounded("lon", 0.0, "lon_bnds", [-180.0, 180.0])).await;
    assert_eq!((column.rows, column.cols), (4, 1));
    assert_eq!(column.shown_bounds_deg(), [-180.0, -90.0, 180.0, 90.0]);
}

/// Labels of single precision were taken as they are stored: a product that landed so goes on.
#[tokio::test]
async fn a_product_on_axes_that_were_not_rounded_takes_its_next_step() {
    let stored: Vec<f32> = (0..8_u16)
        .map(|col| (120.102 + 0.01 * f64::from(col)) as f32)
        .collect();
    // A hair more, in double precision, lies where it says.
    let before = stored.iter().map(|lon| f64::from(*lon) + 1e-9).collect();
    let file = |days: [f64; 2], lon: Values| {
        let file = MadeFile::sst(2).numbers("time", &days);
        file.but("lon", |v| Made { values: lon, ..v })
    };
    let land = async |place: &Place, file: MadeFile, name: &str| {
        file.write(&place.path(name));
        let outcome = place.land(&[place.path(name)]).await.remove(0);
        let Outcome::Landed { manifest, .. } = &outcome else {
            panic!("{outcome}")
        };
        place.newest(manifest.product.as_str()).await
    };
    let place = Place::new();
    let first = land(&place, file([0.0, 1.0], Values::Doubles(before)), "a.nc").await;
    let off_deg = first.grid.west_deg - 120.097;
    assert!((1e-6..1e-5).contains(&off_deg.abs()), "{:?}", first.grid);
    let next = file([2.0, 3.0], Values::Floats(stored));
    let second = land(&place, next.clone(), "b.nc").await;
    assert_eq!(second.product, first.product);
    assert_eq!((second.steps.len(), second.grid), (4, first.grid));
    let alone = land(&Place::new(), next, "b.nc").await;
    let off_deg = alone.grid.west_deg - 120.097;
    assert!(off_deg.abs() < 1e-12, "{:?}", alone.grid);
}

/// What counts westwards and southwards is turned, its bounds too.
#[tokio::test]
async fn longitudes_in_degrees_west_lie_in_the_west() {
    let west: Vec<f64> = (0..8).map(|col| 100.0 - 10.0 * f64::from(col)).collect();
    let south = [40.0, 50.0, 60.0, 70.0];
    let edges: Vec<[f64; 2]> = west.iter().map(|lon| [lon + 5.0, lon - 5.0]).collect();
    let turned = |file: MadeFile| {
        let file = file.but("lon", |v| v.text("units", "degrees_west"));
        file.but("lat", |v| v.text("units", "degrees_south"))
    };
    let file = MadeFile::sst(2)
        .numbers("lat", &south)
        .numbers("lon", &west);
    let bounded = turned(file.clone())
        .but("lon", |v| v.text("bounds", "lon_bnds"))
        .with(bounds("lon_bnds", "lon", &edges));
    for file in [turned(file), bounded] {
        let place = Place::new();
        file.write(&place.path("a.nc"));
        let outcome = place.land(&[place.path("a.nc")]).await.remove(0);
        let told = assumed(&outcome);
        for (name, units) in [("lon", "degrees_west"), ("lat", "degrees_south")] {
            let start = format!("{name}: is in {units}; its numbers are turned");
            let is_told = |line: &String| line.starts_with(&start);
            assert!(told.iter().any(is_told), "{told:?}");
        }
        let Outcome::Landed { manifest, .. } = &outcome else {
            panic!("{outcome}")
        };
        let grid = place.newest(manifest.product.as_str()).await.grid;
        assert_eq!([grid.north_deg, grid.west_deg], [-35.0, -105.0]);
        assert_eq!((grid.rows, grid.cols), (4, 8));
    }
}

/// Of places and times nothing is left out by a range, whatever its text.
#[tokio::test]
async fn a_valid_range_of_an_axis_that_is_no_numbers_is_passed_over() {
    let file = MadeFile::sst(2)
        .but("lat", |v| v.text("valid_range", "-90.f 90.f"))
        .but("time", |v| v.text("valid_min", "1982-01-01"));
    land(&file).await;
}

/// A Gaussian grid is evened out, by how much is told, and what is farther from even is refused.
#[tokio::test]
async fn latitudes_that_are_not_quite_even_are_told_of() {
    let gaussian = [
        73.7992, 52.8129, 31.7041, 10.5699, -10.5699, -31.7041, -52.8129, -73.7992,
    ];
    let file = |lat: &[f64]| {
        let mut file = MadeFile::sst(2).numbers("lat", lat);
        file.dimensions[1].1 = lat.len();
        file.but("sst", |v| Made {
            values: Values::Floats(vec![20.0; 2 * 8 * lat.len()]),
            ..v
        })
    };
    let outcome = land(&file(&gaussian)).await;
    let about = |line: &&String| line.starts_with("lat: is not evenly spaced");
    let told: Vec<String> = assumed(&outcome).iter().filter(about).cloned().collect();
    assert!(
        told.len() == 1 && told[0].contains("0.10") && told[0].contains("(0.5 % of a cell)"),
        "{outcome}"
    );
    assert!(
        told[0].contains("degrees before the poles, round which nothing counts"),
        "{told:?}"
    );
    let mut uneven = gaussian;
    uneven[3] += 1.0;
    assert_refused(&file(&uneven), &["lat: ", "not evenly spaced", "regrid"]).await;
}

/// Plain HDF5 names no dimensions.
#[tokio::test]
async fn axes_without_names_are_told_by_length_or_refused() {
    let place = Place::new();
    crate::fixture::SmallFile::new().write_hdf5(&place.path("a.h5"));
    let outcome = place.land(&[place.path("a.h5")]).await.remove(0);
    let told = assumed(&outcome);
    assert!(
        told.iter().any(|line| line.contains("names no dimensions")),
        "{told:?}"
    );
    let mut square = crate::fixture::SmallFile::new();
    square.lat = (0..8).map(|row| 70.0 - 20.0 * f64::from(row)).collect();
    square.values = vec![1.0; 2 * 8 * 8];
    square.write_hdf5(&place.path("square.h5"));
    let (reason, line) = refusal(&place.land(&[place.path("square.h5")]).await);
    assert!(
        reason == RejectReason::Grid && line.contains("of one length"),
        "{line}"
    );
}
