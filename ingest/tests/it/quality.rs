//! Which values are data: valid ranges of packed files, and the quality that a profile asks for.

use contract::event::RejectReason;
use ingest::{Outcome, Profile};

use crate::fixture::{Place, refusal};
use crate::made::{Made, MadeFile, Says, Values};

/// Values of the first step of a file that lands, degC, NaN for no data; and what was assumed.
async fn landed(file: &MadeFile, profile: Option<&Profile>) -> (Vec<f32>, Vec<String>) {
    let place = Place::new();
    file.write(&place.path("a.nc"));
    let outcome = place
        .land_with(&[place.path("a.nc")], profile)
        .await
        .remove(0);
    let Outcome::Landed {
        manifest,
        assumptions,
        ..
    } = &outcome
    else {
        panic!("{outcome}")
    };
    let manifest = place.newest(manifest.product.as_str()).await;
    let values = place.values(&manifest, 0).await;
    (
        values.into_iter().map(|v| v - 273.15).collect(),
        assumptions.clone(),
    )
}

async fn refused(file: &MadeFile, profile: &Profile) -> String {
    let place = Place::new();
    file.write(&place.path("a.nc"));
    let (reason, line) = refusal(&place.land_with(&[place.path("a.nc")], Some(profile)).await);
    assert_eq!(reason, RejectReason::Values, "{line}");
    eprintln!("{line}");
    line
}

/// Which cells of the first row hold data.
fn row(values: &[f32]) -> Vec<bool> {
    values[..8].iter().map(|v| !v.is_nan()).collect()
}

