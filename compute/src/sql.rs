//! SQL for analysts: a question as text in, rows out, read only and within limits of memory and time.
//!
//! A table a product, a row a cell and step. Filters on time and place become the steps and chunks that are read, and a
//! product is never held: rows come out in batches. Everything runs in this process, in one part, so that the same question
//! has the same bits on any machine; reading and decoding ahead use its other processors (docs/decisions/031).

mod about;
mod analysis;
mod axes;
mod batches;
mod budget;
mod checked;
mod columns;
mod compared;
mod copies;
mod joined;
mod limits;
mod mean_weighted;
mod named;
mod overlooked;
mod pinned;
mod place;
mod planning;
mod product_table;
mod reads;
mod rows;
mod running;
mod scan;
mod selection;
mod session;
mod statement;
mod statistics;
mod substituted;
mod tables;
mod told;
mod version;
mod whole_sums;
mod worked_out;
mod yielding;

pub use limits::SqlLimits;
pub use running::Rows;
pub use session::Sql;
pub(crate) use session::{CATALOG, SCHEMA};
