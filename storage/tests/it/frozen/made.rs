//! Manifests of products that were made of others in every way that there is: frozen, and read as they were written.

use contract::analysis::{BasePeriod, CalendarBins, CorrelationStatistic, MapStatistic};
use contract::computed::{Computation, Computed, ComputedInput, MapRequest, Matching, Regridding};
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, ManifestId, Step};
use contract::quantity::Quantity;
use contract::region::{AskedRegion, KeptRegion};
use contract::time::{Period, TimeStep};
use storage::{Store, manifests};

use super::{GRID, copy_of, to_freeze};

fn id(text: &str) -> ManifestId {
    text.parse().unwrap()
}

fn input(name: &str, of: &str, matching: Matching) -> ComputedInput {
    ComputedInput {
        name: name.to_owned(),
        manifest: id(of),
        matching,
    }
}

/// One product, its fields nowhere: what is said of it is what is frozen.
fn made(name: &str, quantity: Quantity, computed: Computed) -> Manifest {
    let product = name.parse().unwrap();
    let digest = Digest::of(name.as_bytes());
    Manifest {
        schema: MANIFEST_SCHEMA,
        number: 1,
        title: format!("Frozen {name}"),
        quantity,
        synthetic: true,
        source: "made by a test".to_owned(),
        grid: GRID,
        steps: vec![Step {
            masked: None,
            period: Period::month(2001, 1).unwrap(),
            field: ObjectKey::field(&product, &digest),
            raw_sha256: digest,
            origin: name.to_owned(),
            valid_cells: 7,
            contributed: None,
        }],
        domain: ObjectKey::domain(&product, &digest),
        series: vec![],
        derived_from: computed.inputs.first().map(|it| it.manifest.clone()),
        computed: Some(computed),
        notices: vec![],
        indexes: vec![],
        product,
    }
}

/// One of every way, and what is optional there and not there.
fn all() -> Vec<Manifest> {
    let flux = "fgco2@1-72149538";
    let sst = "sst@3-0a1b2c3d";
    let same = Matching::SamePeriod;
    let expression = Computed {
        how: Computation::Expression {
            expression: "f * sst / unit(300, 'K')".to_owned(),
        },
        inputs: vec![
            input("f", flux, same),
            input("sst", sst, Matching::Containing),
        ],
        from: "2001-01".parse().ok(),
        to: None,
        map: None,
    };
    let regridded = Computed {
        how: Computation::Regrid {
            method: Regridding::Conservative,
            min_coverage: 0.25,
        },
        inputs: vec![input("source", flux, same)],
        from: None,
        to: None,
        map: None,
    };
    let correlation = |map| Computed {
        how: Computation::Correlation {
            statistic: CorrelationStatistic::PValue,
            lag_steps: -2,
            step: TimeStep::Month,
            deseasonalised: true,
            least_percent: 60,
        },
        inputs: vec![input("first", sst, same), input("second", flux, same)],
        from: None,
        to: "2002-01".parse().ok(),
        map,
    };
    let region: AskedRegion = "170,-10.25,-170,10".parse().unwrap();
    let base: BasePeriod = "1991/2020".parse().unwrap();
    let request = MapRequest {
        base: Some(base),
        bins: CalendarBins::Season,
        anomaly_step: None,
        region: Some(KeptRegion::of(&region)),
        crop: false,
        once: true,
    };
    let statistic = Computed {
        how: Computation::Statistic {
            statistic: MapStatistic::Percentile("97.5".parse().unwrap()),
            step: TimeStep::Year,
            least_percent: 80,
        },
        inputs: vec![input("source", flux, same)],
        from: None,
        to: None,
        map: Some(request.clone()),
    };
    let p_value = Quantity::open("correlation_p_value", "1", "p value").unwrap();
    vec![
        made("made-expression", Quantity::CarbonFlux, expression),
        made("made-regridded", Quantity::CarbonFlux, regridded),
        // As it was before the rest of what was asked for was kept.
        made("made-correlation", p_value, correlation(None)),
        made("made-correlation-kept", p_value, correlation(Some(request))),
        made("made-statistic", Quantity::CarbonFlux, statistic),
    ]
}

#[tokio::test]
async fn frozen_versions_that_were_made_of_others_say_of_what_and_how() {
    if let Some(folder) = to_freeze() {
        let store = Store::open(folder.join("made").to_str().unwrap()).unwrap();
        for manifest in all() {
            manifests::commit(&store, &manifest).await.unwrap();
        }
    }
    let folder = copy_of(MANIFEST_SCHEMA, "made");
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    for manifest in all() {
        let found = manifests::latest(&store, &manifest.product).await;
        let found = found.unwrap().unwrap();
        assert_eq!(found, manifest);
        // What is cited hangs on every byte of it.
        assert_eq!(found.id(), manifest.id());
    }
    let names = all().into_iter().map(|manifest| manifest.id().to_string());
    let names: Vec<String> = names.collect();
    assert_eq!(names, NAMES);
}

/// Names that were cited.
const NAMES: [&str; 5] = [
    "made-expression@1-3b624816",
    "made-regridded@1-5ce02555",
    "made-correlation@1-aee11580",
    "made-correlation-kept@1-536473e5",
    "made-statistic@1-42d798f2",
];
