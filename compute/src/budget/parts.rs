//! Parts beside the whole: regions beside the region that they are parts of.

use contract::budget::{BudgetAnswer, BudgetParts, BudgetQuery, RegionBudget, RegionsClosure};
use contract::manifest::Manifest;
use contract::region::{AskedRegion, Polygon, Region};

use super::closure::{mass_steps, of_time};
use super::fixed::{MASS_DECIMALS, decimal_text};
use super::of_region::of_region;
use crate::region::extent::{region_area_m2, rounding_m2};
use crate::region::mask;
use crate::{ComputeError, Engine};

const M2_PER_MILLION_KM2: f64 = 1e12;
const M2_PER_KM2: f64 = 1e6;

/// Adds the budgets of parts of the region to an answer, and what they come to beside it.
///
/// # Errors
/// `Region` for a part that has no budget, or parts that reach beyond the region.
pub(super) async fn add(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
    asked: &BudgetParts,
    answer: &mut BudgetAnswer,
) -> Result<(), ComputeError> {
    let of_mask;
    let parts = match asked {
        BudgetParts::Regions(regions) => regions,
        BudgetParts::Mask(mask) => {
            of_mask = mask::regions(engine.store(), mask).await?;
            &of_mask
        }
    };
    let together: Vec<Polygon> = parts
        .iter()
        .flat_map(|part| polygons(&part.region))
        .collect();
    let both = [polygons(&query.region), together.clone()].concat();
    // Regions may share, leave out or reach beyond so much before it is worth a word.
    let slack_m2 = rounding_m2(&both);
    check_inside(query, both, slack_m2)?;
    let mut budgets = vec![];
    for part in parts {
        let mut own = budget(engine, query, manifest, part).await?;
        // What is said of the whole is said once.
        own.notes.retain(|note| !answer.notes.contains(note));
        budgets.push(own);
    }
    let union = AskedRegion {
        region: Region::Polygons(together),
        name: "all regions together".to_owned(),
    };
    let united = BudgetQuery {
        errors: None,
        ..query.clone()
    };
    let united = budget(engine, &united, manifest, &union).await?;
    let closure = closure(answer, &budgets, &united, slack_m2).ok_or_else(|| {
        ComputeError::inconsistent(manifest.id().to_string(), "its sums exceed 128 bits")
    })?;
    let of_rows = of_time(&answer.rows, &answer.rows).ok_or_else(|| {
        ComputeError::inconsistent(manifest.id().to_string(), "its sums exceed 128 bits")
    })?;
    answer.closure.get_or_insert(of_rows).regions = Some(closure);
    answer.regions = budgets;
    Ok(())
}

async fn budget(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
    part: &AskedRegion,
) -> Result<RegionBudget, ComputeError> {
    let own = BudgetQuery {
        region: part.region.clone(),
        region_name: part.name.clone(),
        river: None,
        parts: None,
        ..query.clone()
    };
    let answer = of_region(engine, &own, manifest)
        .await
        .map_err(|e| match e {
            ComputeError::Region { reason } => named(&part.name, &reason),
            outside @ ComputeError::RegionOutside { .. } => named(&part.name, &outside.to_string()),
            other => other,
        })?;
    Ok(RegionBudget {
        region: answer.region,
        region_area_m2: answer.region_area_m2,
        ocean_area_m2: answer.ocean_area_m2,
        notes: answer.notes,
        rows: answer.rows,
    })
}

fn named(part: &str, reason: &str) -> ComputeError {
    ComputeError::Region {
        reason: format!("{part}: {reason}"),
    }
}

/// The region as polygons.
fn polygons(region: &Region) -> Vec<Polygon> {
    let rectangle = |[west, south, east, north]: [f64; 4]| {
        vec![Polygon {
            outer: vec![[west, south], [east, south], [east, north], [west, north]],
            holes: vec![],
        }]
    };
    match region {
        Region::Global => rectangle([-180.0, -90.0, 180.0, 90.0]),
        Region::Box {
            west,
            south,
            east,
            north,
        } => rectangle([*west, *south, *east, *north]),
        Region::Polygons(polygons) => polygons.clone(),
    }
}

/// `both` are polygons of the whole and of its parts.
///
/// # Errors
/// Parts lie outside of what they are to be parts of.
fn check_inside(
    query: &BudgetQuery,
    both: Vec<Polygon>,
    slack_m2: f64,
) -> Result<(), ComputeError> {
    if query.region == Region::Global {
        return Ok(());
    }
    let both_m2 = region_area_m2(&Region::Polygons(both), query.earth)?;
    let whole_m2 = region_area_m2(&Region::Polygons(polygons(&query.region)), query.earth)?;
    if both_m2 <= whole_m2 + slack_m2 {
        return Ok(());
    }
    Err(ComputeError::Region {
        reason: format!(
            "the regions reach {} beyond {}, which they are to be parts of: ask for a region that holds them, such as global",
            area_text(both_m2 - whole_m2),
            query.region_name
        ),
    })
}

/// An area that what is below a square kilometre can be seen of.
fn area_text(m2: f64) -> String {
    if m2 < 1e-3 * M2_PER_MILLION_KM2 {
        format!("{:.6} km²", m2 / M2_PER_KM2)
    } else {
        format!("{:.6} million km²", m2 / M2_PER_MILLION_KM2)
    }
}

/// None if a sum leaves 128 bits.
fn closure(
    whole: &BudgetAnswer,
    parts: &[RegionBudget],
    united: &RegionBudget,
    slack_m2: f64,
) -> Option<RegionsClosure> {
    let text = |steps: i128| decimal_text(steps, MASS_DECIMALS);
    let mut of_parts = parts.iter().map(|part| mass_steps(&part.rows));
    let regions = of_parts.try_fold(0i128, |sum, own| sum.checked_add(own?))?;
    let (whole_steps, union) = (mass_steps(&whole.rows)?, mass_steps(&united.rows)?);
    let areas_m2: f64 = parts.iter().map(|part| part.region_area_m2).sum();
    let at_least_0 = |m2: f64| if m2 > slack_m2 { m2 } else { 0.0 };
    let overlap_m2 = at_least_0(areas_m2 - united.region_area_m2);
    let left_out_m2 = at_least_0(whole.region_area_m2 - united.region_area_m2);
    let summary = match (overlap_m2 > 0.0, left_out_m2 > 0.0) {
        (false, false) => "the regions fill the whole and do not overlap".to_owned(),
        (true, false) => format!(
            "the regions fill the whole and overlap by {}",
            area_text(overlap_m2)
        ),
        (false, true) => format!(
            "the regions do not overlap and leave {} of the whole out, land included",
            area_text(left_out_m2)
        ),
        (true, true) => format!(
            "the regions overlap by {} and leave {} of the whole out, land included",
            area_text(overlap_m2),
            area_text(left_out_m2)
        ),
    };
    Some(RegionsClosure {
        regions_kg: text(regions),
        overlap_kg: text(regions.checked_sub(union)?),
        left_out_kg: text(whole_steps.checked_sub(union)?),
        whole_kg: text(whole_steps),
        overlap_m2,
        left_out_m2,
        summary,
    })
}
