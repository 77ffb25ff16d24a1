//! The tile server: HTTP requests in; map tiles, globe views, series, budgets, the catalogue and the viewer out.
//!
//! | address | answer |
//! |---|---|
//! | `/tiles/{product}/{mode}/{z}/{x}/{y}.png?time=&size=&manifest=` | Web Mercator tile, 256 or 512 pixels (`{y}@2x.png` is 512) |
//! | `/tiles/{product}/{mode}.json?time=&manifest=` | TileJSON 3.0.0 of the layer |
//! | `/globe/{product}/{mode}.png?lon=&lat=&height_km=&time=&width=&height=&surface=&manifest=` | view of the globe |
//! | `/api/products` | every product, its steps, modes and legend |
//! | `/api/products/{product}/legend.json`, `.svg`, `.png` | what the colours mean |
//! | `/api/products/{product}/point?lon=&lat=&manifest=` | series of the cell at a place |
//! | `/api/products/{product}/area?region=&from=&to=&earth=&manifest=` | mean over a region at every step, with its coverage |
//! | `/api/products/{product}/budget?region=&from=&to=&step=&earth=&cells=&manifest=` | carbon budget, its coverage of the sea and what gaps would add |
//! | `/api/regions` | regions with a name |
//! | `/api/palettes` | palettes with a name |
//! | `/api/check` | our budgets beside a paper's and an independent integration's, `null` where there is nothing to compare with |
//! | `/api/events` | news of new versions as server-sent events |
//! | `/api/observations/platforms?bbox=&from=&to=&property=&kind=` | buoys, ships, stations and profiles as GeoJSON |
//! | `/api/observations/{dataset}/{platform}?property=&from=&to=&after=` | what one of them measured |
//! | `/healthz`, `/readyz`, `/metrics` | the process lives; it can serve; Prometheus text |
//! | `/` and below | the viewer's files |
//!
//! `mode` is `map`, `points`, `sprites` or `volume`; products that are the eastward part of a vector have `flow` as well.
//!
//! Pictures and TileJSON take `relief=&relief_exaggeration=&sea_opacity=&coastlines=&sun=&height_exaggeration=` besides:
//! what surrounds the particles (`surroundings.rs`), part of the picture's name like everything else.
//! Times are ISO 8601 and any instant is valid; a missing one is the middle of the last step. `from` and `to` bound
//! the half-open period `[from, to)`. `manifest` names a version, as answers do; without it the newest one answers. An instant outside what a
//! product covers shows the nearest one inside; pictures say so in `fluxglobe-time` and `fluxglobe-time-covered`. Every refusal is JSON, `{"error": reason}`.
//!
//! Tiles, views, TileJSON and legends take how a picture is to look, in the unit people read: `palette`, `range` (`LOW:HIGH`), `stops`
//! (`VALUE:rrggbb,...`), `opacity` and `particle_size` (`VALUE:SHARE,...`), `reverse`, and `doubt`, which draws filled cells differently.
//!
//! Left out on purpose: drawing and computing, which come in through the traits of [`backend`].

mod analyses;
pub mod backend;
mod catalogue;
pub mod config;
mod connections;
pub mod error;
mod extract;
mod flights;
mod gate;
pub mod legend;
pub mod live;
mod look;
pub mod metrics;
mod middleware;
mod openapi;
mod pictures;
mod request;
mod router;
mod routes;
mod serve;
mod state;
mod surroundings;
mod versions;

pub use catalogue::{Accumulated, Layer, Northward};
pub use config::Settings;
pub use error::{ServeError, ServerError};
pub use request::job as picture_job;
pub use router::router;
pub use serve::{Server, serve};
pub use state::AppState;
