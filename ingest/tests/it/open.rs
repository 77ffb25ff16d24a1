//! Variables that no quantity is built in for land under their own words; what cannot be right, or is not sure, does not.

use std::path::PathBuf;

use contract::quantity::{OpenWords, Quantity};
use ingest::reread::{self, Request, Workplace};
use ingest::{IngestService, Outcome, Quiet, Wishes};
use std::sync::Arc;

use crate::fixture::{Place, refusal, settings};
use crate::made::{Made, MadeFile, Says, Values};

/// A value a cell, `count` maps.
fn values(count: usize) -> Values {
    Values::Floats((0..32 * count).map(|cell| cell as f32).collect())
}

fn variable(name: &'static str, count: usize) -> Made {
    Made::new(name, &["time", "lat", "lon"], values(count))
}

fn river(count: usize) -> Made {
    variable("dic", count)
        .text("standard_name", "mole_flux_of_dic_from_rivers")
        .text("long_name", "River DIC flux")
        .text("units", "mmol m-2 s-1")
}

fn open(quantity: Quantity) -> OpenWords {
    match quantity {
        Quantity::Open(open) => open.words().clone(),
        known => panic!("{known:?} is built in"),
    }
}

async fn land(place: &Place, file: &MadeFile) -> Outcome {
    file.write(&place.path("a.nc"));
    place.land(&[place.path("a.nc")]).await.remove(0)
}

async fn refused(file: &MadeFile) -> String {
    let place = Place::new();
    let outcome = land(&place, file).await;
    refusal(std::slice::from_ref(&outcome)).1
}

#[tokio::test]
async fn a_variable_of_another_kind_lands_under_its_own_words() {
    let place = Place::new();
    let outcome = land(&place, &MadeFile::days(2).with(river(2))).await;
    assert!(!outcome.is_rejected(), "{outcome}");
    let manifest = place.newest("dic").await;
    let words = open(manifest.quantity);
    assert_eq!(
        (
            words.name.as_str(),
            words.unit.as_str(),
            words.title.as_str()
        ),
        (
            "mole_flux_of_dic_from_rivers",
            "mol m-2 s-1",
            "River DIC flux"
        )
    );
    assert_eq!(words.range, Some([0.0, 0.063]), "of both steps");
    assert!(words.is_standard_name);
    let second = place.values(&manifest, 1).await;
    assert_eq!(second[5].to_bits(), (37.0f64 * 1e-3).to_bits_as_f32());
}

trait AsFloat {
    fn to_bits_as_f32(self) -> u32;
}

impl AsFloat for f64 {
    fn to_bits_as_f32(self) -> u32 {
        (self as f32).to_bits()
    }
}

/// Its range grows with what lands later, and its words stay those of the first file.
#[tokio::test]
async fn later_files_widen_the_range_and_other_units_are_refused() {
    let place = Place::new();
    let day = |since: &'static str, change: fn(Made) -> Made| {
        let file = MadeFile::days(1).with(change(river(1)));
        file.but("time", |time| {
            time.text("units", since).text("bounds", "time_bnds")
        })
        .with(Made::new(
            "time_bnds",
            &["time", "two"],
            Values::Doubles(vec![0.0, 1.0]),
        ))
    };
    let wide = |v: Made| Made {
        values: Values::Floats((0..32).map(|cell| -(cell as f32)).collect()),
        ..v
    };
    let files: Vec<PathBuf> = [
        day("days since 2001-01-01", |v| v),
        day("days since 2001-01-02", wide),
        day("days since 2001-01-03", |v| v.text("units", "kg m-2 s-1")),
    ]
    .iter()
    .enumerate()
    .map(|(number, file)| {
        let path = place.path(&format!("{number}.nc"));
        file.write(&path);
        path
    })
    .collect();
    let outcomes = place.land(&files).await;
    assert!(!outcomes[1].is_rejected(), "{}", outcomes[1]);
    let (_, detail) = refusal(&outcomes[2..]);
    assert!(
        detail.contains("(mol m-2 s-1)") && detail.contains("(kg m-2 s-1)"),
        "{detail}"
    );
    let words = open(place.newest("dic").await.quantity);
    assert_eq!(words.range, Some([-0.031, 0.031]));
    // The same files again change nothing.
    let before = place.newest("dic").await;
    place.land(&files[..2]).await;
    assert_eq!(place.newest("dic").await, before);
}

