//! The plan of a question to a cluster: what passes from part to part.

use std::num::NonZeroUsize;

use contract::digest::Digest;
use contract::manifest::ManifestId;
use cube::scale::Scale;
use cube::weight_unit::WeightUnit;
use datafusion::arrow::util::pretty::pretty_format_batches;
use storage::Store;

use super::*;
use crate::Objects;
use crate::reduce::histogram::Buckets;
use crate::reduce::inside::InsideRun;
use crate::reduce::question::{Layout, Wanted};

fn version() -> ManifestId {
    "p@1-0123abcd".parse().unwrap()
}

pub(in crate::reduce) fn question() -> Question {
    Question {
        version: version(),
        shape: [16, 16],
        whole: "computed:{'quoted'}".into(),
        covered: "computed:{}".into(),
        unit: WeightUnit::default(),
        scale: Scale::of_all(),
        wanted: Wanted::Sums {
            with_squares: true,
            with_extremes: true,
        },
    }
}

fn pieces(count: u32) -> Vec<Piece> {
    let piece = |at: u32| {
        let digest = Digest::of(&at.to_le_bytes());
        Piece {
            key: ObjectKey::field(&"p".parse().unwrap(), &digest),
            address: format!("memory:///{at}").into(),
            layout: Layout::Blocks,
            first_step: at * 5,
            steps: 0..5,
            rows: [0, 1].into(),
            inside: vec![],
        }
    };
    (0..count).map(piece).collect()
}

/// A question of so many pieces, in one task.
pub(crate) fn task_of_pieces(count: u32) -> Task {
    Task {
        question: question(),
        pieces: pieces(count),
    }
}

/// What a client asks a cluster.
pub(crate) fn sql_of(task: &Task) -> String {
    sql(std::slice::from_ref(task))
}

async fn plan(tasks: &[Task]) -> String {
    let engine = Engine::in_process(Store::memory(), NonZeroUsize::new(4).unwrap());
    let sql = format!("EXPLAIN FORMAT INDENT {}", sql(tasks));
    let job = Digest::of(b"plan");
    let batches = engine.answer(job, |context| ask(context, &sql)).await;
    let batches = batches.unwrap();
    let physical = batches.iter().find_map(|batch| {
        let kinds = batch.column(0).as_string::<i32>();
        let at = (0..batch.num_rows()).find(|row| kinds.value(*row) == "physical_plan")?;
        Some(batch.column(1).as_string::<i32>().value(at).to_owned())
    });
    physical.unwrap_or_else(|| pretty_format_batches(&batches).unwrap().to_string())
}

#[test]
fn every_piece_is_in_one_task_and_no_task_is_idle() {
    for (pieces_count, places) in [(9, 4), (2, 7), (1, 1), (0, 5), (100, 3)] {
        let tasks = task_of_pieces(pieces_count).dealt(places);
        assert!(tasks.len() <= (pieces_count as usize).max(1));
        assert!(tasks.len() >= (pieces_count as usize).min(places));
        assert!(pieces_count == 0 || tasks.iter().all(|task| !task.pieces.is_empty()));
        let mut firsts: Vec<u32> = tasks
            .iter()
            .flat_map(|task| task.pieces.iter().map(|piece| piece.first_step))
            .collect();
        firsts.sort_unstable();
        let all: Vec<u32> = (0..pieces_count).map(|at| at * 5).collect();
        assert_eq!(firsts, all);
        let text = tasks[0].text();
        assert_eq!(Task::of_text(&text).unwrap().text(), text);
    }
}

/// When all tasks are done that are taken in their order by workers of these speeds, each as soon as it is free.
fn done(tasks: &[Task], speeds: &[f64]) -> f64 {
    let mut free = vec![0.0; speeds.len()];
    for task in tasks {
        let first = free.iter().copied().fold(f64::INFINITY, f64::min);
        let worker = free.iter().position(|at| *at <= first).unwrap();
        let cost = task.pieces.iter().map(Piece::cost_bytes).sum::<u64>() as f64;
        free[worker] += cost / speeds[worker];
    }
    free.into_iter().fold(0.0, f64::max)
}

