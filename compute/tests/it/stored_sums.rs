//! Sums of blocks that compaction stores: the same bits as without them, used where they are valid and nowhere else.

use std::collections::BTreeSet;

use bytes::Bytes;
use compute::Engine;
use compute::reduce::statistics_of;
use contract::earth::Earth;
use contract::geometry::AskedGeometry;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::region::Cells;
use contract::statistics::{StatisticsQuery, StatisticsRow};
use contract::time::{Period, TimeMs, TimeStep};
use storage::Store;

use crate::fixture::{folder_store, land, parts, product};

/// Cells of 2 degrees: at the north and in the east blocks are cut.
pub(crate) const GRID: Grid = Grid {
    rows: 90,
    cols: 179,
    north_deg: 90.0,
    west_deg: -178.0,
    dlat_deg: 2.0,
    dlon_deg: 2.0,
};
/// So wide that it has many shards: 33 of them side by side.
const WIDE: Grid = Grid {
    rows: 16,
    cols: 16_400,
    north_deg: 16.0,
    west_deg: 100.0,
    dlat_deg: 1.0,
    dlon_deg: 0.01,
};
const FOLDER: &str = "cubes/p";
/// Statistics that stored sums know.
const KNOWN: &str = "mean,sum,std,count,coverage";

/// Numbers that look like none, from a seed.
struct Random(u64);

impl Random {
    /// From 0 to 1.
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    /// A star of so many corners round a place.
    fn ring(&mut self, [lon, lat]: [f64; 2], [least, most]: [f64; 2]) -> String {
        let count = 3 + (self.next() * 9.0) as usize;
        let turn = self.next();
        let corner = |at: usize, radius: f64| {
            let angle = (at as f64 / count as f64 + turn) * std::f64::consts::TAU;
            let (lon, lat) = (lon + radius * angle.cos(), lat + radius * angle.sin());
            format!("{lon} {}", lat.clamp(-90.0, 90.0))
        };
        let corners: Vec<String> = (0..count)
            .map(|at| corner(at, self.between(least, most)))
            .collect();
        format!("({},{})", corners.join(","), corners[0])
    }

    fn polygon(&mut self) -> String {
        let middle = [self.between(-185.0, 185.0), self.between(-70.0, 70.0)];
        let most = self.between(5.0, 70.0);
        let outer = self.ring(middle, [most * 0.6, most]);
        if self.next() < 0.4 {
            let hole = self.ring(middle, [most * 0.1, most * 0.4]);
            format!("POLYGON({outer},{hole})")
        } else {
            format!("POLYGON({outer})")
        }
    }
}

fn days(count: usize) -> impl Iterator<Item = Period> {
    let day = |at: usize| TimeMs::new(at as i64 * 86_400_000).unwrap();
    (0..count).map(move |at| Period::new(day(at), day(at + 1)).unwrap())
}

/// Days of noise with land and with gaps that come and go.
pub(crate) fn noise(grid: &Grid, count: usize, seed: u64) -> Vec<(Period, Vec<f32>)> {
    let mut random = Random(seed);
    let step = |period| {
        let value = |cell: usize| {
            let (row, col) = (cell / grid.cols as usize, cell % grid.cols as usize);
            let value = ((random.next() - 0.5) * 1e-7) as f32;
            let is_land = (row / 7 + col / 11) % 4 == 0;
            let is_gap = col % 50 < 20 && random.next() < 0.1;
            if is_land || is_gap { f32::NAN } else { value }
        };
        (period, (0..grid.cell_count()).map(value).collect())
    };
    days(count).map(step).collect()
}

fn area(region: &str) -> AskedGeometry {
    region
        .parse::<contract::region::AskedRegion>()
        .unwrap()
        .into()
}

fn asked(region: &str, statistics: &str) -> StatisticsQuery {
    StatisticsQuery {
        statistics: statistics.parse().unwrap(),
        step: TimeStep::Native,
        ..StatisticsQuery::new(product("p"), area(region))
    }
}

/// What nobody who was asked before knows the answer to.
async fn rows(
    store: &Store,
    manifest: &Manifest,
    query: &StatisticsQuery,
) -> Result<Vec<StatisticsRow>, String> {
    let engine = Engine::in_process(store.clone(), parts(2));
    let answer = statistics_of(&engine, query, manifest, manifest.id()).await;
    answer.map(|own| own.rows).map_err(|e| e.to_string())
}

pub(crate) async fn compacted(store: &Store, manifest: &Manifest) -> usize {
    cube::follow(store, manifest).await.unwrap();
    cube::compact(store, FOLDER).await.unwrap()
}