#[tokio::test]
async fn of_several_variables_one_must_be_named_and_is_kept_when_files_are_read_anew() {
    let place = Place::new();
    let file = MadeFile::days(1)
        .with(
            variable("uwnd", 1)
                .text("units", "M/S")
                .text("long_name", "ZONAL WIND"),
        )
        .with(variable("slp", 1).text("units", "MB"));
    let file = file
        .but("time", |time| time.text("bounds", "time_bnds"))
        .with(Made::new(
            "time_bnds",
            &["time", "two"],
            Values::Doubles(vec![0.0, 1.0]),
        ));
    let outcome = land(&place, &file).await;
    let (_, detail) = refusal(std::slice::from_ref(&outcome));
    assert!(
        detail.contains("uwnd, slp") && detail.contains("--variable"),
        "{detail}"
    );
    let log: Arc<dyn storage::log::EventLog> = Arc::new(place.log.clone());
    let service = IngestService::new(place.store.clone(), log, settings());
    let of = |variable: &str| Wishes {
        variable: Some(variable.to_owned()),
        ..Wishes::default()
    };
    for name in ["uwnd", "slp", "no-such"] {
        service
            .notify_of(&[place.path("a.nc")], &of(name))
            .await
            .unwrap();
    }
    let outcomes = service.drain(&Quiet).await.unwrap();
    assert!(
        refusal(&outcomes[2..]).1.contains("uwnd, slp"),
        "{}",
        outcomes[2]
    );
    let wind = open(place.newest("uwnd").await.quantity);
    assert_eq!(
        (wind.name.as_str(), wind.unit.as_str()),
        ("zonal_wind", "m s-1")
    );
    assert_eq!(open(place.newest("slp").await.quantity).unit, "Pa");

    let request = Request {
        product: "uwnd".parse().unwrap(),
        from: None,
        to: None,
        profile: None,
        is_forced: true,
        is_verified: false,
    };
    let work = Workplace::new(settings(), place.path("spool"), 64 << 20);
    let before = place.newest("uwnd").await;
    let plan = reread::plan(&place.store, &work.settings.profiles, &request);
    let plan = plan.await.unwrap();
    assert_eq!(plan.items.len(), 1);
    let again = reread::run(&place.store, &plan, &request, &work, &|_done| ()).await;
    let again = again.unwrap();
    assert!(again.is_none(), "the same variable gives the same version");
    assert_eq!(place.newest("uwnd").await, before);
}

#[tokio::test]
async fn a_variable_that_the_profile_of_a_file_does_not_read_is_refused_and_not_another_landed() {
    let place = Place::new();
    let (east, north) = (
        "eastward_eulerian_current_velocity",
        "northward_eulerian_current_velocity",
    );
    let current = |name| {
        let half = Values::Floats(vec![0.5; 32]);
        Made::new(name, &["time", "lat", "lon"], half).text("units", "m s-1")
    };
    let file = MadeFile::days(1).with(current(east)).with(current(north));
    file.with(variable("slp", 1).text("units", "Pa"))
        .write(&place.path("a.nc"));
    let log: Arc<dyn storage::log::EventLog> = Arc::new(place.log.clone());
    let service = IngestService::new(place.store.clone(), log, settings());
    for name in ["slp", north, east] {
        let of = Wishes {
            variable: Some(name.to_owned()),
            ..Wishes::default()
        };
        let notified = service.notify_of(&[place.path("a.nc")], &of).await;
        notified.unwrap();
    }
    let outcomes = service.drain(&Quiet).await.unwrap();
    for (outcome, advice) in [(0, "profile of your own"), (1, "globcurrent-north")] {
        let (_, detail) = refusal(&outcomes[outcome..=outcome]);
        assert!(
            detail.contains("globcurrent-east") && detail.contains(advice),
            "{detail}"
        );
    }
    assert!(!outcomes[2].is_rejected(), "{}", outcomes[2]);
    assert_eq!(place.newest("globcurrent-east").await.steps.len(), 1);
}

