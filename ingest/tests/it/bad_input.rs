//! Bad files: each gets one line with file, object and what to do, and the others of the batch land.

use contract::event::{Body, RejectReason};
use contract::topic::Topic;
use ingest::{Outcome, Profile};

use crate::fixture::{FILL, Place, SmallFile, events, refusal, text};

/// Lands one file and checks reason, words in the line, and that it is one line with the file's name.
async fn assert_refused(place: &Place, name: &str, reason: RejectReason, words: &[&str]) {
    let (found, line) = refusal(&place.land(&[place.path(name)]).await);
    assert_eq!(found, reason, "{line}");
    for word in words.iter().chain(&[name]) {
        assert!(line.contains(word), "{word:?} is not in {line:?}");
    }
    assert!(!line.contains('\n') && line.len() < 800, "{line}");
    eprintln!("{line}");
}

#[tokio::test]
async fn a_truncated_classic_file_is_refused_at_any_length() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("whole.nc"));
    let bytes = std::fs::read(place.path("whole.nc")).unwrap();
    for len in [bytes.len() - 5, bytes.len() / 2, 200, 40, 9] {
        std::fs::write(place.path("cut.nc"), &bytes[..len]).unwrap();
        assert_refused(&place, "cut.nc", RejectReason::Corrupt, &["fetch it again"]).await;
    }
}

#[tokio::test]
async fn a_truncated_hdf5_file_is_refused() {
    let place = Place::new();
    SmallFile::new().write_hdf5(&place.path("whole.h5"));
    let bytes = std::fs::read(place.path("whole.h5")).unwrap();
    for len in [bytes.len() - 100, bytes.len() / 2, 100] {
        std::fs::write(place.path("cut.h5"), &bytes[..len]).unwrap();
        assert_refused(&place, "cut.h5", RejectReason::Corrupt, &["fetch it again"]).await;
    }
}

#[tokio::test]
async fn text_named_nc_is_refused() {
    let place = Place::new();
    std::fs::write(place.path("table.nc"), "lat,lon,flux\n1,2,3\n").unwrap();
    assert_refused(
        &place,
        "table.nc",
        RejectReason::Unreadable,
        &["is text", "NetCDF"],
    )
    .await;
    std::fs::write(place.path("empty.nc"), "").unwrap();
    assert_refused(&place, "empty.nc", RejectReason::Unreadable, &["empty"]).await;
    assert_refused(
        &place,
        "absent.nc",
        RejectReason::Unreadable,
        &["No such file"],
    )
    .await;
    std::fs::create_dir(place.path("folder.nc")).unwrap();
    assert_refused(
        &place,
        "folder.nc",
        RejectReason::Unreadable,
        &["no regular file"],
    )
    .await;
}

#[tokio::test]
async fn a_dataset_of_ten_to_the_fifteen_cells_is_refused_by_name() {
    let place = Place::new();
    let file = hdf5::File::create(place.path("huge.h5")).unwrap();
    file.new_dataset::<f32>()
        .chunk([1, 100, 100])
        .shape([100_000, 100_000, 100_000])
        .create("flux_of_everything")
        .unwrap();
    file.close().unwrap();
    let start = std::time::Instant::now();
    assert_refused(
        &place,
        "huge.h5",
        RejectReason::TooLarge,
        &["flux_of_everything", "1000000000000000"],
    )
    .await;
    assert!(start.elapsed().as_secs() < 5);
}

#[tokio::test]
async fn a_map_or_a_chunk_too_large_for_memory_is_refused() {
    let place = Place::new();
    let mut limits = crate::fixture::settings();
    limits.limits.plane_cells = 16;
    SmallFile::new().write_classic(&place.path("a.nc"));
    let files = [place.path("a.nc")];
    let outcomes = place.land_as(limits, &files, &ingest::Quiet).await.unwrap();
    let (reason, line) = refusal(&outcomes);
    assert_eq!(reason, RejectReason::TooLarge, "{line}");
    assert!(line.contains("4 x 8 cells"), "{line}");
}

#[tokio::test]
async fn a_reader_without_memory_is_a_refusal_and_no_crash() {
    let place = Place::new();
    let mut limits = crate::fixture::settings();
    limits.limits.memory_bytes = 1 << 20; // less than the program itself
    SmallFile::new().write_hdf5(&place.path("a.h5"));
    let files = [place.path("a.h5")];
    let outcomes = place.land_as(limits, &files, &ingest::Quiet).await.unwrap();
    assert!(outcomes[0].is_rejected(), "{}", outcomes[0]);
    eprintln!("{}", outcomes[0]);
}