/// A product in two stores: in one with a cube that has sums, in the other as fields alone.
struct Both {
    _folders: [tempfile::TempDir; 2],
    with: Store,
    without: Store,
    manifest: Manifest,
}

impl Both {
    async fn of(quantity: Quantity, grid: Grid, steps: &[(Period, Vec<f32>)]) -> Self {
        let ((own, with), (other, without)) = (folder_store(), folder_store());
        let manifest = land(&with, &product("p"), quantity, grid, steps).await;
        land(&without, &product("p"), quantity, grid, steps).await;
        assert!(compacted(&with, &manifest).await > 0);
        Self {
            _folders: [own, other],
            with,
            without,
            manifest,
        }
    }

    async fn agree_on(&self, query: &StatisticsQuery) -> Vec<StatisticsRow> {
        let found = rows(&self.with, &self.manifest, query).await.unwrap();
        let right = rows(&self.without, &self.manifest, query).await.unwrap();
        assert!(found == right, "{}", query.geometry_name);
        found
    }
}

/// Objects of the time-major copy and of sums, among others: the largest.
async fn chunks(store: &Store) -> Vec<ObjectKey> {
    let mut all = vec![];
    for key in store.list(&format!("{FOLDER}/chunks")).await.unwrap() {
        all.push((store.get(&key).await.unwrap().len(), key));
    }
    all.sort_unstable_by(|a, b| b.cmp(a));
    all.into_iter().take(6).map(|(_length, key)| key).collect()
}

/// Damages many parts of an object, not its end, and gives back what it was.
async fn flip(store: &Store, key: &ObjectKey) -> Bytes {
    let whole = store.get(key).await.unwrap();
    let mut content = whole.to_vec();
    for at in (0..whole.len() * 3 / 4).step_by(97) {
        content[at] ^= 1;
    }
    store.put_over(key, content.into()).await.unwrap();
    whole
}

