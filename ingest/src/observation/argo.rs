//! What profiles of Argo floats have beside the CF conventions: adjusted values next to those as they came, and numbers of floats.
//!
//! Source: Argo user's manual, doi:10.13155/29825.

use super::values::{read, read_stored};
use crate::error::Stop;
use crate::inspect::file::description::{Description, Dimension, Kind, Variable};
use crate::inspect::reader::session::Session;

/// The variable that holds the number of each cast's float.
pub(super) const PLATFORM: &str = "PLATFORM_NUMBER";
const ADJUSTED: &str = "_ADJUSTED";
/// The variable with the mode of each cast, of files in which all parameters of a cast have one.
const MODE: &str = "DATA_MODE";
/// The variable with the mode of each parameter of each cast, of files with biogeochemical parameters.
const MODES: &str = "PARAMETER_DATA_MODE";
/// The variable that names these parameters, in the same order.
const PARAMETERS: &str = "STATION_PARAMETERS";
/// Mode of a cast whose values nobody has adjusted yet.
const REAL_TIME: u8 = b'R';

/// Modes of a variable.
pub(super) struct Modes {
    /// What they run along: casts.
    pub(super) dimensions: Vec<Dimension>,
    /// Letters by their numbers.
    pub(super) values: Vec<f64>,
}

/// Does a variable hold adjusted values?
pub(super) fn is_adjusted(variable: &Variable) -> bool {
    variable.name.ends_with(ADJUSTED)
}

/// The adjusted values of what a variable holds as it came, or the other way round.
pub(super) fn twin<'a>(file: &'a Description, variable: &Variable) -> Option<&'a Variable> {
    let twin = match variable.name.strip_suffix(ADJUSTED) {
        Some(raw) => raw.to_owned(),
        None => format!("{}{ADJUSTED}", variable.name),
    };
    file.variable(&twin)
}

/// The mode of each cast, if a variable is there as it came and adjusted: of its own, where parameters have modes, else that of all.
pub(super) async fn modes(
    session: &mut Session,
    file: &Description,
    variable: &Variable,
) -> Result<Option<Modes>, Stop> {
    if twin(file, variable).is_none() {
        return Ok(None);
    }
    let own = of_parameter(session, file, variable).await?;
    let Some(of_all) = letters(file, MODE).filter(|_| own.is_none()) else {
        return Ok(own);
    };
    Ok(Some(Modes {
        dimensions: of_all.dimensions.clone(),
        values: read(session, of_all).await?,
    }))
}

/// The modes of one parameter; a cast that does not name it has none.
async fn of_parameter(
    session: &mut Session,
    file: &Description,
    variable: &Variable,
) -> Result<Option<Modes>, Stop> {
    let (Some(modes), Some(parameters)) = (letters(file, MODES), letters(file, PARAMETERS)) else {
        return Ok(None);
    };
    let ([casts, columns], [others @ .., length]) = (
        modes.dimensions.as_slice(),
        parameters.dimensions.as_slice(),
    ) else {
        return Ok(None);
    };
    if others != modes.dimensions || columns.len == 0 || length.len == 0 {
        return Ok(None);
    }
    let (of_all, names) = (
        read_stored(session, modes).await?,
        read_stored(session, parameters).await?,
    );
    let raw = variable.name.strip_suffix(ADJUSTED);
    let raw = raw.unwrap_or(&variable.name);
    let of_cast = |(modes, names): (&[f64], &[f64])| {
        let mut names = names.chunks(length.len as usize);
        let column = names.position(|letters| is_name(letters, raw));
        column.map_or(f64::NAN, |column| modes[column])
    };
    let (columns, all_letters) = (
        columns.len as usize,
        columns.len.saturating_mul(length.len) as usize,
    );
    let by_cast = of_all.chunks(columns).zip(names.chunks(all_letters));
    Ok(Some(Modes {
        dimensions: vec![casts.clone()],
        values: by_cast.map(of_cast).collect(),
    }))
}

fn letters<'a>(file: &'a Description, name: &str) -> Option<&'a Variable> {
    file.variable(name)
        .filter(|variable| variable.kind == Kind::Text(1))
}

/// Do letters, with blanks or zeros behind them, spell a name?
fn is_name(letters: &[f64], name: &str) -> bool {
    let text: String = letters
        .iter()
        .map(|letter| char::from(*letter as u8))
        .collect();
    text.trim_end_matches([' ', '\0']) == name
}

/// Do the values of a variable count in a cast of this mode? In real time those that came, later the adjusted ones: where these
/// lack a value, the one that came was found to be bad.
pub(super) fn counts(variable: &Variable, mode: f64) -> bool {
    let is_real_time = (mode - f64::from(REAL_TIME)).abs() < 0.5;
    is_real_time != is_adjusted(variable)
}

/// Values of a variable that lies beside its twin along whole casts, in each cast those that count; none if it has no twin so, or no
/// modes. A pressure may be as it came where what was measured there is adjusted.
pub(super) async fn counting(
    session: &mut Session,
    file: &Description,
    variable: &Variable,
) -> Result<Option<Vec<f64>>, Stop> {
    let Some(twin) = twin(file, variable).filter(|twin| twin.dimensions == variable.dimensions)
    else {
        return Ok(None);
    };
    let Some(modes) = modes(session, file, variable).await? else {
        return Ok(None);
    };
    let in_cast = variable.dimensions.iter().skip(modes.dimensions.len());
    let in_cast = in_cast.fold(1, |cells: u64, d| cells.saturating_mul(d.len));
    if !variable.dimensions.starts_with(&modes.dimensions) || in_cast == 0 {
        return Ok(None);
    }
    let (own, other) = (read(session, variable).await?, read(session, twin).await?);
    let by_cast = own
        .chunks(in_cast as usize)
        .zip(other.chunks(in_cast as usize));
    let mut values = Vec::with_capacity(own.len());
    for ((own, other), mode) in by_cast.zip(&modes.values) {
        let counting = if counts(variable, *mode) { own } else { other };
        values.extend_from_slice(counting);
    }
    Ok(Some(values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_parameters_end_with_blanks_or_zeros() {
        let letters = |text: &str| text.bytes().map(f64::from).collect::<Vec<_>>();
        assert!(is_name(&letters("DOXY    "), "DOXY"));
        assert!(is_name(&letters("DOXY\0\0"), "DOXY"));
        assert!(!is_name(&letters("DOXY2   "), "DOXY"));
        assert!(!is_name(&letters("        "), "DOXY"));
    }
}
