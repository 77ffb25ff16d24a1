//! What a picture is drawn from, as a name: pictures of one name find their fields on one worker.

use contract::job::RenderJob;

/// The field that the instant has passed, which names the product as well. Fields are named by their content, so a new
/// version of a product leaves what did not change where it is.
pub(super) fn of(job: &RenderJob) -> &str {
    let sample = &job.value;
    sample.before.as_ref().unwrap_or(&sample.domain).as_str()
}
