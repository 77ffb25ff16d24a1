//! One file for each noun that can be asked for; the addresses are in `router`.

pub(crate) mod area;
pub(crate) mod budget;
pub(crate) mod check;
pub(crate) mod events;
pub(crate) mod globe;
pub(crate) mod health;
pub(crate) mod legend;
pub(crate) mod line;
pub(crate) mod metrics;
pub(crate) mod observations;
pub(crate) mod openapi;
pub(crate) mod palettes;
pub(crate) mod picture;
pub(crate) mod platforms;
pub(crate) mod point;
pub(crate) mod products;
pub(crate) mod regions;
pub(crate) mod statistics;
pub(crate) mod stream;
pub(crate) mod tilejson;
pub(crate) mod tiles;
pub(crate) mod viewer;
pub(crate) mod zarr;