#[tokio::test]
async fn unknown_missing_and_wrong_units_are_refused() {
    let place = Place::new();
    let with_unit = |unit: &'static str| SmallFile {
        unit,
        ..SmallFile::new()
    };
    with_unit("furlongs fortnight-1").write_classic(&place.path("odd.nc"));
    assert_refused(
        &place,
        "odd.nc",
        RejectReason::Unit,
        &["fgco2", "furlongs", "profile"],
    )
    .await;
    with_unit("K").write_classic(&place.path("kelvin.nc"));
    assert_refused(
        &place,
        "kelvin.nc",
        RejectReason::Unit,
        &["fgco2", "\"K\"", "carbon flux"],
    )
    .await;
    with_unit("").write_classic(&place.path("none.nc"));
    assert_refused(&place, "none.nc", RejectReason::Unit, &["fgco2"]).await;
}

/// Each word is a unit; what they come to is past what a power, a factor or a spelling can be.
#[tokio::test]
async fn a_unit_whose_powers_overflow_is_refused_by_its_name() {
    let place = Place::new();
    let months = format!("{}{}", "s9 ".repeat(14), "mon9 ".repeat(2));
    let cancelled = format!("g C m-2 s-1 {}{}", "s9 ".repeat(7), "mon-9 ".repeat(7));
    for (unit, words) in [
        (months.trim(), ["s9 s9 s9", "powers too high"]),
        (cancelled.trim(), ["mon-9", "factor"]),
        ("m-128", ["m-128", "unknown word"]),
    ] {
        let mut file = SmallFile::new();
        file.unit = Box::leak(unit.to_owned().into_boxed_str());
        file.write_classic(&place.path("overflow.nc"));
        assert_refused(&place, "overflow.nc", RejectReason::Unit, &words).await;
    }
    SmallFile::new().write_classic(&place.path("next.nc"));
    let outcomes = place.land(&[place.path("next.nc")]).await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
}

#[tokio::test]
async fn a_file_without_time_is_refused() {
    let place = Place::new();
    let mut file = SmallFile::new().first_month();
    file.time_unit = None;
    file.write_classic(&place.path("timeless.nc"));
    assert_refused(
        &place,
        "timeless.nc",
        RejectReason::Time,
        &["no time axis", "profile"],
    )
    .await;
    let mut file = SmallFile::new().first_month();
    (file.time, file.time_unit) = (vec![1e9], Some("days since 1970-01-01"));
    file.write_hdf5(&place.path("placeholder.h5"));
    assert_refused(
        &place,
        "placeholder.h5",
        RejectReason::Time,
        &["time", "1000000000"],
    )
    .await;
    let mut file = SmallFile::new();
    file.time = vec![3.0, 3.0];
    file.write_classic(&place.path("twice.nc"));
    assert_refused(
        &place,
        "twice.nc",
        RejectReason::Time,
        &["2001-01-04 twice", "the steps 1 and 2 of the file"],
    )
    .await;
}

#[tokio::test]
async fn a_swath_is_refused_as_one() {
    let place = Place::new();
    let file = hdf5::File::create(place.path("swath.h5")).unwrap();
    for (name, unit, standard_name) in [
        ("lat", "degrees_north", ""),
        ("lon", "degrees_east", ""),
        ("sst", "K", "sea_surface_temperature"),
    ] {
        let dataset = file
            .new_dataset::<f32>()
            .shape([5, 6])
            .create(name)
            .unwrap();
        text(&dataset, "units", unit);
        text(&dataset, "standard_name", standard_name);
    }
    file.close().unwrap();
    assert_refused(
        &place,
        "swath.h5",
        RejectReason::Grid,
        &["sst", "swath", "grid it"],
    )
    .await;
}

#[tokio::test]
async fn odd_axes_are_refused() {
    let place = Place::new();
    let mut file = SmallFile::new();
    file.lat = vec![67.5, 25.0, -22.5, -67.5];
    file.write_classic(&place.path("uneven.nc"));
    assert_refused(&place, "uneven.nc", RejectReason::Grid, &["lat", "evenly"]).await;
    let mut file = SmallFile::new();
    file.lon[3] = f64::NAN;
    file.write_hdf5(&place.path("nan.h5"));
    assert_refused(&place, "nan.h5", RejectReason::Grid, &["lon", "NaN"]).await;
    let mut file = SmallFile::new();
    file.lat = vec![90.0, 45.0, 0.0, -45.0];
    file.write_classic(&place.path("corners.nc"));
    assert_refused(
        &place,
        "corners.nc",
        RejectReason::Grid,
        &["past a pole", "registration"],
    )
    .await;
}

