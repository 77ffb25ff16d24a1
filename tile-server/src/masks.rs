//! Regions as addresses name them, and those among them that are the cells of a mask: `MASK:CODE` in, polygons out, within the
//! room that geometries have together.

use contract::manifest::AskedVersion;
use contract::region::{AskedRegion, MaskCode};

use crate::analyses::region_bytes;
use crate::error::ServerError;
use crate::rooms::Room;
use crate::state::AppState;

/// The mask, perhaps in one of its versions, and the code of a text; none if it is no such region.
pub(crate) fn of_mask(text: &str) -> Option<(AskedVersion, MaskCode)> {
    let (mask, code) = MaskCode::split(text)?;
    Some((mask.parse().ok()?, code))
}

/// A region of an address, and the room that it takes if it is larger than an address: to be kept as long as something is made of
/// it.
pub(crate) async fn region(
    state: &AppState,
    text: &str,
) -> Result<(AskedRegion, Option<Room>), ServerError> {
    let Some((mask, code)) = of_mask(text) else {
        return Ok((text.parse()?, None));
    };
    let mask = state.catalogue.asked(&mask).await?;
    let cells = state.analyses.mask_region(&mask, code).await?;
    let room = state.bodies.room(region_bytes(&cells))?;
    Ok((AskedRegion::clone(&cells), Some(room)))
}

/// The same of a parameter that may be left out.
pub(crate) async fn some_region(
    state: &AppState,
    text: Option<&str>,
) -> Result<(Option<AskedRegion>, Option<Room>), ServerError> {
    let Some(text) = text else {
        return Ok((None, None));
    };
    let (region, room) = region(state, text).await?;
    Ok((Some(region), room))
}
