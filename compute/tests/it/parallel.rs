//! The same bits however many parts a budget is computed in, and in whatever order files are read.

use std::sync::Arc;

use compute::budget::chunk::mass_steps;
use compute::budget::fixed::{MASS_DECIMALS, decimal_text};
use compute::reduce::statistics;
use compute::region::weights;
use compute::{Engine, Objects};
use contract::budget::BudgetQuery;
use contract::chunk::field_chunks;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::region::Region;
use contract::statistics::StatisticsQuery;
use contract::time::{Period, TimeStep};
use object_store::ObjectStore;

use crate::fixture::{ONE_DEGREE, ask, folder_store, land, parts, product, total, wavy_year};
use crate::reading::{Counting, random_flux};
use crate::statistics::{area, asked};

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_partitions_gives_the_same_bits_with_ballista_and_without() {
    let (_folder, store) = folder_store();
    let id = product("wavy");
    land(
        &store,
        &id,
        Quantity::CarbonFlux,
        ONE_DEGREE,
        &wavy_year(&ONE_DEGREE),
    )
    .await;
    let mut answers = vec![];
    let ballista = [1, 3, 16].map(|count| Engine::standalone(store.clone(), parts(count)));
    let in_process = [1, 2, 8].map(|count| Engine::in_process(store.clone(), parts(count)));
    for engine in ballista.into_iter().chain(in_process) {
        let mut rows = vec![];
        for region in ["global", "equatorial-pacific", "170.5,-33.3,-120.1,12.7"] {
            let query = BudgetQuery {
                step: TimeStep::Month,
                ..total(&id, region)
            };
            rows.push(ask(&engine, &query).await.rows);
        }
        answers.push(rows);
    }
    assert_eq!(answers[0][0].len(), 12);
    assert!(same(&answers), "{answers:#?}");

    // The comparison sees the last digit of one row.
    let mut planted = answers.clone();
    let text = &mut planted[1][2][11].budget_kg;
    let last = text.pop().unwrap();
    text.push(if last == '0' { '1' } else { '0' });
    assert!(!same(&planted));
}

fn same<T: PartialEq>(answers: &[T]) -> bool {
    answers.iter().all(|answer| *answer == answers[0])
}

#[tokio::test(flavor = "multi_thread")]
async fn the_order_of_files_does_not_change_one_bit_but_would_in_floats() {
    // The same cells told as one month's step in other rows: mirrored, then read back in mirrored order by the engine
    // is not to be had from outside, so that the months of a year are handed the same values in another order.
    let year = wavy_year(&ONE_DEGREE);
    let (_folder, store) = folder_store();
    let mut sums = vec![];
    let mut float_sums = vec![];
    for (name, order) in [("a", [0, 1, 2]), ("b", [2, 0, 1]), ("c", [1, 2, 0])] {
        let days = ["2001-01-01", "2001-01-02", "2001-01-03", "2001-01-04"];
        let day =
            |i: usize| Period::new(days[i].parse().unwrap(), days[i + 1].parse().unwrap()).unwrap();
        let steps: Vec<_> = order
            .iter()
            .enumerate()
            .map(|(i, &month)| (day(i), year[month].1.clone()))
            .collect();
        let id = product(name);
        land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &steps).await;
        let engine = Engine::standalone(store.clone(), parts(3));
        sums.push(
            ask(&engine, &total(&id, "global")).await.rows[0]
                .budget_kg
                .clone(),
        );
        float_sums.push(float_sum(steps.iter().map(|(_, values)| values.as_slice())));
    }
    assert!(same(&sums), "{sums:?}");
    assert!(
        !same(&float_sums),
        "the planted fault, a sum of floats in the order of files, is not seen"
    );
}

/// What a naive program would compute.
fn float_sum<'a>(steps: impl Iterator<Item = &'a [f32]>) -> u32 {
    steps
        .flatten()
        .filter(|value| !value.is_nan())
        .map(|value| value * 1e10)
        .sum::<f32>()
        .to_bits()
}

/// A map of 25 x 25 chunks.
const MANY_CHUNKS: Grid = Grid {
    rows: 1500,
    cols: 3000,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 0.12,
    dlon_deg: 0.12,
};
/// Most bytes of values that are read together, and of their checks.
const PIECE_BYTES: u64 = (8 << 20) + (64 << 10);

#[tokio::test(flavor = "multi_thread")]
async fn no_more_of_a_large_map_is_held_than_a_piece_and_all_of_it_is_summed() {
    let (_folder, store) = folder_store();
    let id = product("flux");
    let mut next = random_flux();
    let values: Vec<f32> = (0..MANY_CHUNKS.cell_count()).map(|_cell| next()).collect();
    let month = Period::month(2001, 1).unwrap();
    let steps = [(month, values.clone())];
    let flux = Quantity::CarbonFlux;
    let manifest = land(&store, &id, flux, MANY_CHUNKS, &steps).await;
    let field_bytes = store.size_bytes(&manifest.steps[0].field).await.unwrap();
    assert!(field_bytes > PIECE_BYTES, "the map is no large one");

    let (windows, seconds) = (field_chunks(&MANY_CHUNKS), month.seconds());
    let mut expected = 0;
    for (chunk, areas_m2) in weights::compute(&MANY_CHUNKS, &Region::Global, Earth::Wgs84).unwrap()
    {
        let cells = windows[chunk as usize].cell_indices(&MANY_CHUNKS);
        let own: Vec<f32> = cells.map(|cell| values[cell]).collect();
        expected += mass_steps(&own, &areas_m2, seconds).unwrap();
    }
    let means = StatisticsQuery {
        product: id.clone(),
        ..asked(area("global"), "mean,median,coverage", TimeStep::Total)
    };
    let mut answers = vec![];
    for count in [1, 4] {
        let (root, inner) = store.sql_root();
        let counting = Arc::new(Counting::of(inner));
        let objects = Objects::new(root, Arc::clone(&counting) as Arc<dyn ObjectStore>);
        let engine = Engine::in_process(store.clone(), parts(count)).reading(objects);
        let budget = ask(&engine, &total(&id, "global")).await;
        assert_eq!(
            budget.rows[0].budget_kg,
            decimal_text(expected, MASS_DECIMALS)
        );
        answers.push(statistics(&engine, &means).await.unwrap().rows);
        let most = counting.most_bytes();
        assert!(most <= PIECE_BYTES, "{most} of {field_bytes} bytes at once");
    }
    assert!(same(&answers), "{answers:#?}");
}
