//! Merging by hand-made steps: new, same, revised, overlapping, other grid.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use contract::topic::{Origin, Topic};
use storage::log::Message;

use super::*;
use crate::notice::PendingNotice;
use crate::plan::Target;
use crate::plan::Wish;
use crate::plan::recipe::Recipe;
use crate::put::reading::Reading;
use crate::settings::{DecoderCommand, Settings};

const GRID: Grid = Grid {
    rows: 2,
    cols: 4,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 90.0,
    dlon_deg: 90.0,
};

/// A file that came with the notice of some second.
fn noticed(content: &str, periods: &[Period], second: u32) -> StoredGranule {
    let product: ProductId = "p".parse().unwrap();
    let raw_sha256 = Digest::of(content.as_bytes());
    let step = |period: &Period| {
        let field = ObjectKey::field(
            &product,
            &Digest::of(format!("{content}{period}").as_bytes()),
        );
        Step {
            masked: None,
            period: *period,
            field,
            raw_sha256,
            origin: "f.nc".into(),
            valid_cells: 1,
            contributed: None,
        }
    };
    let target = Target {
        product: product.clone(),
        title: "t".into(),
        source: "s".into(),
        quantity: Quantity::CarbonFlux,
        synthetic: false,
    };
    let steps = periods.iter().map(step).collect();
    StoredGranule {
        notice: Arc::new(notice(second)),
        reading: Reading::new(Recipe::of(Wish::default()), &target, GRID, steps),
        product,
        masked: MaskedCells::default(),
        valued: None,
    }
}

/// A notice of some second of a minute, or of the minutes after it.
fn notice(second: u32) -> PendingNotice {
    let minute: TimeMs = "2020-01-01T00:00:00Z".parse().unwrap();
    let message = Message {
        origin: Origin {
            topic: Topic::GranuleNotice,
            partition: 0,
            offset: 0,
        },
        content: Bytes::new(),
        time: Some(TimeMs::new(minute.ms() + i64::from(second) * 1000).unwrap()),
    };
    let program = "/nowhere".into();
    let arguments = vec![];
    let settings = Settings::with_decoder(DecoderCommand { program, arguments });
    PendingNotice::of(&message, &settings, minute).remove(0)
}

/// A file of a later notice than all that were made before.
fn granule(content: &str, periods: &[Period]) -> StoredGranule {
    static NEXT: AtomicU32 = AtomicU32::new(60);
    noticed(content, periods, NEXT.fetch_add(1, Ordering::Relaxed))
}

fn month(month: u32) -> Period {
    Period::month(2000, month).unwrap()
}

fn placed(first: &StoredGranule) -> Vec<Placed> {
    let merged = merge(None, std::slice::from_ref(first), &[]);
    merged.steps.into_iter().zip(merged.orders).collect()
}

#[test]
fn months_in_any_order_become_steps_in_the_order_of_time() {
    let files: Vec<_> = [3, 1, 2]
        .map(|m| granule(&format!("f{m}"), &[month(m)]))
        .to_vec();
    let merged = merge(None, &files, &[]);
    let periods: Vec<_> = merged.steps.iter().map(|s| s.period).collect();
    assert_eq!(periods, [month(1), month(2), month(3)]);
    assert!(
        merged
            .changes
            .iter()
            .all(|c| matches!(c, Change::Taken { revised: false, .. }))
    );
}

#[test]
fn the_same_file_again_changes_nothing_and_another_content_revises() {
    let mut steps = placed(&granule("a", &[month(1), month(2)]));
    assert_eq!(
        add(&mut steps, &granule("a", &[month(1), month(2)])),
        Change::Same
    );
    assert_eq!(
        add(&mut steps, &granule("b", &[month(2)])),
        Change::Taken {
            revised: true,
            periods: vec![month(2)]
        }
    );
    assert_eq!(steps.len(), 2);
    assert_eq!(steps[1].0.raw_sha256, Digest::of(b"b"));
}

#[test]
fn a_step_across_others_is_refused_and_leaves_them_whole() {
    let mut steps = placed(&granule("a", &[month(1), month(2)]));
    let before = steps.clone();
    let year = Period::year(2000).unwrap();
    let Change::Refused(rejection) = add(&mut steps, &granule("b", &[month(3), year])) else {
        panic!("taken")
    };
    assert_eq!(rejection.reason, RejectReason::Conflict);
    assert_eq!(steps, before);
}

#[test]
fn another_grid_or_quantity_is_a_conflict() {
    let mut other_grid = granule("b", &[month(2)]);
    other_grid.reading.grid.west_deg = -90.0;
    let mut other_quantity = granule("c", &[month(3)]);
    other_quantity.reading.quantity = Quantity::Pco2;
    let mut made_up = granule("d", &[month(4)]);
    made_up.reading.synthetic = true;
    let merged = merge(
        None,
        &[
            granule("a", &[month(1)]),
            other_grid,
            other_quantity,
            made_up,
        ],
        &[],
    );
    assert_eq!(merged.steps.len(), 1);
    for change in &merged.changes[1..] {
        assert!(
            matches!(change, Change::Refused(r) if r.reason == RejectReason::Conflict),
            "{change:?}"
        );
    }
}

