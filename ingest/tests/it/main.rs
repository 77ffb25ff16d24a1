//! Integration tests of ingest, one binary: whole files in, manifests and fields out.
#![expect(clippy::print_stderr, reason = "a test that skips says so")]
#![expect(clippy::float_cmp, reason = "these numbers are exact")]
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod attached;
mod attached_again;
mod attached_bands;
mod attached_bounds;
mod attached_cubes;
mod attached_moved;
mod attached_shards;
mod attached_web;
mod attributes;
mod axes;
mod bad_input;
mod bands;
mod calendars;
mod cf_files;
mod cleaned;
mod computed;
mod contained;
mod cubes;
mod damaged;
mod faults;
mod fixture;
mod further;
mod guarded;
mod half_floats;
mod hostile;
mod made;
mod many_steps;
mod masked;
mod memory;
mod observed;
mod open;
mod order;
mod other_writers;
mod quality;
mod real_files;
mod reread;
mod sandbox;
mod service;
mod sign;
mod slow_sources;
mod stamps;
mod survey;
mod synthetic;
mod tutorial_files;
mod web;
mod web_server;
