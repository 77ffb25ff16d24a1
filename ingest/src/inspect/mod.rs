//! [`RawGranule`] in, [`InspectedGranule`] out: what the file holds, as its reader process says, within the limits.

pub(crate) mod arrays;
pub(crate) mod file;
pub(crate) mod indexed;
pub mod reader;
pub(crate) mod values;

use contract::event::RejectReason;

use crate::error::{Rejection, Stop};
use crate::fetch::RawGranule;
use crate::inspect::file::description::Description;
use crate::inspect::reader::session::Session;
use crate::limits::Limits;
use crate::settings::Settings;

/// A file whose contents are listed; its reader process waits for questions.
pub(crate) struct InspectedGranule {
    pub(crate) raw: RawGranule,
    pub(crate) session: Session,
    pub(crate) description: Description,
}

pub(crate) async fn run(raw: RawGranule, settings: &Settings) -> Result<InspectedGranule, Stop> {
    let (session, description) = Session::open(&raw.path, settings).await?;
    check_sizes(&description, settings.limits)?;
    Ok(InspectedGranule {
        raw,
        session,
        description,
    })
}

/// Refuses a file that declares more than may be, before a byte of it is allocated.
fn check_sizes(description: &Description, limits: Limits) -> Result<(), Rejection> {
    if description.variables.is_empty() {
        return Err(Rejection::new(
            RejectReason::NoVariable,
            "file",
            "holds no variable; give a file with a gridded variable",
        ));
    }
    for variable in &description.variables {
        let cells = variable.cell_count();
        if cells > u128::from(limits.variable_cells) {
            let shape = variable
                .dimensions
                .iter()
                .map(|d| d.len.to_string())
                .collect::<Vec<_>>()
                .join(" x ");
            let detail = format!(
                "declares {shape} = {cells} cells, at most {} are read; give it in smaller pieces",
                limits.variable_cells
            );
            return Err(Rejection::new(
                RejectReason::TooLarge,
                &variable.name,
                detail,
            ));
        }
    }
    Ok(())
}
