//! What comes over the network in, a file in the spool out: no more than is allowed, and what was announced.

use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use futures::StreamExt as _;
use futures::stream::BoxStream;
use tokio::io::{AsyncWriteExt as _, BufWriter};

use super::checksum::{Check, Expected, wrong_size};
use super::local;
use super::pace::{Pace, Slowest};
use super::raw::{Held, RawGranule, Stamp};
use super::retry::Miss;
use super::spool::{self, Spooled};
use crate::error::Rejection;

/// Bytes gathered before they are written.
const WRITE_BYTES: usize = 1 << 20;

/// What comes.
pub(super) struct Keep<'a> {
    pub(super) file_name: String,
    pub(super) chunks: BoxStream<'a, Result<Bytes, Miss>>,
    /// What the source says that it sends, bytes.
    pub(super) length: Option<u64>,
    /// What is allowed, bytes.
    pub(super) most: u64,
    /// The slowest that it may come; as it likes if absent.
    pub(super) slowest: Option<Slowest>,
}

impl Keep<'_> {
    /// Writes it to its place, which has room for the announced size, or for all that is allowed.
    pub(super) async fn run(
        mut self,
        mut spooled: Spooled,
        expected: &Expected,
    ) -> Result<RawGranule, Miss> {
        let room = self.room(expected);
        let folder = spooled.path().to_owned();
        let unwritten = |source| unwritten(&folder, source);
        let writer = tokio::fs::File::from_std(spooled.file().try_clone().map_err(unwritten)?);
        let mut writer = BufWriter::with_capacity(WRITE_BYTES, writer);
        let mut check = Check::of(expected)?;
        let mut pace = self.slowest.map(Pace::new);
        while let Some(chunk) = match &mut pace {
            Some(pace) => pace.next(&mut self.chunks).await,
            None => self.chunks.next().await,
        } {
            let chunk = chunk?;
            check.update(&chunk)?;
            if check.size_bytes() > room {
                return Err(self.beyond(check.size_bytes(), expected).into());
            }
            writer.write_all(&chunk).await.map_err(unwritten)?;
        }
        writer.flush().await.map_err(unwritten)?;
        let size_bytes = check.size_bytes();
        if self.length.is_some_and(|length| length != size_bytes) {
            return Err(Miss::Away(format!("only {size_bytes} bytes of it came")));
        }
        let sha256 = check.finish(expected)??;
        spooled.shrink_to(size_bytes);
        let stamp = Stamp::of(&spooled.file().metadata().map_err(unwritten)?);
        let held = Held::Spooled(Arc::new(spooled));
        Ok(RawGranule::new(folder, self.file_name, sha256, stamp, held))
    }

    /// Refuses what is announced to be too large, or another file than its notice is of.
    pub(super) fn check_length(&self, expected: &Expected) -> Result<(), Rejection> {
        match self.length {
            Some(length) if length > self.most => Err(local::too_large(length, self.most)),
            Some(length) => wrong_size(expected, length).map_or(Ok(()), Err),
            None => Ok(()),
        }
    }

    /// Bytes that it is announced to have, or all that is allowed.
    pub(super) fn room(&self, expected: &Expected) -> u64 {
        let announced = self.length.or(expected.size_bytes);
        announced.unwrap_or(self.most).min(self.most)
    }

    /// The refusal of a file that is longer than announced, or than allowed.
    fn beyond(&self, bytes: u64, expected: &Expected) -> Rejection {
        match wrong_size(expected, bytes) {
            Some(refused) if bytes <= self.most => refused,
            _ => local::too_large(bytes, self.most),
        }
    }
}

fn unwritten(file: &Path, source: std::io::Error) -> Miss {
    Miss::from(spool::failed(file, source))
}
