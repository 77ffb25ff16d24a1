//! Computations as a whole: products written through the storage crate, answers through Ballista in this process and in others.

#[cfg(test)]
mod accumulated;
#[cfg(test)]
mod analysed;
#[cfg(test)]
mod anomalies;
#[cfg(test)]
mod banded;
#[cfg(test)]
mod budgets;
#[cfg(test)]
mod cleaned;
#[cfg(test)]
mod closure;
#[cfg(test)]
mod cluster;
#[cfg(test)]
mod co2_flux;
#[cfg(test)]
mod computed;
#[cfg(test)]
mod correlated;
#[cfg(test)]
mod cropped;
#[cfg(test)]
mod damaged;
#[cfg(test)]
mod fixture;
#[cfg(test)]
mod flight_sql;
#[cfg(test)]
mod fluxengine;
#[cfg(test)]
mod followed;
#[cfg(test)]
mod frozen;
#[cfg(test)]
mod history;
#[cfg(test)]
mod incremental;
#[cfg(test)]
mod maps;
#[cfg(test)]
mod node;
#[cfg(test)]
mod ocean;
#[cfg(test)]
mod parallel;
#[cfg(test)]
mod places;
#[cfg(test)]
mod quarter_degree;
#[cfg(test)]
mod reading;
#[cfg(test)]
mod recomputed;
#[cfg(test)]
mod regions;
#[cfg(test)]
mod remembered_sums;
#[cfg(test)]
mod sql;
#[cfg(test)]
mod sql_analysis;
#[cfg(test)]
mod statistics;
#[cfg(test)]
mod stored_sums;
#[cfg(test)]
mod strangers;
#[cfg(test)]
mod takahashi;
#[cfg(test)]
mod told;
#[cfg(test)]
mod troubled;
#[cfg(test)]
mod uncertainty;
#[cfg(test)]
mod windows;