#[tokio::test]
async fn statistics_and_what_is_named_by_another_are_not_what_a_file_is_about() {
    let place = Place::new();
    let file = MadeFile::days(2)
        .with(variable("ocean_mean", 2).text("ancillary_variables", "trust"))
        .with(variable("ocean_count", 2))
        .with(variable("ocean_stddev", 2))
        .with(variable("trust", 2));
    let outcome = land(&place, &file).await;
    assert!(!outcome.is_rejected(), "{outcome}");
    place.newest("ocean-mean").await;
    // Of nothing else there is nothing to choose, and that it is on no grid is not said.
    let error = |v: Made| v.text("standard_name", "sea_surface_temperature standard_error");
    let line = refused(&MadeFile::sst(2).but("sst", error)).await;
    assert!(
        line.contains("holds sst, there for others") && line.contains("--variable"),
        "{line}"
    );
}

/// Masks are called alike in files of one maker: each is a product of its own, and none revises another.
#[tokio::test]
async fn masks_are_called_as_their_files_are() {
    let place = Place::new();
    let mask = |code: i8| Made::new("mask", &["lat", "lon"], Values::Bytes(vec![code; 32]));
    for (name, code) in [("one.nc", 1), ("two.v2.nc", 2)] {
        MadeFile::days(1).with(mask(code)).write(&place.path(name));
        let outcome = place.land(&[place.path(name)]).await.remove(0);
        assert!(
            matches!(outcome, Outcome::Landed { revised: false, .. }),
            "{outcome}"
        );
    }
    for (product, code) in [("one", 1.0), ("two", 2.0)] {
        let manifest = place.newest(product).await;
        assert!(place.values(&manifest, 0).await.iter().all(|v| *v == code));
    }
}

/// As OSTIA and other analyses of GHRSST are: ice and error beside the one temperature.
#[tokio::test]
async fn an_analysis_of_ghrsst_is_about_its_temperature() {
    let place = Place::new();
    let kelvin = Made {
        values: Values::Floats(vec![290.0; 64]),
        ..variable("analysed_sst", 2)
    };
    let share = |name| Made {
        values: Values::Floats(vec![0.5; 64]),
        ..variable(name, 2)
    };
    let file = MadeFile::days(2)
        .with(
            kelvin
                .text("standard_name", "sea_surface_foundation_temperature")
                .text("units", "kelvin"),
        )
        .with(share("sea_ice_fraction").text("standard_name", "sea_ice_area_fraction"))
        .with(share("analysis_error").text("units", "kelvin"))
        .with(share("mask"));
    let said = refused(&file).await;
    assert!(
        said.contains("several") && said.contains("sea_ice_fraction"),
        "{said}"
    );
    let outcome = land(&place, &file.text("gds_version_id", "2.0")).await;
    assert!(!outcome.is_rejected(), "{outcome}");
    let manifest = place.newest("analysed-sst").await;
    assert_eq!(manifest.quantity, Quantity::SeaSurfaceFoundationTemperature);
}

#[tokio::test]
async fn a_mask_needs_no_time_and_codes_stay_what_they_are() {
    let place = Place::new();
    let mut mask = Made::new("ocean_mask", &["lat", "lon"], Values::Bytes(vec![3; 32]));
    let Values::Bytes(codes) = &mut mask.values else {
        panic!()
    };
    codes[7] = 40;
    let outcome = land(&place, &MadeFile::days(1).with(mask)).await;
    assert!(!outcome.is_rejected(), "{outcome}");
    let manifest = place.newest("a").await;
    let values = place.values(&manifest, 0).await;
    assert!(values[7] == 40.0 && values[0] == 3.0);
    assert_eq!(
        manifest.steps[0].period.to_string(),
        "2001-01-01T00:00:00Z/2002-01-01T00:00:00Z"
    );
    // What changes with time does not hold at any.
    let ice = Made::new("ice_mask", &["lat", "lon"], Values::Bytes(vec![1; 32]));
    let said = refused(&MadeFile::days(1).with(ice)).await;
    assert!(said.contains("nothing says what it covers"), "{said}");
}

/// A mask of three codes, without a word of what they mean.
fn basins() -> Made {
    let codes = (0..32).map(|cell| (cell % 3) as i8).collect();
    Made::new("basin", &["lat", "lon"], Values::Bytes(codes)).says("_FillValue", Says::Bytes(&[0]))
}