#[tokio::test]
async fn implausible_and_absent_values_are_refused() {
    let place = Place::new();
    let mut file = SmallFile::new();
    file.unit = "kg C m-2 s-1";
    file.write_classic(&place.path("scale.nc"));
    assert_refused(
        &place,
        "scale.nc",
        RejectReason::Values,
        &["fgco2", "outside"],
    )
    .await;
    let mut file = SmallFile::new();
    file.values.fill(FILL);
    file.write_hdf5(&place.path("blank.h5"));
    assert_refused(&place, "blank.h5", RejectReason::Values, &["no value"]).await;
}

#[tokio::test]
async fn other_grids_and_overlapping_periods_are_conflicts() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    place.land(&[place.path("a.nc")]).await;
    let mut file = SmallFile::new();
    file.lat = vec![60.0, 20.0, -20.0, -60.0];
    file.write_classic(&place.path("grid.nc"));
    assert_refused(&place, "grid.nc", RejectReason::Conflict, &["fgco2"]).await;
    let mut file = SmallFile::new();
    (file.time, file.unit) = (vec![10.0, 11.0], "mg C m-2 d-1");
    file.write_classic(&place.path("days.nc"));
    assert_refused(&place, "days.nc", RejectReason::Conflict, &["overlaps"]).await;
    assert_eq!(place.newest("fgco2").await.number, 1);
}

#[tokio::test]
async fn files_without_a_variable_to_land_say_what_they_hold() {
    let place = Place::new();
    let mut file = SmallFile::new();
    file.standard_name = "height_of_the_tide";
    file.write_classic(&place.path("tide.nc"));
    std::fs::write(
        place.path("bare.nc"),
        b"CDF\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0",
    )
    .unwrap();
    assert_refused(
        &place,
        "bare.nc",
        RejectReason::NoVariable,
        &["no variable"],
    )
    .await;
    let grouped = hdf5::File::create(place.path("groups.nc")).unwrap();
    let group = grouped.create_group("physics").unwrap();
    let inner = group
        .new_dataset::<f32>()
        .shape([2_usize])
        .create("sst")
        .unwrap();
    drop((inner, group, grouped));
    let words = ["nothing but groups (physics)", "ncks -G"];
    assert_refused(&place, "groups.nc", RejectReason::NoVariable, &words).await;
    // Axes alone lie outside.
    let grouped = hdf5::File::create(place.path("axes.nc")).unwrap();
    let group = grouped.create_group("geophysical").unwrap();
    for (owner, name) in [(&*grouped, "lat"), (&group, "sst")] {
        let dataset = owner.new_dataset::<f32>().shape([2_usize]);
        drop(dataset.create(name).unwrap());
    }
    drop((group, grouped));
    let words = ["in its groups (geophysical) are not read", "ncks -G"];
    assert_refused(&place, "axes.nc", RejectReason::NoVariable, &words).await;
    let profile = Profile::find("takahashi09-flux").unwrap();
    let (reason, line) = refusal(
        &place
            .land_with(&[place.path("tide.nc")], Some(&profile))
            .await,
    );
    assert_eq!(reason, RejectReason::NoVariable);
    assert!(line.contains("CO2flux") && line.contains("fgco2"), "{line}");
}

#[tokio::test]
async fn the_batch_goes_on_and_every_file_has_its_event() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("good.nc"));
    std::fs::write(place.path("bad.nc"), "text").unwrap();
    let outcomes = place
        .land(&[
            place.path("bad.nc"),
            place.path("good.nc"),
            place.path("bad.nc"),
        ])
        .await;
    let rejected: Vec<bool> = outcomes.iter().map(Outcome::is_rejected).collect();
    assert_eq!(rejected, [true, false, true]);
    let landed = events(&place.log, Topic::GranuleLanded).await;
    let refused = events(&place.log, Topic::GranuleRejected).await;
    assert_eq!((landed.len(), refused.len()), (1, 2));
    let Body::GranuleRejected { detail, reason, .. } = &refused[0].body else {
        panic!("{refused:?}")
    };
    assert_eq!(*reason, RejectReason::Unreadable);
    assert!(detail.contains("is text"), "{detail}");
}
