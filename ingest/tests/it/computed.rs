//! A product that is made of others takes no files: what landed would stand among means, and be followed as they are.

use contract::event::RejectReason;
use contract::manifest::Manifest;

use crate::fixture::{Place, refusal};
use crate::made::{Made, MadeFile, Values};

fn flux(value: f32) -> MadeFile {
    let values = Values::Floats(vec![value; 64]);
    let flux = Made::new("flux", &["time", "lat", "lon"], values)
        .text("units", "mg C m-2 d-1")
        .text(
            "standard_name",
            "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon",
        );
    MadeFile::days(2).with(flux)
}

#[tokio::test]
async fn a_file_does_not_land_among_what_is_made_of_other_products() {
    let place = Place::new();
    let [first, next] = ["first.nc", "next.nc"].map(|name| place.path(name));
    flux(5.0).write(&first);
    flux(6.0).write(&next);
    assert!(!place.land(std::slice::from_ref(&first)).await[0].is_rejected());
    let landed = place.newest("flux").await;
    // As a statistic says what it is of; whose version that is makes no difference here.
    let made = Manifest {
        number: landed.number + 1,
        derived_from: Some(landed.id()),
        ..landed
    };
    storage::manifests::commit(&place.store, &made)
        .await
        .unwrap();
    let (reason, line) = refusal(&place.land(&[next]).await);
    assert_eq!(reason, RejectReason::Conflict, "{line}");
    assert!(line.contains("flux is made of flux@1-"), "{line}");
    assert_eq!(place.newest("flux").await, made);
}
