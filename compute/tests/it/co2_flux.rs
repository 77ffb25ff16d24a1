//! The air-sea fluxes that FluxEngine's two verification runs compute, from the same inputs as products, month by month.

use std::path::PathBuf;
use std::sync::Arc;

use compute::Engine;
use compute::computed::co2_flux::{Below, Co2Flux, GasTransfer, Ice, Schmidt, Solubility, Source};
use compute::computed::{Request, RequestedInput, compute};
use contract::budget::BudgetQuery;
use contract::computed::{Computation, Matching};
use contract::earth::Earth;
use contract::quantity::Quantity;
use contract::region::Cells;
use contract::time::{Period, TimeStep};
use storage::Store;

use crate::fixture::{ONE_DEGREE, ask, folder_store, land, months, parts, product, total};
use crate::fluxengine::{Run, assert_close, land_mask, runs};

/// Inputs by their names in the computation: variable, quantity, and what makes its values SI.
#[expect(clippy::type_complexity, reason = "a table of a test")]
const INPUTS: [(&str, &str, fn(f64) -> f64); 7] = [
    ("temperature", "SST_t", |celsius| celsius + 273.15),
    ("salinity", "salinity", |it| it),
    ("wind", "wind_t", |it| it),
    ("pressure", "pressure", |hpa| hpa * 100.0),
    ("dry_mole_fraction", "vCO2_air", |ppm| ppm * 1e-6),
    ("pco2_water", "pCO2_sw", |uatm| uatm * 0.101_325),
    ("ice", "sea_ice_coverage", |percent| percent / 100.0),
];

fn files() -> Vec<(Period, PathBuf)> {
    let folder = std::fs::read_dir(test_data::fluxengine("takahashi09")).unwrap();
    let mut files: Vec<PathBuf> = folder.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "nc"));
    files.sort();
    assert_eq!(files.len(), 12, "the folder holds one file a month");
    months(2000).into_iter().zip(files).collect()
}

/// A variable of all months in SI units, NaN where the file has none.
fn read(
    files: &[(Period, PathBuf)],
    variable: &str,
    si: fn(f64) -> f64,
) -> Vec<(Period, Vec<f32>)> {
    let of_file = |(period, file): &(Period, PathBuf)| {
        let mut reader = netcdf3::FileReader::open(file).unwrap();
        let values = reader.read_var_f32(variable).unwrap();
        let value = |value: f32| {
            if value < -900.0 {
                f32::NAN
            } else {
                si(f64::from(value)) as f32
            }
        };
        (*period, values.into_iter().map(value).collect())
    };
    files.iter().map(of_file).collect()
}

/// The choices of `takahashi09_verification.conf`: bulk formula, k = 0.26 U², the square of the mean wind.
fn takahashi_run() -> Co2Flux {
    let sources = INPUTS.map(|(name, ..)| {
        (
            name,
            (product(&name.replace('_', "-")), Matching::SamePeriod),
        )
    });
    Co2Flux {
        sources: sources.to_vec(),
        gas_transfer: GasTransfer::Takahashi2009,
        schmidt: Schmidt::Wanninkhof1992,
        solubility: Solubility::LitreIsKilogram,
        ice: Ice::Leads,
        no_ice_is_open: true,
        below: Below::Skin,
        salty_skin: 0.0,
    }
}

