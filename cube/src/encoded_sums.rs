//! Stored sums of blocks of a version, where its cube has them: read as they are stored, decoded one after the other.

use std::ops::Range;
use std::sync::Arc;

use futures::future::BoxFuture;

use crate::blocks::with_decoder;
use crate::record::{Numbers, RECORD_BYTES, Record};
use crate::stored_chunks::{StoredChunks, Undecoded};
use crate::sums::Basis;
use crate::values::{Piece, Values};
use crate::{Cube, CubeError};

/// Records of sums of a run of steps, read and not decoded yet.
pub struct EncodedSums {
    cube: Cube,
    run: usize,
    at: Vec<[u32; 2]>,
    content: StoredChunks,
    pieces: Vec<Piece>,
}

impl EncodedSums {
    /// Where the steps that were asked for lie in the run.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Bytes of all of them as they are stored.
    pub fn stored_bytes(&self) -> usize {
        self.content.stored_bytes()
    }

    /// Decodes one record after the other, in the order asked for, and hands over its place among those asked for; those that hold
    /// nothing, neither of their block nor of any west of it, are left out. `take` says whether to go on. Numbers of a record that are
    /// not wanted of it are those of another one.
    ///
    /// # Errors
    /// The first one that is damaged; [`EncodedSums::error`] makes an error of it.
    pub fn each(
        &self,
        wanted: impl Fn(usize) -> Numbers,
        mut take: impl FnMut(usize, &Record) -> bool,
    ) -> Result<(), Undecoded> {
        let (mut bytes, mut record) = (vec![0; RECORD_BYTES], Record::default());
        let decoded = with_decoder(|decoder| {
            self.content.in_order(|number, content| {
                let read = decoder.chunks().decode(content, &mut bytes);
                let read = read.and_then(|()| record.read(&bytes, wanted(number)));
                read.map_err(|reason| Undecoded(number, reason))?;
                Ok(take(number, &record))
            })
        });
        decoded.map_err(|reason| Undecoded(0, reason))?
    }

    /// The error of a record that cannot be decoded, which names its object.
    pub async fn error(&self, undecoded: Undecoded) -> CubeError {
        let Undecoded(number, reason) = undecoded;
        let at = self.at[number];
        self.cube.undecoded_record(self.run, at, &reason).await
    }
}

impl Values {
    /// How values and cells count in stored sums of the run that holds these steps; none where there are none.
    pub fn summed_as(&self, steps: &Range<usize>) -> Option<Arc<Basis>> {
        let (cube, run, _pieces) = self.run_of(steps)?;
        let basis = cube.sums().basis.clone();
        basis.filter(|_| cube.is_summed(run))
    }

    /// Stored sums of a run of steps up to each of these blocks; none where [`Values::summed_as`] says that there are none.
    ///
    /// # Errors
    /// A store that does not answer; a chunk that is damaged or gone, by its name.
    pub fn sums<'a>(
        &'a self,
        blocks: &'a [[u32; 2]],
        steps: Range<usize>,
    ) -> BoxFuture<'a, Result<Option<EncodedSums>, CubeError>> {
        Box::pin(async move {
            let Some((cube, run, pieces)) = self.run_of(&steps) else {
                return Ok(None);
            };
            if !cube.is_summed(run) {
                return Ok(None);
            }
            Ok(Some(EncodedSums {
                content: cube.records(run, blocks).await?,
                cube,
                run,
                at: blocks.to_vec(),
                pieces,
            }))
        })
    }
}
