//! A notice in, [`RawGranule`] out: a file that can be read here, and its digest.
//!
//! A file on the command line is read where it is. The service reads only what its settings allow ([`Sources`]): files in
//! allowed folders, public addresses, allowed stores; what comes over the network goes to the [`spool`] first.

mod address;
mod checksum;
mod guard;
mod http;
mod keep;
mod local;
mod location;
mod object;
mod pace;
mod raw;
mod retry;
mod source_wait;
mod spool;
mod stored;
mod turns;
mod web_objects;

pub(crate) use checksum::{Expected, Method};
pub(crate) use guard::Allowed;
pub use guard::Sources;
pub use http::AllowedHost;
pub(crate) use location::Location;
pub(crate) use raw::{HELD_BYTES, RawGranule};
pub use retry::RetryLimits;
pub(crate) use source_wait::SourceWait;
pub(crate) use stored::RawFiles;
pub(crate) use web_objects::WebObjects;

use crate::error::Stop;
use crate::settings::Settings;

/// Has a file that can be read by its path from now on.
pub(crate) async fn run(
    location: &Location,
    expected: &Expected,
    settings: &Settings,
) -> Result<RawGranule, Stop> {
    settings
        .sources
        .fetch(location, expected, settings.limits)
        .await
}
