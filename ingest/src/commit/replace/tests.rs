//! Replacing by hand-made steps: other values, other months, other grids, files that others revised.

use contract::key::ObjectKey;
use contract::manifest::MANIFEST_SCHEMA;
use contract::quantity::Quantity;

use super::*;
use crate::plan::Target;
use crate::plan::Wish;
use crate::plan::recipe::Recipe;
use crate::settings::{DecoderCommand, Settings};

const GRID: Grid = Grid {
    rows: 2,
    cols: 4,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 90.0,
    dlon_deg: 90.0,
};

fn product() -> ProductId {
    "p".parse().unwrap()
}

/// A step of a file in some edition of its values.
fn step(file: &str, month: u32, edition: u32) -> Step {
    let field = Digest::of(format!("{file} {month} {edition}").as_bytes());
    Step {
        masked: None,
        period: Period::month(2000, month).unwrap(),
        field: ObjectKey::field(&product(), &field),
        raw_sha256: Digest::of(file.as_bytes()),
        origin: format!("{file}.nc"),
        valid_cells: 1,
        contributed: None,
    }
}

fn reading(steps: Vec<Step>) -> Reading {
    let target = Target {
        product: product(),
        title: "t".into(),
        source: "s".into(),
        quantity: Quantity::CarbonFlux,
        synthetic: false,
    };
    Reading::new(Recipe::of(Wish::default()), &target, GRID, steps)
}

fn manifest(steps: Vec<Step>) -> Manifest {
    Manifest {
        schema: MANIFEST_SCHEMA,
        product: product(),
        number: 7,
        title: "t".into(),
        quantity: Quantity::CarbonFlux,
        synthetic: false,
        source: "s".into(),
        grid: GRID,
        steps,
        domain: ObjectKey::domain(&product(), &Digest::of(b"")),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
    }
}

#[test]
fn a_file_that_is_read_as_before_changes_nothing() {
    let newest = manifest(vec![step("a", 1, 0), step("b", 2, 0)]);
    let same = reading(vec![step("a", 1, 0)]);
    assert_eq!(next(&newest, &[same]).unwrap(), newest);
    assert_eq!(next(&newest, &[]).unwrap(), newest);
}

#[test]
fn other_values_take_the_place_of_the_old_ones_and_other_files_stay() {
    let newest = manifest(vec![step("a", 1, 0), step("b", 2, 0), step("a", 3, 0)]);
    let anew = reading(vec![step("a", 1, 1), step("a", 3, 1)]);
    let expected = [step("a", 1, 1), step("b", 2, 0), step("a", 3, 1)];
    assert_eq!(next(&newest, &[anew]).unwrap().steps, expected);
}

#[test]
fn a_month_that_another_file_revised_stays_revised() {
    let newest = manifest(vec![step("b", 1, 0), step("a", 2, 0)]);
    let anew = reading(vec![step("a", 1, 1), step("a", 2, 1)]);
    let expected = [step("b", 1, 0), step("a", 2, 1)];
    assert_eq!(next(&newest, &[anew]).unwrap().steps, expected);
    // Nothing of it is left in the product: it is passed over.
    let gone = reading(vec![step("c", 2, 1)]);
    assert_eq!(next(&newest, &[gone]).unwrap(), newest);
}

#[test]
fn all_files_may_move_by_a_month_together_but_not_one_onto_another() {
    let newest = manifest(vec![step("a", 1, 0), step("b", 2, 0)]);
    let (a, b) = (
        reading(vec![step("a", 2, 0)]),
        reading(vec![step("b", 3, 0)]),
    );
    let moved = next(&newest, &[a.clone(), b]).unwrap();
    assert_eq!(moved.steps, [step("a", 2, 0), step("b", 3, 0)]);
    let refused = next(&newest, &[a]).unwrap_err();
    assert!(
        refused.contains("a.nc") && refused.contains("another file"),
        "{refused}"
    );
}

#[test]
fn a_step_that_held_no_value_before_is_added_and_one_that_holds_none_now_goes() {
    let newest = manifest(vec![step("a", 1, 0), step("a", 2, 0)]);
    let anew = reading(vec![step("a", 2, 0), step("a", 3, 0)]);
    let steps = next(&newest, &[anew]).unwrap().steps;
    assert_eq!(steps, [step("a", 2, 0), step("a", 3, 0)]);
}

