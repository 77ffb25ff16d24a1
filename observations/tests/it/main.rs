//! Both homes of observations under one suite, the service between log and store, and what the network does to it.

mod conformance;
mod homes;
mod interruptions;
mod same_answers;
mod sample;
mod service;
