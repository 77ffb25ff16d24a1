//! All values of one variable, as it is stored and unpacked, within a limit.

use contract::event::RejectReason;

use crate::error::{Rejection, Stop};
use crate::inspect::file::description::{Kind, Part, Variable};
use crate::inspect::reader::session::Session;
use crate::plan::cf::packing::Packing;

/// Most values of one variable.
pub(crate) const MAX_VALUES: u64 = 1 << 24;

/// All values of a variable, unpacked, NaN where there is none, in the order of its dimensions.
pub(super) async fn read(session: &mut Session, variable: &Variable) -> Result<Vec<f64>, Stop> {
    let stored = read_stored(session, variable).await?;
    let packing = Packing::of(variable).with_any_range_text();
    let packing = packing.checked(variable)?;
    Ok(stored.into_iter().map(|v| packing.value(v)).collect())
}

/// All stored numbers of a variable. A reader gives two whole dimensions at a time; the slower ones are walked through.
pub(super) async fn read_stored(
    session: &mut Session,
    variable: &Variable,
) -> Result<Vec<f64>, Stop> {
    let cells = variable.cell_count();
    if cells > u128::from(MAX_VALUES) {
        let detail =
            format!("has {cells} values, at most {MAX_VALUES} are read; give it in smaller pieces");
        return Err(Rejection::new(RejectReason::TooLarge, &variable.name, detail).into());
    }
    let lens: Vec<u64> = variable.dimensions.iter().map(|d| d.len).collect();
    if lens.contains(&0) {
        return Ok(vec![]);
    }
    // Letters are read whole.
    if variable.kind == Kind::Text(1) {
        let whole = vec![Part::All; lens.len()];
        return session.read(&variable.name, &whole, cells as u64).await;
    }
    // Dimensions of one element cost nothing to fix.
    let long: Vec<usize> = (0..lens.len()).filter(|i| lens[*i] > 1).collect();
    let whole = &long[long.len().saturating_sub(2)..];
    let outer = &long[..long.len() - whole.len()];
    let fixed = lens.len() > whole.len() + outer.len();
    let mut part: Vec<Part> = vec![Part::At(0); lens.len()];
    for place in whole {
        part[*place] = Part::All;
    }
    // HDF5 gives one or two whole dimensions: a variable of single elements is asked for with one of them.
    if whole.is_empty() && fixed {
        part[0] = Part::All;
    }
    let run: u64 = whole.iter().map(|i| lens[*i]).product();
    let runs: u64 = outer.iter().map(|i| lens[*i]).product();
    let mut values = Vec::with_capacity(usize::try_from(run * runs).unwrap_or_default());
    for at in 0..runs {
        let mut rest = at;
        for place in outer.iter().rev() {
            part[*place] = Part::At(rest % lens[*place]);
            rest /= lens[*place];
        }
        values.extend(session.read(&variable.name, &part, run).await?);
    }
    Ok(values)
}
