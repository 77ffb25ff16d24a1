//! The harness of the end-to-end tests: runs the built program as people do, and knows where the real files are.

pub mod camera;
pub mod cluster;
pub mod gate;
pub mod granule;
pub mod http;
pub mod mask;
pub mod node;
pub mod program;
pub mod proxy;
pub mod raw_stream;
pub mod server;
pub mod servers;
pub mod small_disk;
pub mod web;
