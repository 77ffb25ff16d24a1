//! Computations as a whole: products written through the storage crate, answers through Ballista in this process.

mod accumulated;
mod budgets;
mod fixture;
mod parallel;
mod places;
mod takahashi;