/// Packed temperatures: 0.01 degC a number from 10 degC on. The first row is 0, 100, ... 700: 10 to 17 degC.
fn packed(range: &[(&'static str, Says)]) -> MadeFile {
    let numbers = (0..64).map(|i| (i % 8) * 100).collect();
    let sst = Made::new("sst", &["time", "lat", "lon"], Values::Shorts(numbers))
        .text("standard_name", "sea_surface_temperature")
        .text("units", "degC")
        .says("scale_factor", Says::Floats(&[0.01]))
        .says("add_offset", Says::Floats(&[10.0]))
        .says("_FillValue", Says::Shorts(&[100]));
    let sst = range
        .iter()
        .fold(sst, |sst, (name, says)| sst.says(name, *says));
    MadeFile::days(2).with(sst)
}

const Y: bool = true;
const N: bool = false;

#[tokio::test]
async fn a_valid_range_is_of_stored_numbers_or_of_values_by_its_type() {
    let days = [Y, N, Y, Y, Y, Y, N, N];
    for range in [
        vec![("valid_range", Says::Shorts(&[0, 500]))],
        vec![
            ("valid_min", Says::Shorts(&[0])),
            ("valid_max", Says::Shorts(&[500])),
        ],
        vec![("valid_range", Says::Floats(&[10.0, 15.0]))],
        vec![
            ("valid_min", Says::Floats(&[10.0])),
            ("valid_max", Says::Floats(&[15.0])),
        ],
        // No stored number of 16 bits is a half: these are values.
        vec![("valid_range", Says::Doubles(&[9.5, 15.5]))],
        vec![("valid_range", Says::Text("10.0 15.0"))],
        vec![
            ("valid_min", Says::Text("10.0")),
            ("valid_max", Says::Text("15.0")),
        ],
    ] {
        let (values, assumptions) = landed(&packed(&range), None).await;
        assert_eq!(row(&values), days, "{range:?}");
        assert!((values[5] - 15.0).abs() < 1e-4, "{range:?}");
        assert!(
            !assumptions.iter().any(|line| line.contains("valid")),
            "{assumptions:?}"
        );
    }
    let (values, assumptions) = landed(
        &packed(&[("valid_range", Says::Doubles(&[0.0, 500.0]))]),
        None,
    )
    .await;
    assert_eq!(row(&values), days);
    assert!(
        assumptions
            .iter()
            .any(|line| line.contains("sst: valid_range is float64")),
        "{assumptions:?}"
    );
}

#[tokio::test]
async fn unsigned_bytes_have_a_range_and_a_fill_value_of_their_own() {
    let numbers: Vec<i8> = (0..64)
        .map(|i| [0, 50, 100, 127, -56, -6, -5, -1][i % 8])
        .collect();
    let sst = Made::new("sst", &["time", "lat", "lon"], Values::Bytes(numbers))
        .text("standard_name", "sea_surface_temperature")
        .text("units", "degC")
        .text("_Unsigned", "true")
        .says("scale_factor", Says::Floats(&[0.125]))
        .says("_FillValue", Says::Bytes(&[-1]))
        .says("valid_range", Says::Bytes(&[0, -6]));
    let (values, _) = landed(&MadeFile::days(2).with(sst), None).await;
    assert_eq!(row(&values), [Y, Y, Y, Y, Y, Y, N, N]);
    assert!(
        (values[4] - 25.0).abs() < 1e-4 && (values[5] - 31.25).abs() < 1e-4,
        "{values:?}"
    );
}

fn profile(quality: &str) -> Profile {
    parsed(quality).unwrap()
}

fn parsed(quality: &str) -> Result<Profile, String> {
    let text = format!(
        "name = 'p'\nproduct = 'sst'\ntitle = 't'\nsource = 's'\nquantity = 'sea_surface_temperature'\n[variable]\nname = 'sst'\n{quality}"
    );
    Profile::parse("p", &text).map_err(|e| e.to_string())
}

/// A layer of bytes beside the temperatures: these in each row, `steps` times over.
fn layer(name: &'static str, dimensions: &[&'static str], bytes: [i8; 8], steps: usize) -> Made {
    let numbers = (0..32 * steps).map(|i| bytes[i % 8]).collect();
    Made::new(name, dimensions, Values::Bytes(numbers))
}

const ALL: [&str; 3] = ["time", "lat", "lon"];

#[tokio::test]
async fn levels_are_kept_within_what_the_profile_asks() {
    let levels = layer("quality_level", &ALL, [0, 1, 2, 3, 4, 5, -128, 5], 2)
        .says("_FillValue", Says::Bytes(&[-128]));
    let file = MadeFile::sst(2).with(levels);
    for (quality, expected) in [
        ("at_least = 4", [N, N, N, N, Y, Y, N, Y]),
        ("at_most = 1", [Y, Y, N, N, N, N, N, N]),
        ("at_least = 2\nat_most = 4", [N, N, Y, Y, Y, N, N, N]),
        ("reject_values = [0, 5]", [N, Y, Y, Y, Y, N, N, N]),
    ] {
        let asked = profile(&format!("[quality]\nvariable = 'quality_level'\n{quality}"));
        let (values, assumptions) = landed(&file, Some(&asked)).await;
        assert_eq!(row(&values), expected, "{quality}");
        assert!(
            !assumptions.iter().any(|line| line.contains("quality")),
            "{assumptions:?}"
        );
    }
    let (values, assumptions) = landed(&file, None).await;
    assert_eq!(row(&values), [Y; 8]);
    assert!(
        assumptions
            .iter()
            .any(|line| line.contains("sst: every value is taken")
                && line.contains("\"quality_level\"")),
        "{assumptions:?}"
    );
}

#[tokio::test]
async fn flags_are_kept_and_rejected_by_name() {
    // One map for all steps; its range thinks of one bit at a time.
    let masks = layer("mask", &["lat", "lon"], [1, 2, 3, 9, 4, 8, 0, -128], 1)
        .text("flag_meanings", "water land lake ice odd")
        .says("flag_masks", Says::Bytes(&[1, 2, 4, 8, -128]))
        .says("valid_max", Says::Bytes(&[8]));
    let values = layer("mask", &ALL, [0, 1, 2, 0, 1, 2, 3, 4], 2)
        .text("flag_meanings", "water land ice")
        .says("flag_values", Says::Bytes(&[0, 1, 2]));
    for (mask, rules, expected) in [
        (&masks, "reject_flags = ['land']", [Y, N, N, Y, Y, Y, Y, Y]),
        (
            &masks,
            "reject_flags = ['land', 'odd']",
            [Y, N, N, Y, Y, Y, Y, N],
        ),
        // Land with water in it is kept where only ice is rejected.
        (
            &masks,
            "keep_flags = ['water', 'lake']\nreject_flags = ['ice']",
            [Y, N, Y, N, Y, N, N, N],
        ),
        (
            &values,
            "reject_flags = ['land', 'ice']",
            [Y, N, N, Y, N, N, Y, Y],
        ),
        (&values, "keep_flags = ['water']", [Y, N, N, Y, N, N, N, N]),
    ] {
        let asked = profile(&format!("[quality]\nvariable = 'mask'\n{rules}"));
        let (values, _) = landed(&MadeFile::sst(2).with(mask.clone()), Some(&asked)).await;
        assert_eq!(row(&values), expected, "{rules}");
    }
}

#[tokio::test]
async fn what_a_profile_asks_and_the_file_lacks_is_refused() {
    let asked = |rules: &str| profile(&format!("[quality]\nvariable = 'mask'\n{rules}"));
    let mask = layer("mask", &ALL, [0; 8], 2)
        .text("flag_meanings", "water land")
        .says("flag_values", Says::Bytes(&[0, 1]));
    let file = |mask: Made| MadeFile::sst(2).with(mask);
    let line = refused(&MadeFile::sst(2), &asked("at_least = 4")).await;
    assert!(
        line.contains("mask: ") && line.contains("not in the file") && line.contains("[quality]"),
        "{line}"
    );
    let line = refused(&file(mask.clone()), &asked("reject_flags = ['cloud']")).await;
    assert!(
        line.contains("no flag \"cloud\"") && line.contains("water land"),
        "{line}"
    );
    let wordy = mask.clone().text("flag_meanings", "0=open water, 1=land");
    let line = refused(&file(wordy), &asked("reject_flags = ['land']")).await;
    assert!(
        line.contains("3 words in flag_meanings for 2 flags") && line.contains("reject_values"),
        "{line}"
    );
    let bare = layer("mask", &ALL, [0; 8], 2);
    let line = refused(&file(bare), &asked("keep_flags = ['water']")).await;
    assert!(
        line.contains("no flag_meanings") && line.contains("at_least"),
        "{line}"
    );
    let other = Made::new("mask", &["lon", "lat"], Values::Bytes(vec![0; 32]));
    let line = refused(&file(other), &asked("at_least = 4")).await;
    assert!(
        line.contains("shape lon 8 x lat 4") && line.contains("time 2 x lat 4 x lon 8"),
        "{line}"
    );
    let line = refused(&file(mask), &asked("at_least = 4")).await;
    assert!(
        line.contains("sst: ") && line.contains("good enough by \"mask\""),
        "{line}"
    );
}

#[test]
fn quality_without_a_rule_or_with_an_unknown_key_is_refused() {
    let error = parsed("[quality]\nvariable = 'mask'").unwrap_err();
    assert!(
        error.contains("[quality]") && error.contains("at_least"),
        "{error}"
    );
    let error = parsed("[quality]\nvariable = 'mask'\nat_laest = 4").unwrap_err();
    assert!(error.contains("at_laest"), "{error}");
}

/// The shipped profiles of families that have a layer of quality use it.
#[tokio::test]
async fn shipped_profiles_use_the_quality_of_their_families() {
    let modis = packed(&[
        ("valid_min", Says::Shorts(&[-1000])),
        ("valid_max", Says::Shorts(&[10_000])),
    ])
    .with(
        layer("qual_sst", &ALL, [0, 0, 1, 2, 3, 4, -1, 0], 2)
            .says("_FillValue", Says::Bytes(&[-1])),
    )
    .text("platform", "Aqua");
    for (name, product) in [
        (
            "AQUA_MODIS.20100101_20100131.L3m.MO.SST.sst.9km.nc",
            "modis-aqua-sst-month",
        ),
        (
            "A20100012010008.L3m_8D_SST_sst_4km.nc",
            "modis-aqua-sst-8day",
        ),
        ("AQUA_MODIS.20100101_20100131.L3m.MO.NSST.sst.9km.nc", "sst"),
    ] {
        let place = Place::new();
        modis
            .clone()
            .text("product_name", name)
            .write(&place.path("a.nc"));
        let outcomes = place.land(&[place.path("a.nc")]).await;
        assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
        let values = place.values(&place.newest(product).await, 0).await;
        let expected = if product == "sst" {
            [Y, N, Y, Y, Y, Y, Y, Y]
        } else {
            [Y, N, Y, N, N, N, N, Y]
        };
        assert_eq!(row(&values), expected, "{name}");
    }
    let named = |from: &'static str, to: &'static str| {
        MadeFile::sst(2).but(from, |v| Made { name: to, ..v })
    };
    let levels = layer("quality_level", &ALL, [0, 1, 2, 3, 4, 5, 4, 5], 2);
    let l3 = Profile::find("ghrsst-l3-sst").unwrap();
    let (values, _) = landed(
        &named("sst", "sea_surface_temperature").with(levels),
        Some(&l3),
    )
    .await;
    assert_eq!(row(&values), [N, N, N, N, Y, Y, Y, Y]);
    let mask = layer("mask", &ALL, [1, 2, 5, 9, 13, 2, 1, 3], 2)
        .text("flag_meanings", "water land optional_lake_surface sea_ice")
        .says("flag_masks", Says::Bytes(&[1, 2, 4, 8]));
    let analysed = named("sst", "analysed_sst").with(mask);
    let l4 = Profile::find("ghrsst-l4-sst").unwrap();
    assert_eq!(
        row(&landed(&analysed, Some(&l4)).await.0),
        [Y, N, Y, Y, Y, N, Y, N]
    );
    let place = Place::new();
    let path = place.path("20230101120000-UKMO-L4_GHRSST-SSTfnd-OSTIA-GLOB-v02.0-fv02.0.nc");
    analysed.write(&path);
    place.land(&[path]).await;
    assert_eq!(
        row(&place.values(&place.newest("ostia-sst").await, 0).await),
        [Y, N, Y, Y, Y, N, Y, N]
    );
}

/// Masks of RECCAP2 say no time and no unit, and 0 where a cell is in no basin.
#[tokio::test]
async fn masks_of_reccap2_are_known_by_name_and_have_codes_where_there_is_a_basin() {
    let place = Place::new();
    let codes: Vec<i8> = (0..32).map(|cell| cell % 6).collect();
    let made = |name, codes: &[i8]| {
        let values = Values::Bytes(codes.to_vec());
        Made::new(name, &["lat", "lon"], values)
    };
    let mut file = MadeFile::days(1)
        .with(made("open_ocean", &codes))
        .with(made("southern", &[1; 32]));
    file.variables.retain(|variable| variable.name != "time");
    let path = place.path("RECCAP2_region_masks_all_v20221025.nc");
    file.write(&path);
    let outcomes = place.land(&[path]).await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    let manifest = place.newest("reccap2-basins").await;
    assert_eq!(manifest.steps.len(), 1, "a mask is one map");
    for (code, value) in codes.iter().zip(place.values(&manifest, 0).await) {
        let is_it = match code {
            0 => value.is_nan(),
            code => value.to_bits() == f32::from(*code).to_bits(),
        };
        assert!(is_it, "{code}: {value}");
    }
}
