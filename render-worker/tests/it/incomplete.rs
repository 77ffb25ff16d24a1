//! Sums of accumulated carbon that lack data of some of their time: hatched where uncertainty is drawn, and nowhere else.

use contract::job::{Mode, RenderJob, Style};
use contract::manifest::{Contributed, Manifest};
use contract::quantity::Quantity;
use render::Backend;
use storage::{Store, contributed};

use crate::here::Here;
use crate::scenes::{FIVE_DEGREES, job, tile};
use crate::stored::product;

/// West of this column cells lack the second month.
const COMPLETE_FROM_COL: usize = 24;
const COLS: usize = FIVE_DEGREES.cols as usize;

/// Two months of accumulated carbon; of the second one the first `lacking_cols` columns hold no data.
async fn carbon(store: &Store, name: &str, lacking_cols: usize) -> Manifest {
    let months = [0.002_f32, 0.004].map(|value| vec![value; FIVE_DEGREES.cell_count()]);
    let quantity = Quantity::AccumulatedCarbon;
    let mut manifest = product(store, name, quantity, FIVE_DEGREES, &months).await;
    let start = manifest.steps[0].period.start;
    let mut counts = contributed::Contributed::nothing(&FIVE_DEGREES, start);
    for (step, lacking_cols) in manifest.steps.iter_mut().zip([0, lacking_cols]) {
        let cells = 0..FIVE_DEGREES.cell_count();
        let has_data: Vec<bool> = cells.map(|cell| cell % COLS >= lacking_cols).collect();
        counts.add(step.period, &has_data);
        step.valid_cells = FIVE_DEGREES.cell_count() as u64;
        step.contributed = Some(Contributed {
            counts: contributed::write(store, &manifest.product, &FIVE_DEGREES, &counts)
                .await
                .unwrap(),
            complete_cells: counts.complete_cells(),
            since: None,
        });
    }
    manifest.number += 1;
    storage::manifests::commit(store, &manifest).await.unwrap();
    manifest
}

fn map_of(carbon: &Manifest, time: &str, uncertainty: bool) -> RenderJob {
    let view = tile(0, 0, 0, 256);
    let style = Style {
        uncertainty,
        ..job(Mode::Map, view).style
    };
    RenderJob::of(carbon, None, time.parse().unwrap(), Mode::Map, view, style).unwrap()
}

/// Columns of pixels in which two pictures differ.
fn different_columns(one: &[u8], other: &[u8]) -> Vec<u32> {
    let [one, other] = [one, other].map(|png| image::load_from_memory(png).unwrap().into_rgba8());
    let columns = 0..one.width();
    let differs =
        |x: &u32| (0..one.height()).any(|y| one.get_pixel(*x, y) != other.get_pixel(*x, y));
    columns.filter(differs).collect()
}

#[tokio::test]
async fn incomplete_sums_are_hatched_where_uncertainty_is_drawn() {
    let store = Store::memory();
    let carbon = carbon(&store, "carbon", COMPLETE_FROM_COL).await;
    let service = Here::new(store, Backend::Cpu);
    let draw = |job: RenderJob| {
        let service = &service;
        async move { service.draw(&job).await.unwrap() }
    };
    // At the end of the first month all sums are complete, a day later some are not, at the end they lack half.
    for (time, is_hatched) in [
        ("2000-01-20", false),
        ("2000-02-01", false),
        ("2000-02-02", true),
        ("2000-03-01", true),
    ] {
        let plain = draw(map_of(&carbon, time, false)).await;
        let uncertain = draw(map_of(&carbon, time, true)).await;
        let columns = different_columns(&plain, &uncertain);
        assert_eq!(!columns.is_empty(), is_hatched, "{time}");
        // Between centres of cells uncertainty fades, as colours do: half a cell beyond the edge.
        let edge_px = (COMPLETE_FROM_COL as f64 + 0.5) * 256.0 / COLS as f64;
        // The other edge of the map is the date line, which the first column lies at.
        let wrapped = (COLS as f64 - 0.5) * 256.0 / COLS as f64;
        let strays: Vec<_> = columns
            .iter()
            .filter(|&&x| f64::from(x) > edge_px && f64::from(x) + 1.0 < wrapped)
            .collect();
        assert!(strays.is_empty(), "{time}: {strays:?}");
        if is_hatched {
            assert!(columns.len() > 60, "{time}: {}", columns.len());
        }
    }
}

#[tokio::test]
async fn complete_sums_look_the_same_with_uncertainty_and_without() {
    let store = Store::memory();
    let carbon = carbon(&store, "carbon", 0).await;
    let service = Here::new(store, Backend::Cpu);
    for time in ["2000-01-20", "2000-02-20", "2000-03-01"] {
        let [plain, uncertain] =
            [false, true].map(|uncertainty| map_of(&carbon, time, uncertainty));
        assert_eq!(plain.value, uncertain.value, "{time}");
        let pictures = [
            service.draw(&plain).await.unwrap(),
            service.draw(&uncertain).await.unwrap(),
        ];
        assert!(
            different_columns(&pictures[0], &pictures[1]).is_empty(),
            "{time}"
        );
    }
}

#[tokio::test]
async fn the_name_of_a_picture_depends_on_counts_only_where_they_show() {
    let store = Store::memory();
    let (less, more) = (
        carbon(&store, "carbon", 1).await,
        carbon(&store, "carbon-2", COMPLETE_FROM_COL).await,
    );
    // The same fields under the counts of both.
    let mut same = less.clone();
    for (step, other) in same.steps.iter_mut().zip(&more.steps) {
        step.contributed.clone_from(&other.contributed);
    }
    let key = |manifest: &Manifest, uncertainty| map_of(manifest, "2000-02-20", uncertainty).key();
    assert_eq!(key(&less, false), key(&same, false));
    assert_ne!(key(&less, true), key(&same, true));
    let old = {
        let mut old = less.clone();
        for step in &mut old.steps {
            step.contributed = None;
        }
        old
    };
    assert_eq!(key(&old, false), key(&less, false));
    assert_eq!(
        map_of(&old, "2000-02-20", true).value.contributed,
        None,
        "unknown"
    );
}

#[tokio::test]
async fn where_accumulation_starts_what_the_first_step_lacks_is_hatched_at_once() {
    let store = Store::memory();
    let mut carbon = carbon(&store, "carbon", COMPLETE_FROM_COL).await;
    // The second month alone, accumulated from its own start on.
    let mut first = carbon.steps.remove(1);
    let mut counts = contributed::Contributed::nothing(&FIVE_DEGREES, first.period.start);
    let cells = 0..FIVE_DEGREES.cell_count();
    let has_data: Vec<bool> = cells.map(|cell| cell % COLS >= COMPLETE_FROM_COL).collect();
    counts.add(first.period, &has_data);
    first.contributed = Some(Contributed {
        counts: contributed::write(&store, &carbon.product, &FIVE_DEGREES, &counts)
            .await
            .unwrap(),
        complete_cells: counts.complete_cells(),
        since: None,
    });
    carbon.steps = vec![first];
    let service = Here::new(store, Backend::Cpu);
    let pictures =
        [false, true].map(|uncertainty| map_of(&carbon, "2000-02-01T01:00:00Z", uncertainty));
    let plain = service.draw(&pictures[0]).await.unwrap();
    let uncertain = service.draw(&pictures[1]).await.unwrap();
    assert!(different_columns(&plain, &uncertain).len() > 60);
}
