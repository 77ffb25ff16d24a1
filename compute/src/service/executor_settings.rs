//! What an executor is told, by flag or environment.

use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use crate::SchedulerUrl;

/// What an executor is told.
#[derive(Debug, Clone, clap::Args)]
pub struct ExecutorSettings {
    /// The scheduler, host:port.
    #[arg(long, env = "FLUXGLOBE_SCHEDULER", default_value = "127.0.0.1:50050")]
    pub scheduler: SchedulerUrl,
    /// Address that others fetch intermediate results from; port 0 takes a free one.
    #[arg(
        long,
        env = "FLUXGLOBE_EXECUTOR_LISTEN",
        default_value = "127.0.0.1:50051"
    )]
    pub executor_listen: SocketAddr,
    /// Host that others find this executor under; what the scheduler sees if absent.
    #[arg(long, env = "FLUXGLOBE_EXECUTOR_HOST")]
    pub executor_host: Option<String>,
    /// Name of this executor in logs and lists, of letters, digits and -.
    #[arg(long, env = "FLUXGLOBE_EXECUTOR_NAME", default_value = "executor", value_parser = name)]
    pub executor_name: String,
    /// Tasks worked on at a time, 1 to 1,024; as many as there are processors if absent.
    #[arg(long, env = "FLUXGLOBE_EXECUTOR_TASKS",
          value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub executor_tasks: Option<u32>,
    /// Folder for intermediate results; executors may share it.
    #[arg(long, env = "FLUXGLOBE_EXECUTOR_WORK", default_value = "executor-work")]
    pub executor_work: PathBuf,
    /// Bytes of intermediate results above which no new task is taken.
    #[arg(long, env = "FLUXGLOBE_EXECUTOR_WORK_BYTES", default_value_t = 32 << 30,
          value_parser = clap::value_parser!(u64).range(1 << 20..))]
    pub executor_work_bytes: u64,
    /// Bytes of memory for sorting and joining, shared by the tasks; what does not fit goes to the work folder.
    #[arg(long, env = "FLUXGLOBE_EXECUTOR_MEMORY_BYTES", default_value_t = 4 << 30,
          value_parser = clap::value_parser!(u64).range(64 << 20..))]
    pub executor_memory_bytes: u64,
    /// Seconds that running tasks are waited for when the executor is asked to stop, 0 to 3,600.
    #[arg(long, env = "FLUXGLOBE_EXECUTOR_DRAIN_S", default_value_t = 30,
          value_parser = clap::value_parser!(u64).range(0..=3600))]
    pub executor_drain_s: u64,
}

fn name(text: &str) -> Result<String, String> {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-';
    if (1..=63).contains(&text.len()) && text.bytes().all(is_plain) {
        Ok(text.to_owned())
    } else {
        Err("1 to 63 letters, digits and -".to_owned())
    }
}

impl ExecutorSettings {
    /// Tasks worked on at a time.
    pub(super) fn tasks(&self) -> usize {
        let processors = || std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        self.executor_tasks
            .map_or_else(processors, |tasks| tasks as usize)
    }
}
