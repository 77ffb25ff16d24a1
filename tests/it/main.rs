//! All end-to-end tests as one binary: the built program, run as people run it.

#![expect(clippy::unwrap_used, reason = "a test ends where it cannot go on")]

mod animation;
mod attached_bucket;
mod backup;
mod bad_clients;
mod bad_input;
mod behind;
mod bench_serve;
mod browser;
mod circles;
mod correlated;
mod damaged;
mod dependencies;
mod end_to_end;
mod exported;
mod harness_self;
mod interop;
mod large_map;
mod logged;
mod masks;
mod migrate;
mod pinned;
mod quality;
mod recipe;
mod reread;
mod same_answers;
mod sea;
mod sql;
mod tracked_files;