#[test]
fn tasks_end_together_whatever_the_order_of_pieces_and_however_quick_each_worker_is() {
    // A run of a region is some pieces of values and one of sums, one after the other.
    let kinds = |at: u32, piece: Piece| match at % 4 {
        3 => Piece {
            layout: Layout::Sums,
            inside: vec![InsideRun::over(0..=9)],
            ..piece
        },
        _ => Piece {
            rows: (0..200 + at % 7).collect(),
            steps: 0..128,
            ..piece
        },
    };
    let pieces = (0..).zip(pieces(1000));
    let all = Task {
        question: question(),
        pieces: pieces.map(|(at, piece)| kinds(at, piece)).collect(),
    };
    let whole = done(std::slice::from_ref(&all), &[1.0]);
    for places in [1, 2, 8, 16] {
        let tasks = all.clone().dealt(places);
        assert!(
            (done(&tasks, &[1.0]) - whole).abs() < 1.0,
            "nothing is lost"
        );
        let even = done(&tasks, &vec![1.0; places]);
        assert!(even * places as f64 <= whole * 1.06, "{places}: {even}");
        let mut speeds = vec![1.0; places];
        speeds[0] = 0.6;
        let uneven = done(&tasks, &speeds);
        let best = whole / speeds.iter().sum::<f64>();
        assert!(uneven <= best * 1.08, "{places}: {uneven}, {best}");
        // To hand one out takes a while.
        assert!(tasks.len() <= 20 * places + 8, "{places}: {}", tasks.len());
    }
}

#[test]
fn a_task_has_steps_side_by_side_and_is_told_of_no_others() {
    // Two pieces of each run, which come run by run or all of a kind.
    let twice = pieces(12).into_iter().chain(pieces(12)).collect();
    let ranges: Vec<Buckets> = (0..60).map(|at| Buckets::new(at, at + 9, 4)).collect();
    let all = Task {
        question: Question {
            wanted: Wanted::Histograms {
                ranges: ranges.clone(),
                steps: (0..60).map(|step| (step, vec![(step, 1)])).collect(),
            },
            ..question()
        },
        pieces: twice,
    };
    let mut next = 0;
    for task in all.dealt(5) {
        let starts = task.pieces.iter().map(|piece| piece.first_step);
        let starts: Vec<u32> = starts.collect();
        let (first, last) = (starts[0], starts[starts.len() - 1]);
        assert!(starts.is_sorted() && first <= next, "{starts:?}");
        // At most the last run of the task before goes on in this one.
        assert!(next <= first + 5, "{starts:?} after {next}");
        next = last + 5;
        let Wanted::Histograms { ranges: own, steps } = &task.question.wanted else {
            panic!("another question");
        };
        assert_eq!(*own, ranges);
        let told: Vec<u32> = steps.keys().copied().collect();
        assert_eq!(told, (first..last + 5).collect::<Vec<u32>>());
    }
    assert_eq!(next, 60);
}

#[tokio::test]
async fn a_task_whose_values_are_not_along_time_here_says_so_instead_of_reading_others() {
    let store = Store::memory();
    let run = async |objects: &Objects| task_of_pieces(2).run(objects).await;
    let (root, objects) = store.sql_root();
    assert_eq!(run(&Objects::new(root, objects)).await.unwrap(), None);
    // Nor is the version of this store.
    assert_eq!(run(&Objects::of(&store)).await.unwrap(), None);
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_but_what_tasks_accumulated_passes_from_part_to_part() {
    let tasks = task_of_pieces(9).dealt(4);
    let plan = plan(&tasks).await;
    let count = |word: &str| plan.matches(word).count();
    assert_eq!(count("AsyncFuncExec"), tasks.len(), "{plan}");
    assert_eq!(
        (count("UnionExec"), count("mode=Partial")),
        (1, 1),
        "{plan}"
    );
    assert_eq!(count("CoalescePartitionsExec"), 1, "{plan}");
    // No values are in it, so that none can be sent on: they are read inside of the function.
    for never in ["RepartitionExec", "JoinExec", "DataSourceExec", "Sort"] {
        assert_eq!(count(never), 0, "{never}: {plan}");
    }
    let partial = plan.find("mode=Partial").unwrap();
    assert!(
        plan.find("CoalescePartitionsExec").unwrap() < partial,
        "{plan}"
    );
    assert!(partial < plan.find("UnionExec").unwrap(), "{plan}");
}
