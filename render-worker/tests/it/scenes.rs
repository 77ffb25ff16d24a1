//! Made-up scenes and the views they are looked at from.

pub(crate) use render_proof::ocean::{FIVE_DEGREES, ONE_DEGREE, scene as ocean};
pub(crate) use render_proof::views::{globe, tile};

use contract::job::{Mode, RenderJob, View};

/// A job in the default style of fluxes.
pub(crate) fn job(mode: Mode, view: View) -> RenderJob {
    RenderJob {
        mode,
        ..render_proof::ocean::job(view)
    }
}