fn told(mask: Made) -> Made {
    mask.says("flag_values", Says::Bytes(&[0, 1, 2]))
        .text("flag_meanings", "none atlantic indian")
}

/// Values are float32, in which one code of two beside each other would become the other.
#[tokio::test]
async fn codes_that_values_cannot_hold_are_refused_and_other_numbers_are_told_of() {
    let codes = |code| Made::new("basin", &["lat", "lon"], Values::Ints(vec![code; 32]));
    let said = refused(&MadeFile::days(1).with(codes(16_777_217))).await;
    assert!(
        said.contains("basin: has the code 16777217 in 2001"),
        "{said}"
    );
    let place = Place::new();
    let outcome = land(&place, &MadeFile::days(1).with(codes(16_777_216))).await;
    assert!(!outcome.is_rejected(), "{outcome}");
    assert!(!outcome.to_string().contains("float32"), "{outcome}");
    let manifest = place.newest("a").await;
    assert_eq!(place.values(&manifest, 0).await[0], 16_777_216.0);

    // Codes of floating point are told by their meanings.
    let doubles = |code| Made::new("basin", &["lat", "lon"], Values::Doubles(vec![code; 32]));
    let named = |code| {
        let codes = doubles(code).says("flag_values", Says::Doubles(&[1.0, 2.0]));
        MadeFile::days(1).with(codes.text("flag_meanings", "north south"))
    };
    let said = refused(&named(16_777_217.0)).await;
    assert!(said.contains("basin: has the code 16777217"), "{said}");
    for file in [named(16_777_218.0), MadeFile::days(1).with(doubles(0.1))] {
        let outcome = land(&Place::new(), &file).await;
        assert!(!outcome.is_rejected(), "{outcome}");
    }

    let depths = |depth| {
        let values = Values::Ints(vec![depth; 64]);
        let depths = Made::new("depth_of_shot", &["time", "lat", "lon"], values);
        MadeFile::days(2).with(depths.text("units", "m"))
    };
    for (depth, is_told) in [(16_777_217, true), (16_777_218, false)] {
        let outcome = land(&Place::new(), &depths(depth)).await;
        assert!(!outcome.is_rejected(), "{outcome}");
        let line = outcome.to_string();
        assert_eq!(
            line.contains("whole numbers beyond 16777216"),
            is_told,
            "{line}"
        );
    }
}

#[tokio::test]
async fn what_codes_mean_is_kept_and_a_file_that_says_it_later_is_taken_for_it() {
    let place = Place::new();
    let outcome = land(&place, &MadeFile::days(1).with(basins())).await;
    assert!(!outcome.is_rejected(), "{outcome}");
    assert!(place.newest("a").await.quantity.flags().is_empty());
    let file = MadeFile::days(1).with(told(basins()));
    for is_new in [true, false] {
        let outcome = land(&place, &file).await;
        assert_eq!(
            matches!(outcome, Outcome::Landed { revised: true, .. }),
            is_new,
            "{outcome}"
        );
        let manifest = place.newest("a").await;
        // The fill value is no code.
        let flags = manifest.quantity.flags().iter();
        let flags: Vec<_> = flags.map(|own| (own.value, own.meaning.as_str())).collect();
        assert_eq!(flags, [(1, "atlantic"), (2, "indian")]);
        assert_eq!((manifest.number, manifest.steps.len()), (2, 1));
    }
}

#[tokio::test]
async fn meanings_that_cannot_be_kept_are_left_out_and_that_is_said() {
    for (file, wanted) in [
        (
            told(basins()).text("flag_meanings", "none atlantic"),
            "3 flag_values for 2 words",
        ),
        (
            told(basins()).text("flag_meanings", "none a a"),
            "two codes mean",
        ),
        (
            told(basins()).text("flag_meanings", "none \u{1b}[2J b"),
            "no meaning",
        ),
        (
            told(basins()).says("flag_masks", Says::Bytes(&[1, 1, 1])),
            "of bits",
        ),
    ] {
        let place = Place::new();
        let outcome = land(&place, &MadeFile::days(1).with(file)).await;
        assert!(!outcome.is_rejected(), "{outcome}");
        let line = outcome.to_string();
        assert!(
            line.contains("what its codes mean is left out") && line.contains(wanted),
            "{line}"
        );
        assert!(!line.chars().any(char::is_control), "{line:?}");
        assert!(place.newest("a").await.quantity.flags().is_empty());
    }
}

