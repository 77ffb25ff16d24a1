//! `fluxglobe notice`: files or addresses in; a `granule.notice` for each on the event log, or printed, out.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context as _, Result};
use contract::digest::Digest;
use contract::event::{Body, Event};
use contract::index::DimensionIndex;
use contract::time::TimeMs;
use sha2::{Digest as _, Sha256};
use storage::log::EventLog;

use crate::cli::Notice;
use crate::progress;

/// Notices appended at once.
const AT_ONCE: usize = 100;
const READ_BYTES: usize = 1 << 20;

/// Prints notices, for a Kafka client of the caller's own.
pub(crate) fn print(options: &Notice) -> Result<()> {
    let mut clock = Clock::default();
    for file in &options.files {
        progress::result(&notice(file, options, &mut clock)?.to_json())?;
    }
    Ok(())
}

/// Appends notices to the log.
pub(crate) async fn send(log: &dyn EventLog, options: &Notice) -> Result<()> {
    let bar = progress::bar("send notices", options.files.len() as u64);
    let mut clock = Clock::default();
    for files in options.files.chunks(AT_ONCE) {
        let events = files.iter().map(|file| notice(file, options, &mut clock));
        log.append(&events.collect::<Result<Vec<Event>>>()?).await?;
        bar.inc(files.len() as u64);
    }
    progress::done(&bar, &format!("{} notices", options.files.len()));
    Ok(())
}

fn notice(file: &str, options: &Notice, clock: &mut Clock) -> Result<Event> {
    let is_address = file.contains("://") && !file.starts_with("file://");
    let (path, sha256, size_bytes) = if is_address {
        (file.to_owned(), options.sha256, None)
    } else {
        let path = std::path::absolute(file.trim_start_matches("file://"))?;
        let (sha256, size_bytes) =
            digest(&path).with_context(|| format!("cannot read {}", path.display()))?;
        (path.display().to_string(), Some(sha256), Some(size_bytes))
    };
    let body = Body::GranuleNotice {
        path,
        profile: options.profile.clone(),
        product: options.product.clone(),
        variable: options.variable.clone(),
        indexes: DimensionIndex::sorted(options.index.clone())?,
        sha256,
        size_bytes,
        attempt: 1,
    };
    let mut event = Event::new(uuid::Uuid::new_v4().to_string(), body);
    event.noticed = Some(clock.next()?);
    Ok(event)
}

/// Gives each notice a later time than the one before, since of two files for one period the later notice counts.
#[derive(Default)]
struct Clock {
    last: Option<TimeMs>,
}

impl Clock {
    fn next(&mut self) -> Result<TimeMs> {
        let now = now()?;
        let next = match self.last {
            Some(last) if last >= now => TimeMs::new(last.ms() + 1)?,
            _ => now,
        };
        self.last = Some(next);
        Ok(next)
    }
}

/// The clock on the wall.
pub(crate) fn now() -> Result<TimeMs> {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .context("the clock stands before 1970")?;
    Ok(TimeMs::new(since.as_millis() as i64)?)
}

/// Digest and size of a file, read in pieces.
fn digest(path: &Path) -> std::io::Result<(Digest, u64)> {
    use std::io::Read as _;
    let mut file = std::fs::File::open(path)?;
    let (mut sha, mut size_bytes, mut buffer) = (Sha256::new(), 0, vec![0; READ_BYTES]);
    loop {
        let read = file.read(&mut buffer)?;
        if read == 0 {
            return Ok((Digest::from_bytes(sha.finalize().into()), size_bytes));
        }
        sha.update(&buffer[..read]);
        size_bytes += read as u64;
    }
}
