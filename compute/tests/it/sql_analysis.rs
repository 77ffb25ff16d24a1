//! What is made of series, as tables of SQL: the numbers that `fluxglobe stats` tells, and what may surprise about them.

use compute::{Engine, budget, derive_accumulated};
use contract::quantity::Quantity;
use contract::time::Period;

use crate::fixture::{folder_store, land, months, parts, product, total};
use crate::sql::{GRID, analysed, ask, one, sql_of, texts};

fn analysis_of(word: &str, columns: &str) -> String {
    format!("SELECT {columns} FROM analysis('sst', '162,-10,170,10', '{word}')")
}

#[tokio::test(flavor = "multi_thread")]
async fn climatologies_and_anomalies_are_tables() {
    let (_folder, store) = folder_store();
    let (engine, answer) = analysed(&store).await;
    let sql = sql_of(&engine);
    let asked = analysis_of("climatology", "bin, mean, spread, count, years, unit");
    let rows = texts(&sql, &asked).await;
    let own = answer.climatology.as_ref().unwrap();
    assert_eq!(rows.len(), 12);
    for (row, own) in rows.iter().zip(&own.rows) {
        let numbers = [own.mean, own.spread].map(|number| number.unwrap().to_string());
        assert_eq!(row[0], own.bin);
        assert_eq!(row[1..3], numbers);
        assert_eq!(row[3..], ["8", "8", "°C"]);
    }
    let columns = "time_start, value, normal, anomaly, standardised";
    let rows = texts(&sql, &analysis_of("anomaly", columns)).await;
    let own = answer.anomaly.as_ref().unwrap();
    assert_eq!(rows.len(), 96);
    for (row, own) in rows.iter().zip(&own.rows) {
        let numbers = [own.value, own.normal, own.anomaly, own.standardised];
        assert_eq!(row[0], own.start.to_string());
        assert_eq!(row[1..], numbers.map(|number| number.unwrap().to_string()));
    }
    let seasons = "SELECT count(*) FROM analysis('sst', '162.3,0.5', 'climatology', 'season')";
    assert_eq!(one(&sql, seasons).await, "4");
    // Along a line it is made of the means that `stats` tells.
    let along = "SELECT count(*) FROM analysis('sst', '162,0;170,5', 'anomaly') a JOIN stats('sst', '162,0;170,5') s
        USING (time_start) WHERE a.value = s.mean";
    assert_eq!(one(&sql, along).await, "96");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trend_is_a_table_of_one_row_or_an_error_that_says_why_there_is_none() {
    let (_folder, store) = folder_store();
    let (engine, answer) = analysed(&store).await;
    let sql = sql_of(&engine);
    let columns = "slope_per_decade, lower_per_decade, upper_per_decade, p_value, tau, least_squares_per_decade, least_squares_p_value, count, deseasonalised, unit";
    let rows = texts(&sql, &analysis_of("trend", columns)).await;
    let own = answer.trend.as_ref().unwrap();
    let (robust, squares) = (&own.theil_sen, &own.least_squares);
    let numbers = [
        robust.slope_per_decade,
        robust.lower_per_decade,
        robust.upper_per_decade,
        own.mann_kendall.p_value,
        own.mann_kendall.tau,
        squares.slope_per_decade,
        squares.p_value.unwrap(),
    ];
    assert_eq!(rows.len(), 1);
    let told = rows[0][..7].iter().map(|text| text.parse().unwrap());
    assert_eq!(told.collect::<Vec<f64>>(), numbers);
    assert_eq!(rows[0][7..], ["96", "true", "°C per decade"]);
    assert!(robust.slope_per_decade > 1.0, "{robust:?}");
    let yearly = "SELECT count FROM analysis('sst', '162.3,0.5', 'trend', 'year')";
    let error = ask(&sql, yearly).await.unwrap_err().to_string();
    assert!(
        error.contains("needs 10 values, and there are 8"),
        "{error}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn what_may_surprise_stands_in_every_row() {
    let (_folder, store) = folder_store();
    // In three months of twenty-four data lie in a tenth of the rows alone.
    let steps = [2001, 2002].into_iter().flat_map(months).enumerate();
    let steps = steps.map(|(month, period)| {
        let rows = if month % 8 == 0 { 13 } else { GRID.rows };
        let cell = |cell: u32| (cell / GRID.cols < rows).then_some(280.0 + month as f32);
        let cells = 0..GRID.cell_count() as u32;
        let values = cells.map(|at| cell(at).unwrap_or(f32::NAN));
        (period, values.collect())
    });
    let steps: Vec<(Period, Vec<f32>)> = steps.collect();
    let quantity = Quantity::SeaSurfaceTemperature;
    land(&store, &product("sst"), quantity, GRID, &steps).await;
    let sql = sql_of(&Engine::in_process(store, parts(2)));
    for (word, rows) in [("climatology", 12), ("anomaly", 24)] {
        let of = |place: &str| format!("SELECT notes FROM analysis('sst', '{place}', '{word}')");
        let told = texts(&sql, &of("161,-64,-130,64")).await;
        let little = "3 of 24 steps hold data over less than half of the region's sea";
        assert_eq!(told.len(), rows);
        assert!(told.iter().all(|row| row[0].contains(little)), "{told:?}");
        // Where every step holds data there is nothing to tell.
        let told = texts(&sql, &of("162.3,64.5")).await;
        assert!(told.iter().all(|row| row[0].is_empty()), "{told:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_may_surprise_about_statistics_and_budgets_stands_in_every_row_too() {
    const BOX: &str = "162,-10,170,10";
    let (_folder, store) = folder_store();
    // The second of three months never landed, and in the third every other cell has a gap.
    let year = months(2010);
    let step = |month: usize, has_gaps: bool| {
        let cells = 0..GRID.cell_count();
        let is_gap = |cell: usize| has_gaps && cell.is_multiple_of(2);
        let values = cells.map(|cell| if is_gap(cell) { f32::NAN } else { 1e-9 });
        (year[month], values.collect())
    };
    let steps: Vec<(Period, Vec<f32>)> = vec![step(0, false), step(2, true)];
    let flux = product("flux");
    land(&store, &flux, Quantity::CarbonFlux, GRID, &steps).await;
    let engine = Engine::local(store);
    let sums = derive_accumulated(&engine, &flux, None, &|_progress| ()).await;
    let sql = sql_of(&engine);

    let asked = format!("SELECT notes, complete_m2 FROM budget('flux', '{BOX}', 'month')");
    let told = texts(&sql, &asked).await;
    let lacks = "no step of the product reaches into 1 of the 3 periods";
    assert_eq!(told.len(), 2);
    assert!(told.iter().all(|row| row[0].contains(lacks)), "{told:?}");
    assert!(told.iter().all(|row| row[1].is_empty()), "{told:?}");
    // Where every period has a row there is nothing to tell.
    let asked = format!("SELECT notes FROM budget('flux', '{BOX}')");
    assert_eq!(one(&sql, &asked).await, "");

    // A month that nobody landed leaves no sum complete.
    let answer = budget(&engine, &total(&sums.unwrap().product, BOX)).await;
    let own = answer.unwrap().rows[0].completeness.unwrap();
    assert!(own.complete_m2 == 0.0 && own.incomplete_m2 > 0.0, "{own:?}");
    let asked = format!(
        "SELECT complete_m2, incomplete_m2 FROM budget('flux-accumulated', '{BOX}', 'total')"
    );
    let told = texts(&sql, &asked).await;
    let told = told[0].iter().map(|text| text.parse().unwrap());
    assert_eq!(
        told.collect::<Vec<f64>>(),
        [own.complete_m2, own.incomplete_m2]
    );

    let crossing = "POLYGON((162 -10,170 10,170 -10,162 10,162 -10))";
    for (place, note) in [(crossing, "rings cross"), (BOX, "")] {
        let told = texts(&sql, &format!("SELECT notes FROM stats('flux', '{place}')")).await;
        assert_eq!(told.len(), 2);
        let is_told =
            |row: &Vec<String>| row[0].contains(note) && row[0].is_empty() == note.is_empty();
        assert!(told.iter().all(is_told), "{place}: {told:?}");
    }
}