#[tokio::test]
async fn directions_land_as_what_they_are() {
    let place = Place::new();
    let direction = Made {
        values: Values::Floats((0..64).map(|cell| 5.0 * cell as f32).collect()),
        ..variable("dir", 2)
    };
    let direction = direction
        .text("standard_name", "wind_from_direction")
        .text("units", "degrees_true");
    let outcome = land(&place, &MadeFile::days(2).with(direction)).await;
    assert!(!outcome.is_rejected(), "{outcome}");
    let manifest = place.newest("dir").await;
    assert!(manifest.quantity.is_direction());
    assert_eq!(manifest.quantity.unit(), "degree");
    assert_eq!(place.values(&manifest, 1).await[31], 315.0);
}

#[tokio::test]
async fn what_cannot_be_right_is_refused_with_its_reason() {
    let mut unmarked = river(2);
    let Values::Floats(cells) = &mut unmarked.values else {
        panic!()
    };
    (cells[3], cells[9]) = (-999.0, -999.0);
    let said = refused(&MadeFile::days(2).with(unmarked.clone())).await;
    assert!(
        said.contains("2 cells of -999") && said.contains("fill_values"),
        "{said}"
    );
    let place = Place::new();
    let marked = unmarked.says("missing_value", Says::Floats(&[-999.0]));
    let outcome = land(&place, &MadeFile::days(2).with(marked)).await;
    assert!(!outcome.is_rejected(), "{outcome}");
    assert_eq!(place.newest("dic").await.steps[0].valid_cells, 30);

    let in_km = MadeFile::days(2)
        .but("lat", |axis| axis.text("units", "km"))
        .but("lon", |axis| axis.text("units", "km"))
        .with(river(2));
    let said = refused(&in_km).await;
    assert!(said.contains("no latitude or longitude"), "{said}");
}

#[tokio::test]
async fn the_year_0_is_a_mean_year() {
    let place = Place::new();
    let days: Vec<f64> = (0..12)
        .map(|month| 15.25 + 30.4375 * f64::from(month))
        .collect();
    let file = MadeFile::days(12)
        .numbers("time", &days)
        .but("time", |time| time.text("units", "days since 0000-01-01"))
        .with(river(12));
    let outcome = land(&place, &file).await;
    assert!(!outcome.is_rejected(), "{outcome}");
    let manifest = place.newest("dic").await;
    let months: Vec<(i32, u32)> = manifest
        .steps
        .iter()
        .map(|s| s.period.start.year_month())
        .collect();
    assert_eq!(
        months,
        (1..=12).map(|month| (2000, month)).collect::<Vec<_>>()
    );
}

/// The masks of FluxEngine: codes of oceans as the file has them, at the places that it gives them.
#[tokio::test]
async fn masks_of_fluxengine_land_without_a_profile() {
    let folder = test_data::fluxengine("").parent().unwrap().to_owned();
    let place = Place::new();
    let file = folder.join("World_Seas-final-complete_IGA.nc");
    let outcome = place.land(&[file]).await.remove(0);
    assert!(!outcome.is_rejected(), "{outcome}");
    let manifest = place.newest("world-seas-final-complete-iga").await;
    assert_eq!(open(manifest.quantity).unit, "1");
    let values = place.values(&manifest, 0).await;
    let at = |lon: f64, lat: f64| {
        let place = contract::grid::LonLatDeg::new(lon, lat).unwrap();
        let (row, col) = manifest.grid.cell_at(place).unwrap();
        values[row as usize * 360 + col as usize]
    };
    // As netCDF4 reads them at the labels of the cells' north-western corners.
    let found = [
        at(-30.5, 30.5),
        at(-150.5, 0.5),
        at(80.5, -20.5),
        at(0.5, -65.5),
    ];
    assert_eq!(found, [30.0, 70.0, 50.0, 90.0]);
    assert_eq!(manifest.steps[0].valid_cells, 64_800 - 29_840);
}
