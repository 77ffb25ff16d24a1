//! What the CF conventions say about a file: coordinates, time, packing and quantity.

pub(crate) mod axis;
pub(crate) mod calendar;
pub(crate) mod carbon_flux;
pub(crate) mod cell_methods;
pub(crate) mod coordinate;
pub(crate) mod corner;
pub(crate) mod flag;
pub(crate) mod main_variable;
pub(crate) mod open;
pub(crate) mod packing;
pub(crate) mod period;
pub(crate) mod projection;
pub(crate) mod quantity;
mod single;
pub(crate) mod snapped;
pub(crate) mod spacing;
pub(crate) mod unmarked;
mod year_end;
