//! Where values are asked for: the reader process of a file, or arrays of a store of others.

use cube::foreign::ForeignError;

use super::arrays::{Arrays, stopped};
use super::file::description::Part;
use super::indexed::Indexed;
use super::reader::session::Session;
use crate::error::Stop;

/// Whoever gives values of what was described.
pub(crate) enum Values {
    /// With the indexes that are read of further dimensions of its variables.
    Process(Box<Session>, Indexed),
    Arrays(Arrays),
}

impl Values {
    /// Says that a part of a variable will be read next but for what was asked for before: a process reads it meanwhile.
    pub(crate) async fn ask(&mut self, variable: &str, part: &[Part]) -> Result<(), Stop> {
        match self {
            Self::Process(session, indexed) => {
                session.ask(variable, &indexed.part(variable, part)).await
            }
            Self::Arrays(_) => Ok(()),
        }
    }

    /// Values of a part of a variable, as many as `expected`, as float64.
    pub(crate) async fn read(
        &mut self,
        variable: &str,
        part: &[Part],
        expected: u64,
    ) -> Result<Vec<f64>, Stop> {
        match self {
            Self::Process(session, indexed) => {
                let part = indexed.part(variable, part);
                session.read(variable, &part, expected).await
            }
            Self::Arrays(arrays) => arrays.read(variable, part, expected).await,
        }
    }

    /// First indexes along an axis of a variable of what is unpacked at once, ascending; none of a file, whose reader keeps what the next
    /// band needs too.
    pub(crate) fn chunk_starts(&self, variable: &str, axis: usize) -> Result<Vec<u64>, Stop> {
        match self {
            Self::Process(..) => Ok(vec![]),
            Self::Arrays(arrays) => arrays.chunk_starts(variable, axis).map_err(stopped),
        }
    }

    /// Why a variable that is there was not described; none where all were, or it is not there.
    pub(crate) fn unread(&self, variable: &str) -> Option<&ForeignError> {
        match self {
            // What is damaged in a file refuses the file.
            Self::Process(..) => None,
            Self::Arrays(arrays) => arrays.unread(variable),
        }
    }

    /// Memory of the reader beside the values that are asked for, bytes.
    pub(crate) fn library_bytes(&self) -> u64 {
        match self {
            Self::Process(session, _) => session.library_bytes(),
            Self::Arrays(_) => 0,
        }
    }
}
