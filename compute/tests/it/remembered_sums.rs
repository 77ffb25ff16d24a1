//! Sums that one process remembers: whoever was asked before answers as one who was not, and reads nothing twice.

use std::sync::Arc;

use compute::Engine;
use compute::reduce::statistics_of;
use contract::earth::Earth;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::region::{AskedRegion, Cells};
use contract::statistics::{StatisticsQuery, StatisticsRow};
use contract::time::{Period, TimeStep};
use storage::Store;

use crate::fixture::{folder_store, land, parts, product};
use crate::stored_sums::{GRID, compacted, noise};

/// Cells of its coast count in part.
const REGION: &str = "POLYGON((-121 -33,-31 -47,12 9,-44 51,-121 -33))";

async fn rows(engine: &Engine, manifest: &Manifest, query: &StatisticsQuery) -> Vec<StatisticsRow> {
    let answer = statistics_of(engine, query, manifest, manifest.id()).await;
    answer.unwrap().rows
}

/// A product that says how much of each cell is sea.
async fn sea(store: &Store) -> Arc<Manifest> {
    let share = |cell: usize| [0.25, 1.0, 0.5][cell % 3];
    let shares = (0..GRID.cell_count()).map(share).collect();
    let step = (Period::year(2000).unwrap(), shares);
    let quantity = Quantity::SeaAreaFraction;
    Arc::new(land(store, &product("sea"), quantity, GRID, &[step]).await)
}

fn asked(region: &str, statistics: &str, step: TimeStep) -> StatisticsQuery {
    let region: AskedRegion = region.parse().unwrap();
    StatisticsQuery {
        statistics: statistics.parse().unwrap(),
        step,
        ..StatisticsQuery::new(product("p"), region.into())
    }
}

/// Questions that have most in common with one another.
fn questions(sea: &Arc<Manifest>) -> Vec<StatisticsQuery> {
    let plain = asked(REGION, "mean,coverage", TimeStep::Month);
    let of = |statistics: &str| asked(REGION, statistics, TimeStep::Month);
    let ocean = Some(Arc::clone(sea));
    vec![
        plain.clone(),
        of("std,mean"),
        of("min,max"),
        of("min,max,std"),
        asked(REGION, "mean,sum,count", TimeStep::Native),
        asked("-121,-47,12,51", "mean,coverage", TimeStep::Month),
        StatisticsQuery {
            ocean: ocean.clone(),
            ..plain.clone()
        },
        StatisticsQuery {
            cells: Cells::OceanShare,
            ..plain.clone()
        },
        StatisticsQuery {
            cells: Cells::OceanShare,
            ocean,
            ..plain.clone()
        },
        StatisticsQuery {
            earth: Earth::Sphere,
            ..plain.clone()
        },
        // Of runs in part.
        StatisticsQuery {
            from: "1970-02".parse().ok(),
            to: "1970-08".parse().ok(),
            ..plain.clone()
        },
        StatisticsQuery {
            from: "1970-06".parse().ok(),
            ..plain
        },
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn who_was_asked_before_answers_as_one_who_was_not_and_reads_nothing_twice() {
    let (_folder, store) = folder_store();
    // Two runs along time.
    let steps = noise(&GRID, 256, 29);
    let quantity = Quantity::CarbonFlux;
    let manifest = land(&store, &product("p"), quantity, GRID, &steps).await;
    assert_eq!(compacted(&store, &manifest).await, 2);
    let sea = sea(&store).await;
    let questions = questions(&sea);
    let mut right = vec![];
    for query in &questions {
        let fresh = Engine::in_process(store.clone(), parts(2));
        right.push(rows(&fresh, &manifest, query).await);
    }
    for (at, one) in right.iter().enumerate() {
        let same = right.iter().position(|other| other == one);
        assert_eq!(
            same,
            Some(at),
            "two questions have one answer: they prove nothing"
        );
    }
    for is_turned in [false, true] {
        let (counted, traffic) = store.counted();
        let engine = Engine::in_process(counted, parts(2));
        let mut order: Vec<usize> = (0..questions.len()).collect();
        if is_turned {
            order.reverse();
        }
        for at in &order {
            let found = rows(&engine, &manifest, &questions[*at]).await;
            assert!(found == right[*at], "question {at}, turned: {is_turned}");
        }
        let before = traffic.counts();
        for at in &order {
            assert!(rows(&engine, &manifest, &questions[*at]).await == right[*at]);
        }
        let again = traffic.counts().since(before);
        assert!(
            again.read_bytes * 20 < before.read_bytes,
            "{again:?} after {before:?}"
        );
    }
}
