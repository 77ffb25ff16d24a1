//! Every version that lands is a cube of the store, too; one that could not follow is no reason to fail, and is made good.

use contract::manifest::Manifest;
use cube::{At, Repository};
use ingest::Outcome;
use storage::{Store, fields};

use crate::fixture::{Place, SmallFile, settings};

/// Does the cube of a product hold a version, newest and by its number?
pub(crate) async fn holds(store: &Store, manifest: &Manifest) {
    let repository = Repository::open(store, &cube::folder(&manifest.product)).await;
    let repository = repository.unwrap();
    for at in [At::Newest, At::Version(manifest.number.to_string())] {
        let cube = repository.at(&at).await.unwrap();
        assert_eq!(cube.description().version, Some(manifest.id()), "{at:?}");
        assert_eq!(cube.steps().len(), manifest.steps.len());
        for (place, step) in manifest.steps.iter().enumerate() {
            assert_eq!(cube.steps()[place].period, step.period);
            let field = fields::read(store, &step.field, &manifest.grid).await;
            let (field, found) = (field.unwrap(), cube.field(place).await.unwrap());
            let same = |(a, b): (&f32, &f32)| a == b || (a.is_nan() && b.is_nan());
            assert!(field.iter().zip(&found).all(same), "step {place}");
        }
    }
}

/// Two months, and the next two.
fn write_files(place: &Place) -> [std::path::PathBuf; 2] {
    let files = [place.path("a.nc"), place.path("b.nc")];
    SmallFile::new().write_classic(&files[0]);
    let later = SmallFile {
        time_unit: Some("days since 2001-03-01"),
        ..SmallFile::new()
    };
    later.write_classic(&files[1]);
    files
}

#[tokio::test]
async fn each_version_that_lands_is_one_of_its_cube() {
    let place = Place::new();
    let files = write_files(&place);
    for (at, file) in files.iter().enumerate() {
        place.land(std::slice::from_ref(file)).await;
        let newest = place.newest("fgco2").await;
        assert_eq!(
            (newest.number, newest.steps.len()),
            (at as u64 + 1, 2 * at + 2)
        );
        holds(&place.store, &newest).await;
    }
    let mut revision = SmallFile::new();
    revision
        .values
        .iter_mut()
        .filter(|it| **it > 0.0)
        .for_each(|it| *it += 1.0);
    revision.write_classic(&files[0]);
    let outcomes = place.land(&files[..1]).await;
    assert!(matches!(outcomes[0], Outcome::Landed { revised: true, .. }));
    holds(&place.store, &place.newest("fgco2").await).await;
    let repository = Repository::open(&place.store, "cubes/fgco2").await.unwrap();
    assert_eq!(repository.versions().await.unwrap(), ["1", "2", "3"]);
}

/// A file stands where the folder of cubes belongs.
#[tokio::test]
async fn a_cube_that_cannot_be_written_fails_no_landing_and_is_brought_up_by_the_next() {
    let place = Place::new();
    let files = write_files(&place);
    let folder = place.path("store");
    std::fs::create_dir_all(&folder).unwrap();
    let blocked = folder.join("cubes");
    std::fs::write(&blocked, "in the way").unwrap();
    let store = Store::open(folder.to_str().unwrap()).unwrap();
    let log = std::sync::Arc::new(place.log.clone());
    let service = ingest::IngestService::new(store.clone(), log, settings());
    service.notify(&files[..1], None, None).await.unwrap();
    let outcomes = service.drain(&ingest::Quiet).await.unwrap();
    assert!(
        matches!(outcomes[0], Outcome::Landed { .. }),
        "{outcomes:?}"
    );
    assert!(blocked.is_file(), "nothing stood in the way");
    std::fs::remove_file(&blocked).unwrap();
    service.notify(&files[1..], None, None).await.unwrap();
    service.drain(&ingest::Quiet).await.unwrap();
    let newest = storage::manifests::latest(&store, &"fgco2".parse().unwrap()).await;
    holds(&store, &newest.unwrap().unwrap()).await;
}
