//! The tile server: HTTP requests in; map tiles, globe views, series, budgets, the catalogue and the viewer out.
//!
//! Every address is described beside its handler; `/api/openapi.json` gathers the descriptions (`openapi.rs`), and the
//! committed `openapi.json` is what it says. `/` and below are the viewer's files.
//!
//! `mode` is `map`, `points`, `sprites` or `volume`; products that are the eastward part of a vector have `flow` as well.
//!
//! Pictures and TileJSON take what surrounds the particles besides (`surroundings.rs`), part of the picture's name like
//! everything else.
//!
//! Times are ISO 8601 and any instant is valid; a missing one is the middle of the last step. `from` and `to` bound the
//! half-open period `[from, to)`. `manifest` names a version, as answers do; without it the newest one answers. `edition`
//! names what shapes a picture besides (`edition.rs`): an address with `time`, `manifest` and the edition of now is
//! answered as one that never changes. An instant outside what a product covers shows the nearest one inside; pictures
//! say so in `fluxglobe-time` and `fluxglobe-time-covered`. Where particles are lifted, pictures say where heights end in
//! `fluxglobe-heights-end`, and deep tiles in `fluxglobe-heights-within`; a view with nothing of the earth's surface in it
//! says so in `fluxglobe-tilt-with-ground`. Every refusal is one JSON body, `error::Refusal`.
//!
//! Tiles, views, TileJSON and legends take how a picture is to look, in the unit people read (`look.rs`).
//!
//! A geometry that no address has room for is sent along by POST (`bodies.rs`), which asks what GET asks. A region may be the cells
//! of a landed mask that have a code, `region=MASK:CODE` (`masks.rs`).
//!
//! `/zarr/PRODUCT` is the product's cube by keys of Zarr, as it lies in the store (`cubes.rs`).
//!
//! Left out on purpose: drawing and computing, which come in through the traits of [`backend`].

mod addresses;
mod allowance;
mod analyses;
mod annotations;
pub mod backend;
mod bodies;
mod catalogue;
mod caught;
mod client;
pub mod config;
mod connections;
mod cubes;
mod derivations;
mod edition;
pub mod error;
mod extract;
mod fair_gate;
mod gate;
mod ground;
pub mod live;
mod look;
mod masks;
pub mod metrics;
mod middleware;
mod openapi;
mod pictures;
mod readiness;
mod request;
mod rooms;
mod router;
mod routes;
mod serve;
mod single_flight;
mod state;
mod stream;
mod surroundings;
mod versions;

pub use catalogue::{Accumulated, Layer, Northward, equal_until};
pub use config::Settings;
pub use error::{ServeError, ServerError};
pub use request::job as picture_job;
pub use router::router;
pub use serve::{Server, serve};
pub use state::AppState;