#[tokio::test(flavor = "multi_thread")]
async fn any_region_has_the_same_bits_with_stored_sums_and_without() {
    let both = Both::of(Quantity::CarbonFlux, GRID, &noise(&GRID, 150, 1)).await;
    let mut random = Random(7);
    let mut regions = vec![
        "global".to_owned(),
        // One block, as a box and as a polygon; inside of one; two cells of a rim.
        "-162,58,-146,74".to_owned(),
        "POLYGON((-162 58,-146 58,-146 74,-162 74,-162 58))".to_owned(),
        "-161,59,-147,73".to_owned(),
        "-163,58,-162,74".to_owned(),
        // Past the date line, and round the pole.
        "POLYGON((140 -60,220 -60,220 60,140 60,140 -60))".to_owned(),
        "150,-80,-140,90".to_owned(),
    ];
    regions.extend((0..25).map(|_| random.polygon()));
    for region in &regions {
        both.agree_on(&asked(region, KNOWN)).await;
    }
    for (earth, cells) in [
        (Earth::Sphere, Cells::Whole),
        (Earth::LocalRadius, Cells::OceanShare),
        (Earth::Wgs84, Cells::OceanShare),
    ] {
        let query = StatisticsQuery {
            earth,
            cells,
            ..asked(&regions[5], KNOWN)
        };
        both.agree_on(&query).await;
    }
    let month = StatisticsQuery {
        step: TimeStep::Month,
        ..asked(&regions[5], "mean,std,min,max,median,p90,count")
    };
    both.agree_on(&month).await;
    // The comparison sees another region.
    let other = rows(&both.without, &both.manifest, &asked(&regions[1], KNOWN)).await;
    let found = rows(&both.with, &both.manifest, &asked(&regions[3], KNOWN)).await;
    assert!(found.unwrap() != other.unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn sums_begin_anew_in_every_shard() {
    let both = Both::of(Quantity::CarbonFlux, WIDE, &noise(&WIDE, 20, 3)).await;
    for region in [
        "global",
        "POLYGON((101 0.5,263.7 2,250 15.2,104 14,101 0.5),(150 6,151 6,151 9,150 6))",
        "105.04,0,105.12,8",
        // Begins and ends within shards.
        "103.3,0,250.07,16",
    ] {
        both.agree_on(&asked(region, KNOWN)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_lies_inside_is_not_read() {
    let both = Both::of(Quantity::CarbonFlux, GRID, &noise(&GRID, 128, 5)).await;
    let right = both.agree_on(&asked("global", "mean,std,count")).await;
    let all = chunks(&both.with).await;
    let mut damaged = 0;
    let before = rows(&both.with, &both.manifest, &asked("global", "min")).await;
    for key in &all {
        let whole = flip(&both.with, key).await;
        let of_values = rows(&both.with, &both.manifest, &asked("global", "min")).await;
        let of_sums = rows(
            &both.with,
            &both.manifest,
            &asked("global", "mean,std,count"),
        )
        .await;
        match (of_values, of_sums) {
            (Err(error), Ok(found)) if error.contains("along_time/carbon_flux") => {
                assert!(error.contains(key.as_str()), "{error}");
                assert!(found == right);
                damaged += 1;
            }
            // Damaged sums are an error that names them, and nothing else.
            (Ok(found), Err(error)) if error.contains("sums/blocks") => {
                assert!(error.contains(key.as_str()), "{error}");
                assert!(Ok(found) == before);
                damaged += 100;
            }
            // Map-major chunks of steps that a run holds: nobody reads them.
            (of_values, of_sums) => assert!(of_values.is_ok() && of_sums.is_ok()),
        }
        both.with.put_over(key, whole).await.unwrap();
    }
    assert_eq!(damaged, 101, "a run of steps has a shard of each");
}

#[tokio::test(flavor = "multi_thread")]
async fn sums_of_steps_that_were_revised_are_not_used() {
    let mut steps = noise(&GRID, 260, 11);
    let both = Both::of(Quantity::CarbonFlux, GRID, &steps).await;
    let query = asked("global", KNOWN);
    let before = both.agree_on(&query).await;
    steps[140].1 = noise(&GRID, 1, 99).pop().unwrap().1;
    let (with, without) = (both.with.clone(), both.without.clone());
    let second = land(&with, &product("p"), Quantity::CarbonFlux, GRID, &steps).await;
    land(&without, &product("p"), Quantity::CarbonFlux, GRID, &steps).await;
    let right = rows(&without, &second, &query).await.unwrap();
    assert!(right != before);
    // Before the cube follows, when it has, and when it is compacted again.
    assert!(rows(&with, &second, &query).await.unwrap() == right);
    cube::follow(&with, &second).await.unwrap();
    assert!(rows(&with, &second, &query).await.unwrap() == right);
    assert_eq!(cube::compact(&with, FOLDER).await.unwrap(), 1);
    assert!(rows(&with, &second, &query).await.unwrap() == right);
    // The version before has its own.
    assert!(rows(&with, &both.manifest, &query).await.unwrap() == before);
    let sound = cube::verify::check(&with, &product("p"), &BTreeSet::new()).await;
    assert_eq!(sound.unwrap().findings, []);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_summed_is_the_same_error_and_harms_no_other_region() {
    let mut steps = noise(&GRID, 128, 13);
    // 1e-3 kg m⁻² s⁻¹ is beyond anything physical; row 40 lies at 9 N, column 60 at 57 W.
    steps[17].1[40 * GRID.cols as usize + 60] = 1e-3;
    let both = Both::of(Quantity::CarbonFlux, GRID, &steps).await;
    for region in ["global", "-80,-20,20,30"] {
        let query = asked(region, "mean");
        let found = rows(&both.with, &both.manifest, &query).await.unwrap_err();
        let right = rows(&both.without, &both.manifest, &query).await;
        for error in [&found, &right.unwrap_err()] {
            assert!(error.contains("beyond anything physical"), "{error}");
        }
    }
    // West of it, east of it in the same blocks' row, and elsewhere.
    for region in ["-178,-20,-80,30", "-40,-20,90,30", "-178,-80,160,-30"] {
        both.agree_on(&asked(region, KNOWN)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn quantities_of_unknown_range_and_temperatures_have_their_bits() {
    let open = Quantity::open("turbidity", "1", "Turbidity").unwrap();
    let steps = noise(&GRID, 128, 17);
    let both = Both::of(open, GRID, &steps).await;
    both.agree_on(&asked("global", KNOWN)).await;
    let kelvins = |(period, values): &(Period, Vec<f32>)| {
        let warm = values.iter().map(|value| 285.0 + value * 1e8);
        (*period, warm.collect::<Vec<f32>>())
    };
    let steps: Vec<_> = steps.iter().map(kelvins).collect();
    let both = Both::of(Quantity::SeaSurfaceTemperature, GRID, &steps).await;
    let mut random = Random(23);
    for region in ["global".to_owned(), random.polygon(), random.polygon()] {
        both.agree_on(&asked(&region, KNOWN)).await;
    }
}
