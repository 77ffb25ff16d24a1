//! Which way a flux is positive: the standard name and the profile agree, one of them says it, or the file is refused.

use contract::event::RejectReason;
use contract::quantity::Quantity;
use ingest::{Outcome, Profile};

use crate::fixture::{Place, refusal};
use crate::made::{Made, MadeFile, Says, Values};

const DOWN: &str = "surface_downward_mass_flux_of_carbon_dioxide_expressed_as_carbon";
const UP: &str = "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon";

fn profile(rest: &str) -> Result<Profile, String> {
    let text = format!(
        "name = 'p'\nproduct = 'flux'\ntitle = 't'\nsource = 's'\nquantity = 'carbon_flux'\n[variable]\nname = 'flux'\n{rest}"
    );
    Profile::parse("p", &text).map_err(|e| e.to_string())
}

/// A flux of 5 in every cell.
fn flux(attributes: &[(&'static str, &'static str)]) -> MadeFile {
    let values = Values::Floats(vec![5.0; 64]);
    let flux = Made::new("flux", &["time", "lat", "lon"], values).text("units", "mg C m-2 d-1");
    let flux = attributes
        .iter()
        .fold(flux, |flux, (name, text)| flux.text(name, text));
    MadeFile::days(2).with(flux)
}

/// Sign of the stored values, or the line of the refusal.
async fn stored(file: &MadeFile, profile: Option<&Profile>) -> Result<f32, String> {
    let place = Place::new();
    file.write(&place.path("a.nc"));
    let outcomes = place.land_with(&[place.path("a.nc")], profile).await;
    if outcomes[0].is_rejected() {
        let (reason, line) = refusal(&outcomes);
        assert_eq!(reason, RejectReason::Values, "{line}");
        eprintln!("{line}");
        return Err(line);
    }
    let Outcome::Landed { manifest, .. } = &outcomes[0] else {
        panic!("{}", outcomes[0])
    };
    let manifest = place.newest(manifest.product.as_str()).await;
    Ok(place.values(&manifest, 0).await[0].signum())
}

#[tokio::test]
async fn a_number_for_no_data_that_a_flux_could_be_is_refused_unless_it_is_marked() {
    let named = [("standard_name", UP)];
    let file = |marked: bool| {
        let mut values = vec![5.0; 64];
        values[10..16].fill(-999.0);
        let flux = Made::new("flux", &["time", "lat", "lon"], Values::Floats(values))
            .text("units", "mg C m-2 d-1")
            .text(named[0].0, named[0].1);
        let mark = Says::Floats(&[-999.0]);
        MadeFile::days(2).with(if marked {
            flux.says("missing_value", mark)
        } else {
            flux
        })
    };
    let line = stored(&file(false), None).await.unwrap_err();
    assert!(
        line.contains("6 cells of -999") && line.contains("fill_values"),
        "{line}"
    );
    assert_eq!(stored(&file(true), None).await.map(f32::is_nan), Ok(false));
}

#[tokio::test]
async fn a_profile_that_contradicts_the_standard_name_is_refused_with_both() {
    for (name, into, word) in [(DOWN, "false", "downward"), (UP, "true", "upward")] {
        let profile = profile(&format!("positive_into_sea = {into}")).unwrap();
        let line = stored(&flux(&[("standard_name", name)]), Some(&profile))
            .await
            .unwrap_err();
        for part in [
            "flux: ",
            name,
            word,
            &format!("positive_into_sea = {into}"),
            "correct the profile",
        ] {
            assert!(line.contains(part), "{part:?} is not in {line:?}");
        }
    }
}

#[tokio::test]
async fn a_profile_that_is_silent_lets_the_standard_name_decide() {
    let silent = profile("").unwrap();
    for (name, sign) in [
        (DOWN, -1.0),
        (UP, 1.0),
        ("surface_downward_flux_of_something_of_its_own", -1.0),
    ] {
        let file = flux(&[("standard_name", name)]);
        assert_eq!(stored(&file, Some(&silent)).await, Ok(sign), "{name}");
    }
    assert_eq!(
        stored(&flux(&[("positive", "down")]), Some(&silent)).await,
        Ok(-1.0)
    );
}

#[tokio::test]
async fn profile_and_standard_name_may_agree_and_the_profile_may_speak_alone() {
    let (into, out) = (
        profile("positive_into_sea = true").unwrap(),
        profile("positive_into_sea = false").unwrap(),
    );
    assert_eq!(
        stored(&flux(&[("standard_name", DOWN)]), Some(&into)).await,
        Ok(-1.0)
    );
    assert_eq!(
        stored(&flux(&[("standard_name", UP)]), Some(&out)).await,
        Ok(1.0)
    );
    assert_eq!(stored(&flux(&[]), Some(&into)).await, Ok(-1.0));
    assert_eq!(stored(&flux(&[]), Some(&out)).await, Ok(1.0));
}

