//! Every kind of object is frozen, and some test reads what is frozen of it.

use contract::kind::Kind;
use contract::manifest::{MANIFEST_SCHEMA, OLDEST_MANIFEST_SCHEMA};

use super::{MAX_BYTES, frozen};

/// A kind's oldest frozen version, and the test that reads what is frozen of it: its file and its name.
struct Reader {
    since: u32,
    file: &'static str,
    test: &'static str,
}

/// A new kind of object has no arm here: freeze one of it (`tests/frozen/README.md`), and name the test that reads it.
#[expect(clippy::too_many_lines, reason = "an arm a kind")]
fn reader(kind: Kind) -> Reader {
    let since_1 = |file, test| Reader {
        since: 1,
        file,
        test,
    };
    let since_2 = |file, test| Reader {
        since: 2,
        file,
        test,
    };
    match kind {
        Kind::Raw => since_1(
            "ingest/tests/it/damaged.rs",
            "the_same_values_under_names_of_before_are_no_revision",
        ),
        Kind::Field | Kind::Series | Kind::Domain | Kind::Manifest => since_1(
            "storage/tests/it/frozen.rs",
            "frozen_products_hold_the_values_that_were_put_in",
        ),
        Kind::Weights => since_1(
            "storage/tests/it/frozen.rs",
            "what_is_written_now_is_named_as_in_the_newest_frozen_store",
        ),
        Kind::Contributed => since_2(
            "storage/tests/it/frozen.rs",
            "frozen_counts_are_the_numbers_that_were_put_in",
        ),
        Kind::Sums => since_1(
            "compute/tests/it/frozen.rs",
            "frozen_sums_answer_where_no_field_can",
        ),
        Kind::ManifestPage => since_2(
            "storage/tests/it/frozen.rs",
            "a_frozen_page_holds_the_steps_of_its_manifest",
        ),
        // Versions were listed before.
        Kind::Newest => since_2(
            "storage/tests/it/frozen.rs",
            "a_frozen_hint_leads_to_the_newest_version",
        ),
        // Versions could not be pinned before.
        Kind::Pin => since_2(
            "storage/tests/it/frozen.rs",
            "a_frozen_pin_says_which_version_is_kept_and_why",
        ),
        // Cubes were exported only, never in a store, before.
        Kind::Cube => since_2(
            "cube/tests/it/frozen.rs",
            "a_frozen_cube_holds_the_values_of_its_versions",
        ),
        Kind::Accumulating => since_1(
            "compute/tests/it/frozen.rs",
            "frozen_exact_sums_are_gone_on_from",
        ),
        Kind::Observations | Kind::ObservationIndex => since_1(
            "observations/tests/it/frozen.rs",
            "frozen_observations_are_those_that_were_stored",
        ),
        // Not counted before version 2.
        Kind::ObservationFile => since_2(
            "ingest/src/observation/note.rs",
            "frozen_notes_of_files_of_observations_say_what_they_said",
        ),
        Kind::Reading => since_1(
            "ingest/src/put/reading/tests.rs",
            "frozen_notes_of_readings_say_what_they_said",
        ),
        Kind::Landing => since_1(
            "ingest/src/commit/landing_note.rs",
            "frozen_notes_of_landings_are_known_again",
        ),
        Kind::Tile => since_1(
            "render-worker/tests/it/frozen.rs",
            "a_frozen_picture_is_found_under_the_name_of_its_job",
        ),
        // A comparison of version 1 was of another form under the same folder, and one is made anew where its name is not
        // found; programs of version 1 and of later ones do not agree on a store.
        Kind::Check => since_2(
            "fluxglobe/src/demo/check.rs",
            "a_frozen_comparison_is_shown_as_it_was_made",
        ),
        Kind::Protocol => since_2(
            "fluxglobe/src/protocol.rs",
            "a_store_that_was_frozen_is_agreed_on",
        ),
    }
}

#[test]
fn every_kind_of_every_version_is_frozen_and_read_by_a_test() {
    let workspace = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    for kind in Kind::ALL {
        let Reader { since, file, test } = reader(kind);
        for version in since.max(OLDEST_MANIFEST_SCHEMA)..=MANIFEST_SCHEMA {
            let folder = frozen(version).join("objects").join(kind.folder());
            let files = files_below(&folder);
            assert!(
                !files.is_empty(),
                "no {kind:?} of version {version} is frozen"
            );
            for (path, bytes) in files {
                assert!(bytes <= MAX_BYTES, "{} is too large", path.display());
            }
        }
        let text = std::fs::read_to_string(format!("{workspace}/{file}"))
            .unwrap_or_else(|e| panic!("{file}, which reads a frozen {kind:?}: {e}"));
        assert!(
            text.contains(&format!("fn {test}(")),
            "{file} has no test {test}, which reads a frozen {kind:?}"
        );
    }
}

/// What lies in the frozen folders is of a kind: nobody freezes what nobody reads.
#[test]
fn nothing_is_frozen_that_is_of_no_kind() {
    for version in OLDEST_MANIFEST_SCHEMA..=MANIFEST_SCHEMA {
        let objects = frozen(version).join("objects");
        for entry in std::fs::read_dir(objects).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let is_known = Kind::ALL.iter().any(|kind| kind.folder() == name);
            assert!(is_known, "version {version}: {name}");
        }
    }
}

fn files_below(folder: &std::path::Path) -> Vec<(std::path::PathBuf, u64)> {
    let mut files = vec![];
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let entry = entry.unwrap();
        let metadata = entry.metadata().unwrap();
        if metadata.is_dir() {
            files.extend(files_below(&entry.path()));
        } else {
            files.push((entry.path(), metadata.len()));
        }
    }
    files
}
