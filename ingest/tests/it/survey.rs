//! The survey of folders: what lands as what, and why the rest does not.

use ingest::{Outcome, data_files, markdown, survey};

use crate::fixture::{Place, SmallFile, settings};

#[tokio::test]
async fn a_survey_tells_of_each_data_file_and_keeps_nothing() {
    let place = Place::new();
    std::fs::create_dir_all(place.path("set-a/deep")).unwrap();
    std::fs::create_dir_all(place.path("set-b")).unwrap();
    SmallFile::new().write_classic(&place.path("set-a/deep/one.nc"));
    let mut other = SmallFile::new();
    other.lat = vec![60.0, 20.0, -20.0, -60.0];
    other.write_classic(&place.path("set-b/other-grid.nc"));
    std::fs::write(place.path("set-b/bad.nc"), "no").unwrap();
    std::fs::write(place.path("set-b/README.txt"), "read me").unwrap();
    let files = data_files(place.folder.path()).unwrap();
    let rows = survey(&files, &[], &settings()).await.unwrap();
    let told: Vec<(&str, &str, bool)> = rows
        .iter()
        .map(|row| {
            (
                row.set.as_str(),
                row.file.as_str(),
                row.outcome.is_rejected(),
            )
        })
        .collect();
    assert_eq!(
        told,
        [
            ("deep", "one.nc", false),
            ("set-b", "bad.nc", true),
            ("set-b", "other-grid.nc", false)
        ],
        "sets do not meet in one product"
    );
    assert!(matches!(rows[0].outcome, Outcome::Landed { .. }));
    let table = markdown(&rows);
    assert!(
        table.contains("| `deep` | 1 | CF | lands in `fgco2` |"),
        "{table}"
    );
    assert!(table.contains("refused (unreadable)"), "{table}");
}
