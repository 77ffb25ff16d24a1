//! Statistics of every cell: a product, or two, and a statistic in; a product of its own out, landed like any other.

mod anomalies;
mod blocks;
mod cells;
mod computed;
mod encoded;
mod found;
mod held;
mod kept;
mod landed;
mod means;
mod pairs;
mod parts_of_year;
mod plan;
mod quantity;
mod ranges;
mod runs;
mod sources;
mod stored;
mod wanted;

use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{MapOptions, MapStatistic};
use contract::computed::{Computation, Computed};
use contract::grid::Grid;
use contract::manifest::{MANIFEST_SCHEMA, Manifest};
use contract::product::ProductId;
use contract::region::AskedRegion;
use futures::future::BoxFuture;
use storage::{manifests, verify};

use super::Progress;
use crate::made_from::{made_from, made_of};
use crate::publish::{IsStillAsked, MADE_AGAIN, check_asked, publish_if};
use crate::{ComputeError, Engine};
use anomalies::Made;
use computed::computed;
pub(crate) use kept::StatisticRequest;
use landed::Landing;
use plan::Plan;
use sources::{Sources, SourcesOf};
use stored::Stored;
use wanted::Wanted;

/// Derives a statistic of each cell of the newest version of a product: [`derive_statistics`] of one.
///
/// # Errors
/// As there.
pub fn derive_statistic<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    options: &'a MapOptions,
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Manifest, ComputeError>> {
    Box::pin(async move {
        let options = std::slice::from_ref(options);
        let made = derive_statistics(engine, product, options, progress).await?;
        let one = made.into_iter().next();
        one.ok_or_else(|| ComputeError::inconsistent("a statistic", "none was derived"))
    })
}

/// Derives statistics of each cell of the newest version of a product, or of those in one region, in their order.
///
/// Correlations are with the newest version of another product. Cells of both are read once for all of them, in blocks over all time,
/// as many at once as fit an eighth of the engine's memory, and computed on all processors: the same bits whatever their number. Where
/// the newest version of a statistic was derived from the same steps in the same way, its values are kept, and it is returned as it is where it says
/// the same of how and of which versions it was made. [`super::derived`] is the event to tell of each, after its manifest.
///
/// # Errors
/// Steps that one cannot be made of, correlations with several products or one on another grid, several regions, some cropped and some
/// not or a crop to no region, a target that was not derived from the
/// same products, and what reading and writing meet; nothing is computed before all are looked at.
pub fn derive_statistics<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    options: &'a [MapOptions],
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Vec<Manifest>, ComputeError>> {
    Box::pin(async move {
        for _ in 1..MADE_AGAIN {
            match derive_statistics_if(engine, product, options, None, progress).await {
                // Its product was brought up to date meanwhile, as it was asked for before.
                Err(ComputeError::AskedOtherwise { .. }) => {}
                made => return made,
            }
        }
        derive_statistics_if(engine, product, options, None, progress).await
    })
}

/// The same, each landed only if the newest version of its product still asks for it.
///
/// # Errors
/// As there; `AskedOtherwise` of the first that does not, which is not landed. Those before it may be.
pub(crate) fn derive_statistics_if<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    options: &'a [MapOptions],
    is_still_asked: Option<&'a IsStillAsked<'a>>,
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Vec<Manifest>, ComputeError>> {
    Box::pin(async move {
        let sources = Sources::read(engine, product, options).await?;
        let wanted = Arc::new(Wanted::of(&sources.first, one_region(options)?)?);
        let stored = Stored::of(&sources.first.grid, options, &wanted)?;
        let mut asked = vec![];
        for one in options {
            let own = Asked::of(engine, sources.of(one)?, (one, &stored), is_still_asked);
            asked.push(own.await?);
        }
        let is_twice =
            |one: &Asked<'_>| asked.iter().filter(|own| own.target == one.target).count() > 1;
        if let Some(twice) = asked.iter().find(|one| is_twice(one)) {
            let reason = "two statistics would become this one product";
            return Err(ContractError::invalid("product", twice.target.as_str(), reason).into());
        }
        let plans = asked.iter().filter(|one| one.there.is_none());
        let plans: Vec<Plan> = plans.map(|one| one.plan.clone()).collect();
        let found = computed(engine, &sources, &plans, (&wanted, &stored), progress).await?;
        let mut found = found.into_iter();
        let mut all = vec![];
        for Asked {
            sources,
            target,
            plan,
            there,
        } in asked
        {
            if let Some(there) = there {
                all.push(Landed::There(there));
                continue;
            }
            let none = || ComputeError::inconsistent("a statistic", "it was not computed");
            let computed = found.next().ok_or_else(none)?;
            let landing = Landing {
                engine,
                sources,
                target: &target,
                plan: &plan,
                wanted: &wanted,
                stored: &stored,
            };
            all.push(Landed::New(match plan.statistic {
                MapStatistic::Anomaly => landing.anomalies(computed, progress).await?,
                _ => (landing.each(computed.maps).await?, None),
            }));
        }
        published(engine, all, is_still_asked).await
    })
}

/// A statistic of which everything but a new version is stored.
enum Landed {
    There(There),
    New(Made),
}