#[tokio::test]
async fn a_flux_of_which_nobody_says_its_sign_is_refused() {
    let silent = profile("").unwrap();
    let line = stored(&flux(&[("standard_name", "flux_of_carbon")]), Some(&silent))
        .await
        .unwrap_err();
    for part in ["flux: ", "which way", "positive_into_sea = true or false"] {
        assert!(line.contains(part), "{part:?} is not in {line:?}");
    }
}

#[tokio::test]
async fn a_standard_name_that_the_attribute_positive_contradicts_is_refused() {
    assert_eq!(
        stored(
            &flux(&[("standard_name", DOWN), ("positive", "down")]),
            None
        )
        .await,
        Ok(-1.0)
    );
    let line = stored(&flux(&[("standard_name", DOWN), ("positive", "up")]), None)
        .await
        .unwrap_err();
    assert!(
        line.contains(DOWN) && line.contains("positive = \"up\""),
        "{line}"
    );
}

/// Without a standard name it is a flux by its unit and its name, and lands as one only if it says the rest.
#[tokio::test]
async fn a_flux_without_a_standard_name_is_one_if_it_says_its_sign_and_else_says_what_it_lacks() {
    let landed = async |attributes: &[(&'static str, &'static str)]| {
        let place = Place::new();
        let named = [("long_name", "air-sea CO2 flux"), ("units", "mol m-2 yr-1")];
        flux(&[&named[..], attributes].concat()).write(&place.path("a.nc"));
        let outcome = place.land(&[place.path("a.nc")]).await.remove(0);
        let Outcome::Landed { assumptions, .. } = outcome else {
            panic!("{outcome}")
        };
        let manifest = place.newest("flux").await;
        let value = f64::from(place.values(&manifest, 0).await[0]);
        let about = assumptions.into_iter();
        let about: Vec<_> = about.filter(|line| line.contains("carbon flux")).collect();
        (manifest.quantity, value, about)
    };
    let carbon = 5.0 / (365.25 * 86_400.0) * 0.012_011;
    for (positive, sign) in [("down", -1.0), ("up", 1.0)] {
        let (quantity, value, about) = landed(&[("positive", positive)]).await;
        assert_eq!(quantity, Quantity::CarbonFlux);
        assert!((value / (sign * carbon) - 1.0).abs() < 1e-6, "{value:e}");
        assert_eq!(about, Vec::<String>::new());
    }
    let (quantity, _, about) = landed(&[]).await;
    assert!(
        matches!(quantity, Quantity::Open(open) if open.words().name == "air_sea_co2_flux"),
        "{quantity:?}"
    );
    let [note] = about.as_slice() else {
        panic!("{about:?}")
    };
    for part in ["which way it is positive", "standard_name", "carbon_flux\""] {
        assert!(note.contains(part), "{note}");
    }
    let (_, _, about) = landed(&[("units", "kg m-2 s-1"), ("positive", "up")]).await;
    assert!(about[0].contains("of carbon or of CO2"), "{about:?}");
}

/// A mass of CO2 by its standard name stays one when the profile spells the unit anew.
#[tokio::test]
async fn of_what_a_mass_is_the_standard_name_says() {
    let place = Place::new();
    let profile = profile("unit = 'mg m-2 d-1'").unwrap();
    let file = flux(&[
        (
            "standard_name",
            "surface_upward_mass_flux_of_carbon_dioxide",
        ),
        ("units", "mg m-2 d-1"),
    ]);
    file.write(&place.path("a.nc"));
    let outcomes = place.land_with(&[place.path("a.nc")], Some(&profile)).await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    let value = f64::from(place.values(&place.newest("flux").await, 0).await[0]);
    let carbon = 5e-6 / 86_400.0 * 12.011 / 44.009;
    assert!(
        (value / carbon - 1.0).abs() < 1e-6,
        "{value:e} is not {carbon:e}"
    );
}

#[test]
fn positive_into_sea_is_refused_of_what_has_no_direction() {
    let text = "name = 'p'\nproduct = 'p'\ntitle = 't'\nsource = 's'\nquantity = 'sea_surface_temperature'\n[variable]\nname = 'sst'\npositive_into_sea = true\n";
    let error = Profile::parse("p", text).unwrap_err().to_string();
    assert!(
        error.contains("positive_into_sea") && error.contains("leave it out"),
        "{error}"
    );
}

/// Depths are counted downwards: a profile without a word lets their standard name turn them.
#[tokio::test]
async fn depths_become_heights_by_a_silent_profile() {
    let text = "name = 'p'\nproduct = 'relief'\ntitle = 't'\nsource = 's'\nquantity = 'elevation'\n[variable]\nname = 'flux'\nunit = 'm'\n[time]\nfrom = { variable = { name = 'time' } }\ncovers = 'day'\n";
    let profile = Profile::parse("p", text).unwrap();
    let file = flux(&[("standard_name", "sea_floor_depth_below_geoid")]);
    assert_eq!(stored(&file, Some(&profile)).await, Ok(-1.0));
}
