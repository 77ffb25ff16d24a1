//! What every object store must do, seen on folders, memory, a real S3 server and a real Hadoop file system.
//!
//! The S3 server and the file system are those that `deploy/services/services.sh` starts and names in the environment.
//! Google's and Azure's clients are not run here, there is no server of theirs to be had: their settings and error
//! texts are tested beside the code.
#![expect(clippy::unwrap_used, reason = "a test ends where it cannot go on")]
#![expect(clippy::print_stdout, reason = "a test of faults says how many fired")]

mod attached;
mod conformance;
mod cut_proxy;
mod fault_proxy;
mod faults;
mod frozen;
mod killed;
mod name_node;
mod pinned;
mod restarts;
mod stores;
mod suite;