fn request(flux: &Co2Flux, expression: String, name: &str) -> Request {
    let input = |(name, (product, matching)): &(&str, Source)| RequestedInput {
        name: (*name).to_owned(),
        product: product.clone(),
        matching: *matching,
    };
    Request {
        target: product(name),
        title: None,
        quantity: Some(Quantity::CarbonFlux),
        how: Computation::Expression { expression },
        grid: None,
        inputs: flux.sources.iter().map(input).collect(),
        from: None,
        to: None,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_takahashi_run_comes_out_of_products_month_by_month() {
    let (folder, store) = folder_store();
    let files = files();
    for (name, variable, si) in INPUTS {
        let id = product(&name.replace('_', "-"));
        land(
            &store,
            &id,
            quantity(name),
            ONE_DEGREE,
            &read(&files, variable, si),
        )
        .await;
    }
    let flux = takahashi_run();
    // Its second moment is the square of the mean: the file has no other.
    let expression = flux.expression().unwrap();
    let squared = expression.replace("wind_moment2_rayleigh(wind)", "wind * wind");
    assert_ne!(squared, expression);
    let engine = Engine::in_process(store.clone(), parts(2));
    let made = compute(&engine, &request(&flux, squared, "computed-flux"), &|_| ())
        .await
        .unwrap();
    assert_eq!(made.manifest.steps.len(), 12);
    let run = runs(folder.path())
        .remove("fluxengine-takahashi09")
        .unwrap();
    let mask = land_mask(&store).await;
    let months = monthly(&engine, "computed-flux", &mask).await;
    agree(&run, &months);

    // What the choice of the second moment alone is worth.
    let rayleigh = request(&flux, expression, "rayleigh-flux");
    compute(&engine, &rayleigh, &|_| ()).await.unwrap();
    let rayleigh = monthly(&engine, "rayleigh-flux", &mask).await;
    let ratio = rayleigh.iter().sum::<f64>() / months.iter().sum::<f64>();
    assert!((ratio - 4.0 / std::f64::consts::PI).abs() < 1e-6, "{ratio}");
    store_is_sound(&store).await;
}

/// The inputs of the other run by name; the wheel's HDF5 brought to NetCDF-3 in SI units by the script.
const SOCAT_INPUTS: [&str; 9] = [
    "temperature",
    "salinity",
    "wind",
    "wind_moment2",
    "pressure",
    "dry_mole_fraction",
    "pco2_water",
    "temperature_of_pco2",
    "ice",
];

/// What an input is; two are quantities that nothing is built in for.
fn quantity(name: &str) -> Quantity {
    match name {
        "temperature" => Quantity::SeaSurfaceSkinTemperature,
        "temperature_of_pco2" => Quantity::SeaSurfaceTemperature,
        "salinity" => Quantity::Salinity,
        "wind" => Quantity::WindSpeed,
        "pressure" => Quantity::AirPressure,
        "pco2_water" => Quantity::Pco2,
        "ice" => Quantity::IceFraction,
        "wind_moment2" => Quantity::open(name, "m2 s-2", "Mean square of the wind").unwrap(),
        "dry_mole_fraction" => Quantity::open(name, "1", "CO2 in dry air").unwrap(),
        other => panic!("{other}"),
    }
}

/// FluxEngine's way to another temperature: 0.0423 of Takahashi et al. (1993) with the second-degree term of 2009.
const ITS_WAY: &str = "pco2_water * exp(unit(0.0423, 'K-1') * (temperature + unit(0.17, 'K') - temperature_of_pco2) \
    - unit(0.0000435, 'K-2') * (power(temperature + unit(0.17, 'K') - unit(273.15, 'K'), 2) \
    - power(temperature_of_pco2 - unit(273.15, 'K'), 2)))";

#[tokio::test(flavor = "multi_thread")]
async fn the_socat_run_with_a_cool_and_salty_skin_comes_out_of_products_month_by_month() {
    let (folder, store) = folder_store();
    let run = runs(folder.path()).remove("fluxengine-socatv4").unwrap();
    let inputs = folder.path().join("fluxengine-socatv4-inputs.nc");
    let mut reader = netcdf3::FileReader::open(inputs).unwrap();
    let mut sources = vec![];
    for name in SOCAT_INPUTS {
        let id = product(&name.replace('_', "-"));
        let values = reader.read_var_f32(name).unwrap();
        let none = |value: &f32| if *value < -900.0 { f32::NAN } else { *value };
        let maps = values.chunks(ONE_DEGREE.cell_count());
        // Salinity is Takahashi's, of its own year.
        let (year, matching) = match name {
            "salinity" => (2000, Matching::MonthOfYear),
            _ => (2010, Matching::SamePeriod),
        };
        let steps: Vec<_> = months(year)
            .into_iter()
            .zip(maps)
            .map(|(period, map)| (period, map.iter().map(none).collect()))
            .collect();
        land(&store, &id, quantity(name), ONE_DEGREE, &steps).await;
        sources.push((name, (id, matching)));
    }
    let flux = Co2Flux {
        sources,
        gas_transfer: GasTransfer::Nightingale2000,
        below: Below::Warmer { by_k: 0.17 },
        salty_skin: 0.1,
        ..takahashi_run()
    };
    let own = flux.expression().unwrap();
    let by_paper = "pco2_at_temperature_takahashi2009(pco2_water, temperature_of_pco2, (temperature + unit(0.17, 'K')))";
    let its = own.replace(by_paper, ITS_WAY);
    assert_ne!(own, its);
    let engine = Engine::in_process(store.clone(), parts(2));
    let mask = land_mask(&store).await;
    let mut of = vec![];
    for (name, expression) in [("its-way", its), ("by-paper", own)] {
        let request = request(&flux, expression, name);
        let made = compute(&engine, &request, &|_| ()).await.unwrap();
        assert_eq!(made.manifest.steps.len(), 12);
        of.push(monthly(&engine, name, &mask).await);
    }
    agree(&run, &of[0]);
    let ratio = of[1].iter().sum::<f64>() / of[0].iter().sum::<f64>();
    eprintln!("with the coefficient of Takahashi et al. (2009): {ratio:.5} times as much");
}

async fn monthly(
    engine: &Engine,
    name: &str,
    mask: &Arc<contract::manifest::Manifest>,
) -> Vec<f64> {
    let query = BudgetQuery {
        step: TimeStep::Month,
        earth: Earth::LocalRadius,
        cells: Cells::OceanShare,
        ocean: Some(Arc::clone(mask)),
        ..total(&product(name), "global")
    };
    let answer = ask(engine, &query).await;
    answer.rows.iter().map(|row| row.budget_tg).collect()
}

/// Every month that its authors print, less what they fill gaps with, within a thousandth; and the year of twelve months of
/// 30.5 days.
fn agree(run: &Run, ours: &[f64]) {
    let mut year_tg = 0.0;
    let mut worst: f64 = 0.0;
    assert_eq!(ours.len(), 12);
    for ((ours, [net, missing]), period) in ours
        .iter()
        .zip(&run.printed_months_tg)
        .zip(months(run.year))
    {
        assert_close(*ours, net - missing, 1e-3, &period.to_string());
        worst = worst.max((ours / (net - missing) - 1.0).abs());
        year_tg += ours * 30.5 * 86_400.0 / period.seconds();
    }
    let printed = run.printed_net_tg - run.printed_missing_tg;
    eprintln!("ours {year_tg:.4} Tg C, printed {printed:.4}; worst month off by {worst:.1e}");
    assert_close(year_tg, printed, 1e-3, "year");
}

async fn store_is_sound(store: &Store) {
    let manifest = storage::manifests::latest(store, &product("computed-flux"))
        .await
        .unwrap()
        .unwrap();
    for step in &manifest.steps {
        storage::verify::sound(store, &step.field).await.unwrap();
    }
}
