//! One budget over the versions of its product.

use compute::budget::{budget_of, history};
use compute::{Engine, ErrorClass, derive_accumulated};
use contract::budget::{AskedRiver, BudgetQuery, ErrorWords};
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs, TimeStep};
use storage::Store;
use storage::manifests::{self, AtInstant};

use crate::fixture::{ask, folder_store, land, product, total};

const GRID: Grid = Grid {
    rows: 6,
    cols: 12,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 30.0,
    dlon_deg: 30.0,
};

/// A version of some months of 2000, each of an even flux.
async fn publish(store: &Store, months: &[(u32, f32)]) {
    let steps: Vec<_> = months
        .iter()
        .map(|(month, flux)| {
            let period = Period::month(2000, *month).unwrap();
            (period, vec![*flux; GRID.cell_count()])
        })
        .collect();
    land(store, &product("flux"), Quantity::CarbonFlux, GRID, &steps).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn each_version_that_changed_the_question_is_a_line() {
    let (_folder, store) = folder_store();
    publish(&store, &[(1, 1e-9)]).await;
    publish(&store, &[(1, 1e-9), (2, 1e-9)]).await;
    // Of what is asked for nothing changes.
    publish(&store, &[(1, 1e-9), (2, 1e-9), (5, 1e-9)]).await;
    publish(&store, &[(1, 2e-9), (2, 1e-9), (5, 1e-9)]).await;
    publish(&store, &[(5, 1e-9)]).await;
    let engine = Engine::local(store.clone());
    let words = ErrorWords {
        error: Some("10%"),
        correlation_length_km: Some(1000.0),
        ..ErrorWords::default()
    };
    let query = BudgetQuery {
        from: Some("2000-01".parse().unwrap()),
        to: Some("2000-03".parse().unwrap()),
        errors: words.asked().unwrap(),
        ..total(&product("flux"), "0,-30,60,30")
    };
    let found = history(&engine, &query).await.unwrap();
    assert_eq!(found.version_count, 5);
    let numbers: Vec<_> = found
        .versions
        .iter()
        .map(|own| own.manifest.number)
        .collect();
    assert_eq!(numbers, [1, 2, 4, 5]);
    let changed: Vec<_> = found
        .versions
        .iter()
        .map(|own| own.changed.as_str())
        .collect();
    assert_eq!(
        changed,
        [
            "first version that is kept, 1 steps",
            "1 steps added",
            "1 steps replaced",
            "2 steps removed"
        ]
    );
    assert!(found.versions.is_sorted_by_key(|own| own.published));
    for (at, own) in found.versions[..3].iter().enumerate() {
        let manifest = manifests::load(&store, &own.manifest).await.unwrap();
        let answer = budget_of(&engine, &query, &manifest).await.unwrap();
        assert_eq!(own.budget_kg.as_ref(), Some(&answer.rows[0].budget_kg));
        assert_eq!(
            own.sigma_tg,
            answer.rows[0].uncertainty.map(|own| own.sigma_tg)
        );
        let before = at
            .checked_sub(1)
            .and_then(|at| found.versions[at].budget_tg);
        let wanted = before.map(|before| answer.rows[0].budget_tg - before);
        assert_eq!(own.difference_tg, wanted);
    }
    let last = found.versions.last().unwrap();
    assert_eq!((&last.budget_kg, last.difference_tg), (&None, None));
}

/// Both versions are of the same flux.
#[tokio::test(flavor = "multi_thread")]
async fn another_start_of_accumulated_carbon_is_a_line() {
    let (_folder, store) = folder_store();
    publish(&store, &[(1, 1e-9), (2, 2e-9), (3, 4e-9), (4, 8e-9)]).await;
    let engine = Engine::local(store.clone());
    let id = product("flux-accumulated");
    let starts: [Option<TimeMs>; 2] = [None, Some("2000-02-11".parse().unwrap())];
    let (flux, mut derived) = (product("flux"), vec![]);
    for start in starts {
        let version = derive_accumulated(&engine, &flux, start, &|_progress| ()).await;
        derived.push(version.unwrap());
    }
    assert_eq!(derived[0].derived_from, derived[1].derived_from);
    let query = total(&id, "0,-30,60,30");
    let found = history(&engine, &query).await.unwrap();
    let changed: Vec<_> = found
        .versions
        .iter()
        .map(|own| own.changed.as_str())
        .collect();
    assert_eq!(
        changed,
        [
            "first version that is kept, 4 steps",
            "1 steps removed, accumulated from 2000-02-11T00:00:00Z"
        ]
    );
    for (own, manifest) in found.versions.iter().zip(&derived) {
        let answer = budget_of(&engine, &query, manifest).await.unwrap();
        assert_eq!(own.manifest, manifest.id());
        assert_eq!(own.budget_kg.as_ref(), Some(&answer.rows[0].budget_kg));
    }
    assert_ne!(found.versions[0].budget_kg, found.versions[1].budget_kg);

    // Where both have begun neither start is a matter of the question.
    let later = BudgetQuery {
        from: Some("2000-03".parse().unwrap()),
        ..query
    };
    let found = history(&engine, &later).await.unwrap();
    assert_eq!(found.versions.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_is_found_by_when_it_was_published() {
    let (_folder, store) = folder_store();
    publish(&store, &[(1, 1e-9)]).await;
    tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    publish(&store, &[(1, 2e-9)]).await;
    let id = product("flux");
    let dates = manifests::published(&store, &id).await.unwrap();
    let [(1, first), (2, second)] = dates[..] else {
        panic!("{dates:?}")
    };
    assert!(first < second);
    let at = async |ms: i64| {
        let instant = TimeMs::new(ms).unwrap();
        manifests::as_of(&store, &id, instant).await.unwrap()
    };
    for (ms, number) in [
        (first.ms(), 1),
        (second.ms() - 1, 1),
        (second.ms(), 2),
        (second.ms() + 9, 2),
    ] {
        match at(ms).await {
            AtInstant::Version(own) => assert_eq!(own.number, number),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(at(first.ms() - 1).await, AtInstant::BeforeFirst(first));
    // Once the second is gone and the first is kept, nobody knows which of them was the newest after the first.
    tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    publish(&store, &[(1, 3e-9)]).await;
    store.remove(&ObjectKey::manifest(&id, 2)).await.unwrap();
    for ms in [first.ms(), second.ms()] {
        assert_eq!(at(ms).await, AtInstant::Gone(1));
    }
    let third = manifests::published(&store, &id).await.unwrap()[1].1;
    assert!(matches!(at(third.ms()).await, AtInstant::Version(own) if own.number == 3));
    let engine = Engine::local(store.clone());
    let found = history(&engine, &total(&id, "global")).await.unwrap();
    let notes = found.notes.join("; ");
    assert!(notes.contains("versions between"), "{notes}");
    let nothing = manifests::as_of(&store, &product("none"), first)
        .await
        .unwrap();
    assert_eq!(nothing, AtInstant::Nothing);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_has_no_history_is_refused() {
    let (_folder, store) = folder_store();
    publish(&store, &[(1, 1e-9)]).await;
    let engine = Engine::local(store);
    let months = BudgetQuery {
        step: TimeStep::Month,
        ..total(&product("flux"), "global")
    };
    let refused = history(&engine, &months).await.unwrap_err();
    assert_eq!(refused.class(), ErrorClass::BadRequest);
    assert!(refused.to_string().contains("one number"), "{refused}");
    let flux = product("flux");
    let rivers = BudgetQuery {
        river: AskedRiver::asked(Some("650"), Some("somebody")).unwrap(),
        ..total(&flux, "global")
    };
    let words = ErrorWords {
        error: Some("10%"),
        correlation_length_km: Some(1000.0),
        monte_carlo: Some(20),
        ..ErrorWords::default()
    };
    let draws = BudgetQuery {
        errors: words.asked().unwrap(),
        ..total(&flux, "global")
    };
    for (query, said) in [(rivers, "takes no rivers off"), (draws, "draws no errors")] {
        let refused = history(&engine, &query).await.unwrap_err();
        assert_eq!(refused.class(), ErrorClass::BadRequest);
        assert!(refused.to_string().contains(said), "{refused}");
    }
    let unknown = history(&engine, &total(&product("none"), "global"))
        .await
        .unwrap_err();
    assert_eq!(unknown.class(), ErrorClass::NotFound);
    let turned = BudgetQuery {
        from: Some("2001".parse().unwrap()),
        to: Some("2000".parse().unwrap()),
        ..total(&product("flux"), "global")
    };
    let refused = history(&engine, &turned).await.unwrap_err();
    assert!(refused.to_string().contains("after the start"), "{refused}");
    let steps = [(
        Period::month(2000, 1).unwrap(),
        vec![290.0_f32; GRID.cell_count()],
    )];
    let (id, sst) = (product("sst"), Quantity::SeaSurfaceTemperature);
    land(engine.store(), &id, sst, GRID, &steps).await;
    let refused = history(&engine, &total(&id, "global")).await.unwrap_err();
    assert!(
        refused.to_string().contains("no flux of carbon"),
        "{refused}"
    );
    let globe = ask(&engine, &total(&product("flux"), "global")).await;
    assert!(globe.uncertainty.is_none());
}
