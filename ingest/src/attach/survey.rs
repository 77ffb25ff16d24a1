//! A request in, the plan of what is read of a store of others out; only documents and coordinates are read.

use std::sync::Arc;

use contract::event::RejectReason;
use contract::index::DimensionIndex;
use contract::product::ProductId;
use cube::foreign::{Absent, Foreign, Found};
use storage::attached::Attachment;

use super::reading::Reading;
use super::{Request, address};
use crate::error::{IngestError, Rejection, Stop};
use crate::inspect::arrays::{self, Arrays, Indexes};
use crate::inspect::values::Values;
use crate::limits::Limits;
use crate::plan::cf::packing::{StoredPacking, Unpacked};
use crate::plan::profile::Profile;
use crate::plan::{self, Plan, Wish, written};

/// What was found at an address, and what of it is read as what.
pub(super) struct Survey {
    pub(super) plan: Plan,
    pub(super) attachment: Attachment,
    pub(super) foreign: Arc<Foreign>,
    pub(super) indexes: Indexes,
    /// Name of the store, for people.
    pub(super) place: String,
}

impl Survey {
    /// Looks through a store.
    pub(super) async fn of(
        request: &Request,
        profile: Option<&Profile>,
        limits: Limits,
    ) -> Result<Self, Stop> {
        let variable = match (&request.variable, profile) {
            (_, Some(profile)) => profile.variable.name.as_str(),
            (Some(name), None) => name.as_str(),
            (None, None) => {
                let detail = "which array holds the values? say --variable NAME";
                return Err(Rejection::new(RejectReason::NoVariable, "variable", detail).into());
            }
        };
        let objects = address::open(&request.address).map_err(arrays::stopped)?;
        let place = objects.place();
        let found = Found::at(&objects).await.map_err(arrays::stopped)?;
        let foreign = Foreign::open(objects, found, Some(variable)).await;
        let foreign = Arc::new(foreign.map_err(arrays::stopped)?);
        let array = foreign.array(variable).map_err(arrays::stopped)?;
        array.value_bytes().map_err(arrays::stopped)?;
        let (asked, indexes) = asked(&request.indexes)?;
        let description = arrays::describe(&foreign, &indexes)?;
        let fill = array.fill;
        let own = written::description(&foreign.attributes, variable).filter(|_| profile.is_none());
        let wish = Wish {
            profile,
            product: request.product.as_ref(),
            variable: Some(variable),
            meaning: own.as_ref().map(written::meaning),
            indexes: &asked,
        };
        // What is not there is fill value: no data, if the conventions say that of it.
        let own = description.variable(variable);
        let packing = own.map(|own| plan::packing(own, profile)).transpose()?;
        let is_no_data = packing
            .zip(fill)
            .is_some_and(|(packing, fill)| packing.unpacked(fill) == Unpacked::Missing);
        let absent = if is_no_data {
            Absent::Fill
        } else {
            Absent::Refused
        };
        let values = Arrays::new(
            Arc::clone(&foreign),
            indexes.clone(),
            (variable.to_owned(), absent),
            limits.plane_cells,
        );
        let held = (Values::Arrays(values.clone()), &description);
        let mut plan = plan::plan(held, &file_name(&place), wish, limits).await?;
        plan.target.synthetic |= written::is_synthetic(&foreign.attributes);
        plan.assumptions
            .extend(values.assumptions().into_iter().map(plan::line));
        if plan.quality.is_some() {
            let detail = "asks by [quality] for a second array, which attached products are not read with; leave it out or land the files";
            return Err(Rejection::new(RejectReason::Values, "profile", detail).into());
        }
        let reading = Reading {
            quantity: plan.target.quantity,
            profile: request.profile.clone(),
            axes: plan.axes.clone(),
            indexes: indexes.clone(),
            mapping: plan.mapping.clone(),
            packing: StoredPacking::from(&plan.packing),
            absent_is_no_data: is_no_data,
        };
        let attachment = attachment(&plan.target.product, (&place, &foreign), variable, &reading)?;
        Ok(Self {
            plan,
            attachment,
            foreign,
            indexes,
            place,
        })
    }
}

/// The indexes that are asked for, in the order of their dimensions and by their names.
fn asked(indexes: &[(String, u64)]) -> Result<(Vec<DimensionIndex>, Indexes), Rejection> {
    let each = indexes.iter().map(|(dimension, index)| DimensionIndex {
        dimension: dimension.clone(),
        index: *index,
    });
    let asked = DimensionIndex::sorted(each.collect())
        .map_err(|error| Rejection::new(RejectReason::Grid, "index", error.to_string()))?;
    Ok((asked, indexes.iter().cloned().collect()))
}

fn attachment(
    product: &ProductId,
    (place, foreign): (&str, &Foreign),
    variable: &str,
    reading: &Reading,
) -> Result<Attachment, IngestError> {
    let reading = serde_json::to_value(reading).map_err(|e| IngestError::Attach {
        product: product.to_string(),
        detail: e.to_string(),
    })?;
    let found = foreign.found.clone();
    let store = (place.to_owned(), found.kind, found.snapshot);
    Ok(Attachment::new(
        product.clone(),
        store,
        variable.to_owned(),
        reading,
    ))
}

/// The last part of an address, which may hold a date as the name of a file does.
fn file_name(place: &str) -> String {
    let last = place.trim_end_matches('/').rsplit('/').next();
    last.unwrap_or_default().to_owned()
}
