//! The tile server as its clients see it: the real router in process, over a memory store with real fields.
#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot go on fails, in its helpers as in itself"
)]

mod analysis;
mod annotations;
mod app;
mod area;
mod budget;
mod caching;
mod check;
mod connections;
mod doubles;
mod events;
mod faults;
mod flow;
mod forms;
mod globe;
mod health;
mod hostile;
mod limits;
mod live;
mod look;
mod masks;
mod metrics;
mod observations;
mod openapi;
mod palettes;
mod point;
mod posted;
mod products;
mod properties;
mod regions;
mod remembered;
mod remote_store;
mod schema;
mod serve;
mod statistics;
mod stream;
mod surroundings;
mod tilejson;
mod tiles;
mod versions;
mod viewer;
mod zarr;
