//! The tile server as its clients see it: the real router in process, over a memory store with real frames.

mod app;
mod budget;
mod caching;
mod check;
mod doubles;
mod globe;
mod health;
mod hostile;
mod limits;
mod metrics;
mod point;
mod products;
mod properties;
mod regions;
mod serve;
mod tilejson;
mod tiles;
mod viewer;
