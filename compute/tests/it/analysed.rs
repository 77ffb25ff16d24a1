//! What is made of series of stored products: at a place and over regions, of one and of two, and of bands.

use compute::analysis::{self, analyse};
use compute::reduce::statistics_of;
use compute::{ComputeError, Engine, ErrorClass};
use contract::analysis::{
    Along, AnalysisOptions, AnalysisPart, CorrelationQuery, Difference, HovmollerQuery,
    HovmollerRow, LineSeriesQuery, SeriesQuery,
};
use contract::earth::Earth;
use contract::grid::{Grid, LonLatDeg};
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::series::RegionSeriesQuery;
use contract::statistics::MinCoverage;
use contract::time::{Period, TimeStep};
use storage::Store;

use crate::fixture::{folder_store, land, parts, product};

/// In the open Pacific, so that all of it is sea.
const GRID: Grid = Grid {
    rows: 9,
    cols: 20,
    north_deg: -10.0,
    west_deg: -140.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// Months from 2001 on; every cell has the value of its month, stored unit.
fn months(count: u32, value: impl Fn(u32, usize) -> f32) -> Vec<(Period, Vec<f32>)> {
    (0..count)
        .map(|month| {
            let period = Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap();
            let cells = (0..GRID.cell_count()).map(|cell| value(month, cell));
            (period, cells.collect())
        })
        .collect()
}

/// A season and a rise of 0.03 a year, m s⁻¹.
fn rising(month: u32) -> f32 {
    3.0 + (month % 12) as f32 + 0.03 * (month / 12) as f32
}

async fn wind(store: &Store, name: &str, steps: &[(Period, Vec<f32>)]) -> Manifest {
    land(store, &product(name), Quantity::WindSpeed, GRID, steps).await
}

fn region(name: &str, region: &str) -> SeriesQuery {
    let query = RegionSeriesQuery::new(product(name), region.parse().unwrap());
    SeriesQuery::Region(query)
}

fn cell(name: &str, lon: f64, lat: f64) -> SeriesQuery {
    SeriesQuery::Cell {
        product: product(name),
        place: LonLatDeg::new(lon, lat).unwrap(),
        from: None,
        to: None,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_region_and_a_cell_of_one_value_have_one_analysis_and_it_is_that_of_the_values() {
    let (_folder, store) = folder_store();
    let manifest = wind(&store, "wind", &months(120, |month, _| rising(month))).await;
    let id = manifest.id();
    let engine = Engine::in_process(store.clone(), parts(3));
    let options = AnalysisOptions::new(AnalysisPart::ALL.to_vec()).unwrap();
    let of = async |query: &SeriesQuery| {
        analyse(&engine, (&manifest, &id), query, &options)
            .await
            .unwrap()
    };
    let area = of(&region("wind", "-135,-18,-125,-12")).await;
    let point = of(&cell("wind", -130.5, -15.5)).await;
    assert!(area.refused.is_empty() && area.notes.is_empty(), "{area:?}");
    assert_eq!((area.step_count, area.value_count), (120, 120));
    let (a, b) = (area.trend.unwrap(), point.trend.unwrap());
    assert!((a.theil_sen.slope_per_decade - 0.3).abs() < 1e-2, "{a:?}");
    // Sums over regions are fixed-point numbers.
    assert!((a.theil_sen.slope_per_decade - b.theil_sen.slope_per_decade).abs() < 1e-6);
    let periods: Vec<Period> = manifest.steps.iter().map(|step| step.period).collect();
    let values: Vec<f64> = (0..120).map(|month| f64::from(rising(month))).collect();
    let own = analysis::trend::trend(&periods, &values, TimeStep::Month, "m s⁻¹").unwrap();
    assert_eq!(b, own);
    let january = &point.climatology.unwrap().rows[0];
    assert!(
        (january.mean.unwrap() - (3.0 + 0.03 * 4.5)).abs() < 1e-6,
        "{january:?}"
    );
    assert_eq!(point.anomaly.unwrap().rows.len(), 120);
    assert!(point.season.unwrap().annual.amplitude > 3.0);
    assert_eq!(
        point.extremes.unwrap().highest[0].start.to_string(),
        "2010-12-01T00:00:00Z"
    );
    assert_eq!(point.place.cell.unwrap().row, 5);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_base_period_that_reaches_beyond_the_series_is_told() {
    let (_folder, store) = folder_store();
    let manifest = wind(&store, "wind", &months(36, |month, _| rising(month))).await;
    let id = manifest.id();
    let engine = Engine::in_process(store.clone(), parts(1));
    let notes = async |part: AnalysisPart, base: &str| {
        let options = AnalysisOptions {
            base: Some(base.parse().unwrap()),
            ..AnalysisOptions::new(vec![part]).unwrap()
        };
        let query = cell("wind", -130.5, -15.5);
        let found = analyse(&engine, (&manifest, &id), &query, &options).await;
        found.unwrap().notes
    };
    for part in [AnalysisPart::Climatology, AnalysisPart::Anomaly] {
        assert_eq!(notes(part, "2001/2003").await, Vec::<String>::new());
        assert_eq!(notes(part, "2002/2003").await, Vec::<String>::new());
        let told = notes(part, "1991/2020").await;
        assert!(
            told.len() == 1 && told[0].contains("1991/2020") && told[0].contains("2001/2003"),
            "{told:?}"
        );
    }
    // What has no base period says nothing of one.
    let season = notes(AnalysisPart::Season, "1991/2020").await;
    assert_eq!(season, Vec::<String>::new());
}

fn line(name: &str, line: &str) -> SeriesQuery {
    let query = LineSeriesQuery::new(product(name), line.parse().unwrap());
    SeriesQuery::Line(query)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_line_is_analysed_as_its_mean_by_length_is_told() {
    let (_folder, store) = folder_store();
    // The western half has half the values, and nothing in every fifth month.
    let of_cell = |month: u32, cell: usize| match (cell % 20 < 10, month % 5) {
        (true, 4) => f32::NAN,
        (true, _) => rising(month) / 2.0,
        (false, _) => rising(month),
    };
    let manifest = wind(&store, "wind", &months(120, of_cell)).await;
    let id = manifest.id();
    let engine = Engine::in_process(store.clone(), parts(3));
    let of = async |query: &SeriesQuery, percent: f64| {
        let parts = vec![AnalysisPart::Anomaly, AnalysisPart::Trend];
        let mut options = AnalysisOptions::new(parts).unwrap();
        options.min_coverage = MinCoverage::new(percent).unwrap();
        analyse(&engine, (&manifest, &id), query, &options).await
    };
    // A quarter of it lies in the west.
    let own = line("wind", "-132,-15.5;-124,-15.5");
    let found = of(&own, 0.0).await.unwrap();
    let SeriesQuery::Line(query) = &own else {
        panic!("no line");
    };
    let asked = query.statistics();
    let told = statistics_of(&engine, &asked, &manifest, id.clone());
    let told = told.await.unwrap();
    assert_eq!(found.place.line.as_deref(), Some("-132,-15.5;-124,-15.5"));
    assert_eq!((found.place.region, found.place.cell), (None, None));
    assert_eq!((found.step_count, found.value_count), (120, 120));
    let rows = found.anomaly.unwrap().rows;
    assert_eq!(rows.len(), told.rows.len());
    for (month, (row, own)) in (0..).zip(rows.iter().zip(&told.rows)) {
        assert_eq!((row.start, row.value), (own.start, own.values["mean"]));
        let west = if month % 5 == 4 { 0.0 } else { 0.25 };
        let mean = f64::from(rising(month)) * (0.75 + west / 2.0) / (0.75 + west);
        assert!(
            (row.value.unwrap() / mean - 1.0).abs() < 1e-4,
            "{row:?} {mean}"
        );
        assert!((own.coverage_percent - 75.0 - 100.0 * west).abs() < 0.01);
    }
    // Steps that hold data along three quarters of it are left out, and said to be.
    let full = of(&own, 80.0).await.unwrap();
    assert_eq!((full.value_count, full.left_out_count), (96, 24));
    assert_eq!(
        full.notes,
        ["24 of 120 steps hold data over less than 80 % of the line and are left out"]
    );
    // A line within one cell is that cell.
    let within = of(&line("wind", "-130.2,-15.2;-130.4,-15.4"), 0.0).await;
    let cell = of(&cell("wind", -130.3, -15.3), 0.0).await.unwrap();
    let (within, cell) = (within.unwrap().trend.unwrap(), cell.trend.unwrap());
    let slopes = [&within, &cell].map(|trend| trend.theil_sen.slope_per_decade);
    assert!((slopes[0] - slopes[1]).abs() < 1e-6, "{slopes:?}");
    // What lies beside the grid is refused, and what passes its edge is told of.
    let refused = of(&line("wind", "0,0;10,10"), 0.0).await.unwrap_err();
    assert_eq!(refused.class(), ErrorClass::BadRequest);
    assert!(
        refused.to_string().contains("outside the grid"),
        "{refused}"
    );
    let beyond = of(&line("wind", "-125,-15;-110,-15"), 0.0).await.unwrap();
    assert!(
        beyond.notes[0].contains("lie on the grid"),
        "{:?}",
        beyond.notes
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn steps_that_cover_too_little_are_left_out_and_told_of() {
    let (_folder, store) = folder_store();
    // Of every third month a quarter of the cells, and far too high; of the first none.
    let gaps = months(120, |month, cell| match (month, month % 3, cell % 4) {
        (0, ..) | (_, 2, 1..) => f32::NAN,
        (_, 2, _) => 1000.0,
        _ => rising(month),
    });
    let manifest = wind(&store, "wind", &gaps).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let of = async |query: &SeriesQuery, percent: f64| {
        let mut options = AnalysisOptions::new(vec![AnalysisPart::Extremes]).unwrap();
        options.min_coverage = MinCoverage::new(percent).unwrap();
        let id = manifest.id();
        analyse(&engine, (&manifest, &id), query, &options)
            .await
            .unwrap()
    };
    let area = region("wind", "-140,-19,-120,-10");
    let all = of(&area, 0.0).await;
    let counts = |found: &contract::analysis::SeriesAnalysis| {
        [found.step_count, found.value_count, found.left_out_count]
    };
    assert_eq!(counts(&all), [120, 119, 0]);
    assert!(all.extremes.unwrap().highest[0].value > 100.0);
    let full = of(&area, 50.0).await;
    assert_eq!(counts(&full), [120, 79, 40]);
    assert!((full.min_coverage_percent - 50.0).abs() < 1e-12);
    assert!(full.extremes.unwrap().highest[0].value < 20.0);
    assert_eq!(
        full.notes,
        ["40 of 120 steps hold data over less than 50 % of the region's sea and are left out"]
    );
    // A threshold below what is covered leaves nothing out.
    assert_eq!(counts(&of(&area, 20.0).await), [120, 119, 0]);
    let place = of(&cell("wind", -138.5, -10.5), 50.0).await;
    assert_eq!(counts(&place), [120, 79, 0]);
    assert_eq!(place.notes, ["79 of 120 steps hold data in this cell"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_not_defined_is_said_beside_what_is() {
    let (_folder, store) = folder_store();
    let gaps = months(24, |month, cell| {
        if cell % 4 > 0 || month == 3 {
            f32::NAN
        } else {
            rising(month)
        }
    });
    let manifest = wind(&store, "wind", &gaps).await;
    let id = manifest.id();
    let engine = Engine::in_process(store.clone(), parts(2));
    let parts = vec![AnalysisPart::Trend, AnalysisPart::Season];
    let options = AnalysisOptions::new(parts).unwrap();
    let query = region("wind", "-140,-19,-120,-10");
    let found = analyse(&engine, (&manifest, &id), &query, &options)
        .await
        .unwrap();
    assert_eq!((found.step_count, found.value_count), (24, 23));
    assert!(found.trend.is_none() && found.season.is_some());
    assert_eq!(
        found.refused[0].reason,
        "a trend needs 5 years of values, and they span 2.0"
    );
    assert!(
        found.notes[0].starts_with("23 of 24 steps hold data over less than half"),
        "{:?}",
        found.notes
    );
    let nowhere = cell("wind", 0.0, 0.0);
    let refused = analyse(&engine, (&manifest, &id), &nowhere, &options)
        .await
        .unwrap_err();
    assert_eq!(refused.class(), ErrorClass::BadRequest);
    let later = query.within("2010".parse().ok(), None);
    let refused = analyse(&engine, (&manifest, &id), &later, &options)
        .await
        .unwrap_err();
    assert!(refused.to_string().contains("covers 2001"), "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_product_that_follows_another_is_found_at_its_lag() {
    let (_folder, store) = folder_store();
    // Noise without a season: the second has it two months later.
    let noise = |month: u32| (month.wrapping_mul(2_654_435_761) >> 20) as f32 / 409.6;
    let a = wind(&store, "first", &months(60, |month, _| noise(month + 2))).await;
    let b = wind(&store, "second", &months(66, |month, _| noise(month))).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let query = CorrelationQuery::new(region("first", "global"), product("second"), 4).unwrap();
    let (a_id, b_id) = (a.id(), b.id());
    let found = analysis::correlation(&engine, (&a, &a_id), (&b, &b_id), &query)
        .await
        .unwrap();
    assert_eq!((found.rows.len(), found.strongest_lag_steps), (9, Some(2)));
    assert!((found.rows[6].correlation.unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(found.end.to_string(), "2006-01-01T00:00:00Z");
    let native = CorrelationQuery {
        step: TimeStep::Year,
        ..query.clone()
    };
    let found = analysis::correlation(&engine, (&a, &a_id), (&b, &b_id), &native)
        .await
        .unwrap();
    assert_eq!(found.rows[4].count, 5);
    let elsewhere = CorrelationQuery {
        series: query.series.within("2006-02".parse().ok(), None),
        ..query
    };
    let refused = analysis::correlation(&engine, (&b, &b_id), (&a, &a_id), &elsewhere).await;
    assert_eq!(refused.unwrap_err().class(), ErrorClass::BadRequest);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_month_that_is_missing_keeps_its_place_in_a_correlation_of_native_steps() {
    let (_folder, store) = folder_store();
    let noise = |month: u32| (month.wrapping_mul(2_654_435_761) >> 20) as f32 / 409.6;
    let without = |mut steps: Vec<(Period, Vec<f32>)>, missing: &[usize]| {
        for at in missing.iter().rev() {
            steps.remove(*at);
        }
        steps
    };
    let (first, second) = (
        months(60, |month, _| noise(month + 2)),
        months(66, |month, _| noise(month)),
    );
    let a = wind(&store, "first", &without(first, &[20, 33])).await;
    let b = wind(&store, "second", &without(second.clone(), &[20, 33, 40])).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let mut query = CorrelationQuery::new(region("first", "global"), product("second"), 4).unwrap();
    query.step = TimeStep::Native;
    let (a_id, b_id) = (a.id(), b.id());
    let found = analysis::correlation(&engine, (&a, &a_id), (&b, &b_id), &query);
    let found = found.await.unwrap();
    assert_eq!(found.strongest_lag_steps, Some(2));
    let row = &found.rows[6];
    assert!((row.correlation.unwrap() - 1.0).abs() < 1e-9, "{row:?}");
    // 58 pairs, less months 20 and 33 of the first, 20, 33 and 40 of the second.
    assert_eq!((row.count, found.rows[4].count), (53, 57));
    assert_eq!(found.end.to_string(), "2006-01-01T00:00:00Z");

    // The first half of each month: steps between which nothing is as long as they are.
    let half = |(period, cells): &(Period, Vec<f32>)| {
        let end = period.start.to_string().replace("-01T", "-16T");
        let half = Period::new(period.start, end.parse().unwrap()).unwrap();
        (half, cells.clone())
    };
    let halves: Vec<_> = second.iter().map(half).collect();
    let c = wind(&store, "halves", &halves).await;
    let d = wind(&store, "fewer", &without(halves, &[20])).await;
    let (c_id, d_id) = (c.id(), d.id());
    query.series = region("halves", "global");
    query.with = product("fewer");
    let refused = analysis::correlation(&engine, (&c, &c_id), (&d, &d_id), &query).await;
    let refused = refused.unwrap_err();
    assert_eq!(refused.class(), ErrorClass::BadRequest);
    assert!(refused.to_string().contains("ask for lag 0"), "{refused}");
    query.max_lag = 0;
    let found = analysis::correlation(&engine, (&c, &c_id), (&d, &d_id), &query);
    assert_eq!(found.await.unwrap().rows[0].count, 65);
}

/// The difference of two versions of products, whatever is covered.
async fn differ(
    engine: &Engine,
    (of, of_series): (&Manifest, &SeriesQuery),
    (minus, minus_series): (&Manifest, &SeriesQuery),
) -> Result<Difference, ComputeError> {
    let (a, b) = (of.id(), minus.id());
    let (of, minus) = (((of, &a), of_series), ((minus, &b), minus_series));
    analysis::difference(engine, of, minus, MinCoverage::default()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn periods_versions_and_products_are_compared() {
    let (_folder, store) = folder_store();
    // A season, a little noise, and 0.15 more from 2006 on.
    let value = |month: u32| {
        let noise = if month.is_multiple_of(2) { 0.02 } else { -0.02 };
        3.0 + (month % 12) as f32 + noise * ((month / 12) % 3) as f32 + 0.15 * (month / 60) as f32
    };
    let first = wind(&store, "wind", &months(120, |month, _| value(month))).await;
    let second = wind(&store, "wind", &months(120, |month, _| value(month) + 1.0)).await;
    let ice = land(
        &store,
        &product("ice"),
        Quantity::IceFraction,
        GRID,
        &months(12, |_, _| 0.5),
    )
    .await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let all = region("wind", "-140,-19,-120,-10");
    let [early, late] = ["2001/2005", "2006/2010"].map(|years| all.in_years(years.parse().ok()));
    let later = differ(&engine, (&first, &late), (&first, &early)).await;
    let later = later.unwrap();
    assert!((later.difference.unwrap() - 0.15).abs() < 1e-3, "{later:?}");
    assert!(later.p_value.unwrap() < 1e-3 && later.of.count == 60);
    assert!(later.notes.is_empty(), "{later:?}");
    // A year has its season in its error, and half a year beside a whole one in the difference.
    for (of, minus, notes) in [
        (
            ("2006-01-01", "2007-01-01"),
            ("2001-01-01", "2006-01-01"),
            &["less than two years"][..],
        ),
        (
            ("2006-01-01", "2009-01-01"),
            ("2001-07-01", "2005-01-01"),
            &["different shares"],
        ),
        (
            ("2006-07-01", "2007-01-01"),
            ("2001-01-01", "2002-01-01"),
            &["different shares", "less than two years"],
        ),
    ] {
        let inside = |(from, to): (&str, &str)| {
            let mut query =
                RegionSeriesQuery::new(product("wind"), "-140,-19,-120,-10".parse().unwrap());
            (query.from, query.to) = (from.parse().ok(), to.parse().ok());
            SeriesQuery::Region(query)
        };
        let (of, minus) = (inside(of), inside(minus));
        let found = differ(&engine, (&first, &of), (&first, &minus)).await;
        let found = found.unwrap();
        assert_eq!(found.notes.len(), notes.len(), "{:?}", found.notes);
        let is_said = |(note, part): (&String, &&str)| note.contains(*part);
        assert!(
            found.notes.iter().zip(notes).all(is_said),
            "{:?}",
            found.notes
        );
    }
    let versions = differ(&engine, (&second, &all), (&first, &all)).await;
    assert!((versions.unwrap().difference.unwrap() - 1.0).abs() < 1e-6);
    for (minus, reason) in [
        (&first, "both sides are the same"),
        (&ice, "have no difference"),
    ] {
        let other = all.of_product(minus.product.clone());
        let refused = differ(&engine, (&first, &all), (minus, &other)).await;
        let refused = refused.unwrap_err();
        assert_eq!(refused.class(), ErrorClass::BadRequest);
        assert!(refused.to_string().contains(reason), "{refused}");
    }
}

/// Ranges of quantities that nothing is built in for are those of the values that a version holds.
#[tokio::test(flavor = "multi_thread")]
async fn versions_and_products_of_an_open_quantity_are_compared_whatever_their_ranges() {
    let (_folder, store) = folder_store();
    let open = Quantity::open("mole_flux", "mol m-2 s-1", "Mole flux").unwrap();
    let other = Quantity::open("mole_flux", "mol m-2", "Moles").unwrap();
    let landed = async |name: &str, quantity: Quantity, value: f32| {
        let quantity = quantity.over([0.0, value.into()]).unwrap();
        let steps = months(24, |_, _| value);
        land(&store, &product(name), quantity, GRID, &steps).await
    };
    let first = landed("mole-flux", open, 3.0).await;
    let second = landed("mole-flux", open, 4.5).await;
    let beside = landed("beside", open, 1.0).await;
    let amount = landed("amount", other, 1.0).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let all = region("mole-flux", "-140,-19,-120,-10");
    for (minus, wanted) in [(&first, 1.5), (&beside, 3.5)] {
        let series = all.of_product(minus.product.clone());
        let found = differ(&engine, (&second, &all), (minus, &series)).await;
        let found = found.unwrap().difference.unwrap();
        assert!((found - wanted).abs() < 1e-6, "{found}");
    }
    let series = all.of_product(amount.product.clone());
    let refused = differ(&engine, (&second, &all), (&amount, &series)).await;
    assert_eq!(refused.unwrap_err().class(), ErrorClass::BadRequest);
}

/// Of a year of seasons the winters at its ends count by the months that it has of them, wherever values are of.
#[tokio::test(flavor = "multi_thread")]
async fn steps_across_the_ends_of_a_period_count_by_their_time_in_it_in_every_kind_of_place() {
    let (_folder, store) = folder_store();
    let seasons = TimeStep::Season
        .whole_bins(Period::new("2000-12".parse().unwrap(), "2003-12".parse().unwrap()).unwrap());
    assert_eq!(seasons.len(), 12);
    // Winters stand out, m s⁻¹.
    let value = |at: usize| (at + if at.is_multiple_of(4) { 20 } else { 0 }) as f32;
    let field = |(at, period): (usize, Period)| (period, vec![value(at); GRID.cell_count()]);
    let steps: Vec<_> = seasons.into_iter().enumerate().map(field).collect();
    let manifest = wind(&store, "wind", &steps).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let days = [(0, 59.0), (1, 92.0), (2, 92.0), (3, 91.0), (4, 31.0)];
    let sum: f64 = days
        .iter()
        .map(|(at, days)| f64::from(value(*at)) * days)
        .sum();
    let mean = sum / 365.0;
    let mut found = vec![];
    for place in [
        region("wind", "-131,-16,-130,-15"),
        cell("wind", -130.5, -15.5),
        line("wind", "-130.8,-15.2;-130.2,-15.8"),
    ] {
        let [of, minus] = ["2001/2001", "2002/2002"].map(|year| place.in_years(year.parse().ok()));
        let told = differ(&engine, (&manifest, &of), (&manifest, &minus)).await;
        let told = told.unwrap();
        assert!((told.of.mean.unwrap() - mean).abs() < 1e-4, "{told:?}");
        let is_year = ["2001-01-01T00:00:00Z", "2002-01-01T00:00:00Z"];
        assert_eq!([told.of.start, told.of.end].map(|t| t.to_string()), is_year);
        found.push(told);
    }
    for told in &found[1..] {
        let numbers = |own: &Difference| [own.difference, own.standard_error, own.p_value];
        for (a, b) in numbers(told).into_iter().zip(numbers(&found[0])) {
            assert!((a.unwrap() - b.unwrap()).abs() < 1e-4, "{found:?}");
        }
        assert_eq!(told.of.count, 5);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_profile_of_bands_has_their_mean_spread_and_coverage_over_the_whole_period() {
    let (_folder, store) = folder_store();
    // The western half of the second month is missing, and row 4 never has data.
    let value = |month: u32, cell: usize| {
        let (row, col) = (cell / 20, cell % 20);
        if row == 4 || (month == 1 && col < 10) {
            f32::NAN
        } else {
            (row * 10 + col % 2) as f32 + 100.0 * month as f32
        }
    };
    let manifest = wind(&store, "wind", &months(3, value)).await;
    let id = manifest.id();
    let whole = HovmollerQuery {
        product: product("wind"),
        along: Along::Lat,
        band_deg: None,
        region: None,
        step: TimeStep::Total,
        from: None,
        to: None,
        earth: Earth::Wgs84,
        min_coverage: MinCoverage::default(),
    };
    let engine = Engine::local(store);
    let found = analysis::hovmoller(&engine, (&manifest, &id), &whole).await;
    let found = found.unwrap();
    assert_eq!((found.rows.len(), found.step), (1, TimeStep::Total));
    let row = &found.rows[0];
    assert_eq!((row.means[4], row.stds[4]), (None, None));
    // Of the southernmost row, 80, by hand: days of a month, February by half of the cells; half of all cells are one higher.
    let months = [(80.5, 31.0), (180.5, 28.0 / 2.0), (280.5, 31.0)];
    let days: f64 = months.iter().map(|(_, days)| days).sum();
    let mean = months.iter().map(|(own, days)| own * days).sum::<f64>() / days;
    let squares = months
        .iter()
        .map(|(own, days)| ((own - mean).powi(2) + 0.25) * days);
    let std = (squares.sum::<f64>() / days).sqrt();
    assert!((row.means[0].unwrap() - mean).abs() < 1e-9, "{row:?}");
    assert!((row.stds[0].unwrap() - std).abs() < 1e-9, "{row:?} {std}");
    assert!((row.coverage_percent[0] - 100.0 * days / 90.0).abs() < 1e-9);
    // No other step has spreads.
    let monthly = HovmollerQuery {
        step: TimeStep::Month,
        ..whole
    };
    let found = analysis::hovmoller(&engine, (&manifest, &id), &monthly).await;
    assert!(found.unwrap().rows.iter().all(|row| row.stds.is_empty()));
}

/// Weeks lie across the ends of years: rows are of the asked years, and of what is asked of a year all is there.
#[tokio::test(flavor = "multi_thread")]
async fn rows_of_bands_end_with_the_asked_period_and_with_what_steps_cover() {
    let (_folder, store) = folder_store();
    let day = |text: &str| text.parse().unwrap();
    let weeks =
        TimeStep::Week.whole_bins(Period::new(day("2000-12-01"), day("2003-02-01")).unwrap());
    // 1 January 2001 is a Monday: no week lies in that year and the one before, those of 31 December 2001 and 30 December 2002 in two.
    let year = |week: &Period| week.mid().year_month().0;
    let field = |week: Period| (week, vec![(year(&week) - 1998) as f32; GRID.cell_count()]);
    let steps: Vec<_> = weeks.iter().copied().map(field).collect();
    let manifest = wind(&store, "wind", &steps).await;
    let id = manifest.id();
    let engine = Engine::local(store);
    let query = |from: &str, to: &str, step: TimeStep| HovmollerQuery {
        product: product("wind"),
        along: Along::Lat,
        band_deg: Some(9.0),
        region: None,
        step,
        from: from.parse().ok(),
        to: to.parse().ok(),
        earth: Earth::Wgs84,
        min_coverage: MinCoverage::default(),
    };
    let of = async |query: HovmollerQuery| {
        let found = analysis::hovmoller(&engine, (&manifest, &id), &query).await;
        let rows = found.unwrap().rows;
        let is_full = |row: &HovmollerRow| {
            let percent = row.coverage_percent.iter();
            percent.fold(100.0, |least: f64, own| least.min(*own)) > 100.0 - 1e-9
        };
        assert!(rows.iter().all(is_full), "{rows:?}");
        let ends =
            |row: &HovmollerRow| [row.start, row.end].map(|time| time.to_string()[..10].to_owned());
        let ends: Vec<[String; 2]> = rows.iter().map(ends).collect();
        let means: Vec<f64> = rows.iter().map(|row| row.means[0].unwrap()).collect();
        (ends, means)
    };
    let (ends, means) = of(query("2001", "2003", TimeStep::Year)).await;
    assert_eq!(
        ends,
        [["2001-01-01", "2002-01-01"], ["2002-01-01", "2003-01-01"]]
    );
    // Of 31 December 2001 a day of 4, of the week of 30 December 2002 two days of 5.
    let by_hand = [
        (364.0 * 3.0 + 4.0) / 365.0,
        (363.0 * 4.0 + 2.0 * 5.0) / 365.0,
    ];
    let apart = means.iter().zip(by_hand).map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f64::max) < 1e-9, "{means:?} {by_hand:?}");
    let (ends, _) = of(query("2001-03-01", "2002", TimeStep::Year)).await;
    assert_eq!(ends, [["2001-03-01", "2002-01-01"]]);
    let (ends, _) = of(query("2003-01-01", "2004", TimeStep::Year)).await;
    assert_eq!(ends, [["2003-01-01", "2003-02-03"]]);
    let (ends, means) = of(query("2001-12-29", "2002-01-02", TimeStep::Native)).await;
    assert_eq!(
        ends,
        [["2001-12-29", "2001-12-31"], ["2001-12-31", "2002-01-02"]]
    );
    assert!((means[1] - 4.0).abs() < 1e-9);
}

#[tokio::test(flavor = "multi_thread")]
#[expect(clippy::too_many_lines, reason = "one product, asked in many ways")]
async fn bands_are_means_by_area_and_time_and_say_what_they_cover() {
    let (_folder, store) = folder_store();
    // Row and month; the western half of the second month is missing, and row 4 never has data.
    let value = |month: u32, cell: usize| {
        let (row, col) = (cell / 20, cell % 20);
        if row == 4 || (month == 1 && col < 10) {
            f32::NAN
        } else {
            row as f32 + 100.0 * month as f32
        }
    };
    let manifest = wind(&store, "wind", &months(14, value)).await;
    let id = manifest.id();
    let query = HovmollerQuery {
        product: product("wind"),
        along: Along::Lat,
        band_deg: None,
        region: None,
        step: TimeStep::Month,
        from: None,
        to: None,
        earth: Earth::Wgs84,
        min_coverage: MinCoverage::default(),
    };
    let engine = Engine::local(store);
    let of =
        async |query: &HovmollerQuery| analysis::hovmoller(&engine, (&manifest, &id), query).await;
    let found = of(&query).await.unwrap();
    assert_eq!(
        (found.rows.len(), found.bands.len(), found.band_deg),
        (14, 9, 1.0)
    );
    assert_eq!(
        (found.bands[0].low_deg, found.bands[8].high_deg),
        (-19.0, -10.0)
    );
    // Bands rise from the south, rows fall from the north.
    assert!((found.rows[0].means[0].unwrap() - 8.0).abs() < 1e-9);
    assert!((found.rows[3].means[7].unwrap() - 301.0).abs() < 1e-9);
    assert_eq!(
        (found.rows[3].means[4], found.bands[4].area_m2),
        (None, 0.0)
    );
    assert!((found.rows[1].coverage_percent[0] - 50.0).abs() < 1e-9);
    assert!((found.rows[0].coverage_percent[0] - 100.0).abs() < 1e-9);
    let years = HovmollerQuery {
        step: TimeStep::Year,
        band_deg: Some(9.0),
        along: Along::Lon,
        region: "-140,-19,-120,-18".parse().ok(),
        ..query.clone()
    };
    let found = of(&years).await.unwrap();
    // Each month by its days, February by half of its area: by hand, the eastern band has all of it.
    let days = [
        31.0, 28.0, 31.0, 30.0, 31.0, 30.0, 31.0, 31.0, 30.0, 31.0, 30.0, 31.0,
    ];
    let east: f64 = (0..12)
        .map(|m| days[m] * (8.0 + 100.0 * m as f64))
        .sum::<f64>()
        / 365.0;
    let last = found.bands.len() - 1;
    assert!(
        (found.rows[0].means[last].unwrap() / east - 1.0).abs() < 1e-9,
        "{found:?}"
    );
    assert_eq!(found.rows.len(), 2);
    for (wrong, reason) in [
        (
            HovmollerQuery {
                band_deg: Some(0.1),
                ..query.clone()
            },
            "narrower than the cells of wind, of 1 degrees: ask for bands of 1 degrees or more",
        ),
        (
            HovmollerQuery {
                band_deg: Some(f64::NAN),
                ..query.clone()
            },
            "from the size of a cell",
        ),
        (
            HovmollerQuery {
                region: "0,10,5,20".parse().ok(),
                ..query.clone()
            },
            "it covers",
        ),
        (
            HovmollerQuery {
                region: "-131,-15.4,-129,-15.1".parse().ok(),
                ..query.clone()
            },
            "narrower than these cells, of 1 by 1 degrees; ask for a box",
        ),
        (
            HovmollerQuery {
                region: "POLYGON((0 10,5 10,5 20,0 10))".parse().ok(),
                ..query.clone()
            },
            "does not touch the grid",
        ),
        (
            HovmollerQuery {
                from: "2010".parse().ok(),
                ..query.clone()
            },
            "no step",
        ),
    ] {
        let refused = of(&wrong).await.unwrap_err();
        assert_eq!(refused.class(), ErrorClass::BadRequest);
        assert!(refused.to_string().contains(reason), "{refused}");
    }
}
