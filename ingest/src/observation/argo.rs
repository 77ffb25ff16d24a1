//! What profiles of Argo floats have beside the CF conventions: adjusted values next to those as they came, and numbers of floats.
//!
//! Source: Argo user's manual, doi:10.13155/29825.

use crate::inspect::file::description::{Description, Kind, Variable};

/// The variable that holds the number of each cast's float.
pub(super) const PLATFORM: &str = "PLATFORM_NUMBER";
const ADJUSTED: &str = "_ADJUSTED";
/// Mode of a cast whose values nobody has adjusted yet.
const REAL_TIME: u8 = b'R';

/// Does a variable hold adjusted values?
pub(super) fn is_adjusted(variable: &Variable) -> bool {
    variable.name.ends_with(ADJUSTED)
}

/// The variable with the mode of each cast, if a variable is there as it came and adjusted.
pub(super) fn mode<'a>(file: &'a Description, variable: &Variable) -> Option<&'a Variable> {
    let twin = match variable.name.strip_suffix(ADJUSTED) {
        Some(raw) => raw.to_owned(),
        None => format!("{}{ADJUSTED}", variable.name),
    };
    file.variable(&twin)?;
    file.variable("DATA_MODE")
        .filter(|mode| mode.kind == Kind::Text(1))
}

/// Do the values of a variable count in a cast of this mode? In real time those that came, later the adjusted ones: where these
/// lack a value, the one that came was found to be bad.
pub(super) fn counts(variable: &Variable, mode: f64) -> bool {
    let is_real_time = (mode - f64::from(REAL_TIME)).abs() < 0.5;
    is_real_time != is_adjusted(variable)
}