/// Publishes all, each of which could be made: none is without the others because of one of them that cannot.
async fn published(
    engine: &Engine,
    all: Vec<Landed>,
    is_still_asked: Option<&IsStillAsked<'_>>,
) -> Result<Vec<Manifest>, ComputeError> {
    let mut published = vec![];
    for one in all {
        let (derived, at_hand) = match one {
            Landed::There(There::AsItIs(latest)) => {
                published.push(latest);
                continue;
            }
            Landed::There(There::Renewed(renewed)) => (renewed, None),
            Landed::New(made) => made,
        };
        published.push(publish_if(engine, derived, at_hand, is_still_asked).await?);
    }
    Ok(published)
}

/// The region of all that is derived together.
fn one_region(options: &[MapOptions]) -> Result<Option<&AskedRegion>, ContractError> {
    let first = options.first().and_then(|one| one.region.as_ref());
    match options.iter().find(|one| one.region.as_ref() != first) {
        None => Ok(first),
        Some(other) => {
            let name = other.region.as_ref().map_or("global", |own| &own.name);
            let reason = "statistics that are derived together are of one region";
            Err(ContractError::invalid("region", name, reason))
        }
    }
}

/// A statistic that is asked for.
struct Asked<'a> {
    sources: SourcesOf<'a>,
    target: ProductId,
    plan: Plan,
    /// Its newest version, if that has the values that would be derived.
    there: Option<There>,
}

/// A version that has the values that would be derived.
enum There {
    /// It is what would be derived.
    AsItIs(Manifest),
    /// It says that it was made of other versions of the same steps, or does not keep the same request; the same values under
    /// what is to be said, with number 0.
    Renewed(Manifest),
}

impl<'a> Asked<'a> {
    async fn of(
        engine: &Engine,
        sources: SourcesOf<'a>,
        (options, stored): (&MapOptions, &Stored),
        is_still_asked: Option<&IsStillAsked<'_>>,
    ) -> Result<Self, ComputeError> {
        let target = options.target(&sources.first.product)?;
        let plan = Plan::of(sources, options)?;
        let mut there = None;
        let latest = manifests::latest(engine.store(), &target).await?;
        check_asked((&target, latest.as_ref()), is_still_asked)?;
        if let Some(latest) = latest {
            let made_from = made_from(&latest).into_iter().map(|from| &from.product);
            if !made_from.eq(sources.products()) {
                let reason = format!(
                    "there is a product of this name that is no statistic of {}: give another name",
                    sources.in_words()
                );
                return Err(ContractError::invalid("product", target.as_str(), reason).into());
            }
            if is_still_asked.is_none() {
                check_statistic(&latest, options.statistic)?;
                check_grid(engine, &latest, &plan, stored).await?;
            }
            if plan.has_values_of(&latest, stored)
                && verify::has_own(engine.store(), &latest).await?
            {
                there = Some(if plan.is_said_by(&latest, sources.first) {
                    // Whoever published it may have been killed before the cube followed.
                    cube::keep_up(engine.store(), &latest).await;
                    There::AsItIs(latest)
                } else {
                    There::Renewed(renewed(latest, sources, &plan))
                });
            }
        }
        Ok(Self {
            sources,
            target,
            plan,
            there,
        })
    }
}

/// # Errors
/// The version there is holds another statistic, which the next one would silently replace.
fn check_statistic(latest: &Manifest, asked: MapStatistic) -> Result<(), ContractError> {
    let there = latest.computed.as_ref().and_then(|own| match own.how {
        Computation::Correlation { statistic, .. } => Some(MapStatistic::Correlation(statistic)),
        ref how => how.statistic(),
    });
    match there {
        Some(there) if there != asked => Err(ContractError::invalid(
            "product",
            latest.product.as_str(),
            format!("it is the {there}, and would become the {asked}: give another name"),
        )),
        _ => Ok(()),
    }
}

/// # Errors
/// Another crop is asked for than that of the version there is, and others are made of it: they would stay on the grid that it has.
async fn check_grid(
    engine: &Engine,
    latest: &Manifest,
    plan: &Plan,
    stored: &Stored,
) -> Result<(), ComputeError> {
    let crop = |computed: Option<&Computed>| {
        let map = computed.and_then(|own| own.map.as_ref());
        map.filter(|map| map.crop).map(|map| map.region.clone())
    };
    if latest.grid == stored.grid || crop(latest.computed.as_ref()) == crop(Some(&plan.computed)) {
        return Ok(());
    }
    let made_of_it = made_of(engine.store(), &latest.product).await?;
    if made_of_it.is_empty() {
        return Ok(());
    }
    let of = |grid: Grid| format!("{} x {} cells", grid.rows, grid.cols);
    let names: Vec<&str> = made_of_it.iter().map(ProductId::as_str).collect();
    let reason = format!(
        "it is there on another grid ({}, it would be {}), and {} made of it on that: give another name",
        of(latest.grid),
        of(stored.grid),
        match &names[..] {
            [one] => format!("{one} is"),
            all => format!("{} are", all.join(", ")),
        }
    );
    Err(ContractError::invalid("product", latest.product.as_str(), reason).into())
}

/// A version with the same values, saying what they are made of now; its number is 0.
fn renewed(latest: Manifest, sources: SourcesOf<'_>, plan: &Plan) -> Manifest {
    Manifest {
        schema: MANIFEST_SCHEMA,
        number: 0,
        title: format!("{}, {}", sources.title(), plan.title),
        synthetic: sources.is_synthetic(),
        source: sources.citation(),
        series: vec![],
        derived_from: Some(sources.first.id()),
        computed: Some(plan.computed.clone()),
        ..latest
    }
}