#[test]
fn another_grid_is_taken_with_all_files_or_not_at_all() {
    let newest = manifest(vec![step("a", 1, 0), step("b", 2, 0)]);
    let shifted = Grid {
        west_deg: -135.0,
        ..GRID
    };
    let on = |grid, file, month| {
        let mut anew = reading(vec![step(file, month, 1)]);
        anew.grid = grid;
        anew
    };
    let (a, b) = (on(shifted, "a", 1), on(shifted, "b", 2));
    assert_eq!(
        next(&newest, &[a.clone(), b.clone()]).unwrap().grid,
        shifted
    );
    assert!(next(&newest, std::slice::from_ref(&a)).is_err());
    assert!(next(&newest, &[a, on(GRID, "b", 2)]).is_err());
    // A billionth of a cell is no other grid.
    let near = Grid {
        west_deg: -180.0 + 1e-7,
        ..GRID
    };
    let both = [on(near, "a", 1), on(near, "b", 2)];
    assert_eq!(next(&newest, &both).unwrap().grid, GRID);
    // What was read off by the rounding of labels of single precision, and is not any more, is put right: by all files.
    let round = Grid {
        west_deg: -180.0 + 1e-5,
        ..GRID
    };
    let (a, b) = (on(round, "a", 1), on(round, "b", 2));
    let part = next(&newest, std::slice::from_ref(&a)).unwrap();
    assert_eq!(part.grid, GRID);
    let all = next(&newest, &[a.clone(), b]).unwrap();
    assert_eq!(all.grid, round);
    // One of them is the product's.
    let one = next(&newest, &[a, on(GRID, "b", 2)]).unwrap();
    assert_eq!(one.grid, GRID);
}

/// Otherwise a notice that is read again could put back what was revised, or an older file go over one read anew.
#[test]
fn a_file_that_is_read_anew_keeps_its_place_in_the_order_of_notices() {
    let order = |second: u32| {
        format!("2020-01-01T00:00:{second:02}Z/0/{second}/0")
            .parse()
            .ok()
    };
    let mut newest = manifest(vec![
        step("a", 1, 0),
        step("b", 2, 0),
        step("a", 3, 0),
        step("c", 4, 0),
    ]);
    newest.notices = NoticeRun::of(&[order(1), order(2), order(3), None]);
    let anew = reading(vec![step("a", 1, 1), step("a", 3, 1), step("a", 5, 1)]);
    let next = next(&newest, &[anew]).unwrap();
    let orders = [order(1), order(2), order(3), None, order(3)];
    assert_eq!(next.notice_orders(), orders);
    assert_eq!(next.steps[4], step("a", 5, 1));
}

/// Fields of steps that come and go are read whole: no more of that than there is memory for.
#[tokio::test]
async fn readings_are_published_once_there_is_memory_for_their_fields() {
    let store = Store::memory();
    let field = async |month: u32, value: f32| {
        let period = Period::month(2000, month).unwrap();
        let written = storage::fields::write(&store, &product(), &GRID, &[value; 8], period).await;
        Step {
            field: written.unwrap(),
            ..step("a", month, 0)
        }
    };
    let mut newest = manifest(vec![field(1, 1.0).await, field(2, 2.0).await]);
    newest.number = 1;
    let cells = [true; 8];
    newest.domain = storage::domain::write(&store, &product(), &cells)
        .await
        .unwrap();
    manifests::commit(&store, &newest).await.unwrap();
    let anew = [reading(vec![field(1, 3.0).await, field(2, 2.0).await])];
    let decoder = DecoderCommand {
        program: "/nowhere".into(),
        arguments: vec![],
    };
    let gates = Gates::new(&Settings {
        parallel_bytes: 1,
        ..Settings::with_decoder(decoder)
    });
    let held = gates.memory(1).await;
    let product = product();
    let mut replaced = Box::pin(replace(&store, &gates, &product, &anew));
    let early = tokio::time::timeout(std::time::Duration::from_millis(300), &mut replaced).await;
    assert!(early.is_err(), "it did not wait: {early:?}");
    drop(held);
    let replaced = replaced.await.unwrap().unwrap();
    assert_eq!((replaced.number, replaced.series.len()), (2, 0));
    assert_eq!(replaced.steps, anew[0].steps);
}