#[test]
fn axes_that_differ_by_their_rounding_are_of_one_grid() {
    let round = Grid {
        rows: 100,
        cols: 200,
        north_deg: 40.1,
        west_deg: 120.1,
        dlat_deg: 0.05,
        dlon_deg: 0.05,
    };
    let moved = |deg: f64| Grid {
        west_deg: round.west_deg + deg,
        ..round
    };
    // A label of single precision is off by as much there, more than a ten thousandth of a cell.
    let rounded = moved(7.6e-6);
    assert!(is_same_grid(&rounded, &round) && is_same_grid(&round, &rounded));
    assert!(!is_equal_grid(&rounded, &round));
    assert!(is_equal_grid(&moved(1e-12), &round));
    assert!(!is_same_grid(&moved(0.001), &round));
    // Of small cells that is much of a cell.
    let small = Grid {
        dlon_deg: 1e-4,
        ..round
    };
    let beside = Grid {
        west_deg: small.west_deg + 7.6e-6,
        ..small
    };
    assert!(!is_same_grid(&beside, &small));
}

#[test]
fn a_product_that_landed_at_rounder_places_takes_files_whose_labels_are_taken_at_their_word() {
    let exact = Grid {
        rows: 7,
        cols: 144,
        north_deg: 90.0,
        west_deg: -179.997,
        dlat_deg: 180.0 / 7.0,
        dlon_deg: 2.5,
    };
    let rounder = Grid {
        north_deg: 3.5 * 617.0 / 24.0,
        west_deg: -180.0,
        dlat_deg: 617.0 / 24.0,
        ..exact
    };
    assert!(is_same_grid(&exact, &rounder) && is_same_grid(&rounder, &exact));
    assert!(!is_equal_grid(&exact, &rounder));
    // What no file was ever moved to is another grid.
    let beside = Grid {
        west_deg: -180.003,
        ..rounder
    };
    assert!(!is_same_grid(&exact, &beside));
}

#[test]
fn a_group_ends_before_the_first_period_that_comes_again() {
    let files = [
        granule("a", &[month(1)]),
        granule("b", &[month(2)]),
        granule("c", &[month(1)]),
    ];
    assert_eq!(disjoint_prefix(&files), 2);
    assert_eq!(disjoint_prefix(&files[..2]), 2);
}

/// As many steps as a file may have: with work that grows with their square this test takes minutes.
#[test]
fn a_file_of_very_many_steps_is_told_from_itself_and_from_its_revision() {
    const STEPS: i64 = 100_000;
    const HOUR_MS: i64 = 3_600_000;
    let time = |hour: i64| TimeMs::new(hour * HOUR_MS).unwrap();
    let hour = |hour| Period::new(time(hour), time(hour + 1)).unwrap();
    let periods: Vec<Period> = (0..STEPS).map(hour).collect();
    let [file, revision] = [("a", 1), ("b", 2)].map(|(name, at)| noticed(name, &periods, at));
    assert_eq!(disjoint_prefix(&[file.clone(), file.clone()]), 1);
    let mut steps = placed(&file);
    assert_eq!(steps.len(), periods.len());
    assert_eq!(add(&mut steps, &file), Change::Same);
    let taken = add(&mut steps, &revision);
    let revised = true;
    assert_eq!(taken, Change::Taken { revised, periods });
    assert_eq!(add(&mut steps, &file), Change::Superseded);
}

#[test]
fn files_of_notices_in_any_order_end_as_the_same_steps() {
    let [a, b, c] = [
        noticed("a", &[month(1), month(2)], 1),
        noticed("b", &[month(2), month(3)], 2),
        noticed("c", &[month(1)], 3),
    ];
    let orders = [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    for order in orders {
        let files = order.map(|index| [&a, &b, &c][index]);
        let mut steps = vec![];
        for file in files {
            add(&mut steps, file);
        }
        let contents: Vec<_> = steps.iter().map(|(step, _)| step.raw_sha256).collect();
        assert_eq!(
            contents,
            [b"c", b"b", b"b"].map(|c| Digest::of(c)),
            "{order:?}"
        );
    }
}

#[test]
fn a_file_of_the_same_notice_or_an_earlier_one_is_no_revision() {
    let mut steps = placed(&noticed("a", &[month(1)], 5));
    for second in [5, 4] {
        let late = noticed("b", &[month(1)], second);
        assert_eq!(add(&mut steps, &late), Change::Superseded);
    }
    // Nothing is known of when it was offered.
    steps[0].1 = None;
    let taken = add(&mut steps, &noticed("b", &[month(1)], 4));
    assert!(matches!(taken, Change::Taken { revised: true, .. }));
}
