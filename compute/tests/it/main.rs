//! Computations as a whole: products written through the storage crate, answers through Ballista in this process.

#[cfg(test)]
mod accumulated;
#[cfg(test)]
mod budgets;
#[cfg(test)]
mod fixture;
#[cfg(test)]
mod parallel;
#[cfg(test)]
mod places;
#[cfg(test)]
mod regions;
#[cfg(test)]
mod takahashi;
