//! What of a version a question is about: its steps in a period, its cell at a place; or what there is instead.

use super::{Manifest, Step};
use crate::ContractError;
use crate::grid::LonLatDeg;
use crate::time::{Period, TimeMs};

impl Manifest {
    /// The asked period, all that is covered where its ends are left open, and the steps that reach into it.
    ///
    /// # Errors
    /// No step does, or the period ends before it starts.
    pub fn steps_inside(
        &self,
        from: Option<TimeMs>,
        to: Option<TimeMs>,
    ) -> Result<(Period, Vec<&Step>), ContractError> {
        let none = |asked: &str| {
            let covered = self.extent();
            let covered = covered.map_or_else(|| "nothing".to_owned(), |period| period.to_string());
            let reason = format!("{} has no step in it; it covers {covered}", self.product);
            Err(ContractError::invalid("period", asked, reason))
        };
        let Some(extent) = self.extent() else {
            return none("any");
        };
        let (start, end) = (from.unwrap_or(extent.start), to.unwrap_or(extent.end));
        let window = match Period::new(start, end) {
            Ok(window) => window,
            // A start or end that the asker left out may fall on the wrong side of the one given.
            Err(_) if from.is_none() || to.is_none() => return none(&format!("{start}/{end}")),
            Err(e) => return Err(e),
        };
        let inside = self.steps.iter();
        let inside: Vec<_> = inside.filter(|step| step.period.overlaps(window)).collect();
        if inside.is_empty() {
            return none(&window.to_string());
        }
        Ok((window, inside))
    }

    /// The cell that holds a place: `(row, col)`.
    ///
    /// # Errors
    /// It lies outside the grid.
    pub fn cell_inside(&self, place: LonLatDeg) -> Result<(u32, u32), ContractError> {
        self.grid.cell_at(place).ok_or_else(|| {
            let reason = format!(
                "it lies outside the grid of {}, which covers {}",
                self.product,
                self.bounds_text()
            );
            ContractError::invalid("place", &format!("{},{}", place.lon, place.lat), reason)
        })
    }

    /// Bounds of the grid for people.
    pub fn bounds_text(&self) -> String {
        let [west, south, east, north] = self.grid.shown_bounds_deg();
        format!("{west} to {east} degrees east, {south} to {north} degrees north")
    }
}
