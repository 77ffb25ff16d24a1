//! The reader process: limits itself first, then opens the file and answers until its standard input ends.

use std::ffi::OsString;
use std::io::{BufWriter, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

use contract::event::RejectReason;
use rlimit::Resource;

use super::EXIT_USAGE;
use super::protocol::{self, Answer, Opened, Request};
use crate::error::Rejection;
use crate::inspect::file::DataFile;

/// Open files a reader needs: the three streams, the file, and what the system opens meanwhile.
const MAX_OPEN_FILES: u64 = 32;

/// Values that are written at a time; their bytes fit the nearest cache.
const AT_ONCE: usize = 1024;

/// Reads one file for a parent process. Arguments: path, memory in bytes, processor time in seconds, cells of one answer.
pub fn run_child(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    match serve(&arguments) {
        Some(Ok(())) => ExitCode::SUCCESS,
        // Wrong arguments, limits that cannot be set, or a closed pipe: the parent has gone or has had enough.
        Some(Err(_)) | None => ExitCode::from(EXIT_USAGE),
    }
}

fn serve(arguments: &[OsString]) -> Option<std::io::Result<()>> {
    let [path, numbers @ ..] = arguments else {
        return None;
    };
    let numbers: Vec<u64> = numbers
        .iter()
        .map(|n| n.to_str()?.parse().ok())
        .collect::<Option<_>>()?;
    let [memory_bytes, cpu_s, read_cells] = numbers[..] else {
        return None;
    };
    Some(limit(memory_bytes, cpu_s).and_then(|()| converse(&PathBuf::from(path), read_cells)))
}

/// Limits memory, processor time and open files; no file may be written and no core dumped.
fn limit(memory_bytes: u64, cpu_s: u64) -> std::io::Result<()> {
    let limits = [
        (Resource::AS, memory_bytes),
        (Resource::CPU, cpu_s),
        (Resource::NOFILE, MAX_OPEN_FILES),
        (Resource::FSIZE, 0),
        (Resource::CORE, 0),
    ];
    limits.into_iter().try_for_each(|(resource, wanted)| {
        let (_, hard) = resource.get()?;
        let allowed = wanted.min(hard);
        // The last second of processor time is for the signal that tells this limit from a kill by somebody else.
        let grace = u64::from(resource == Resource::CPU);
        resource.set(allowed, allowed.saturating_add(grace).min(hard))
    })
}

fn converse(path: &std::path::Path, read_cells: u64) -> std::io::Result<()> {
    let mut input = std::io::stdin().lock();
    let mut out = BufWriter::with_capacity(1 << 20, std::io::stdout().lock());
    let mut file = match DataFile::open(path) {
        Ok(file) => file,
        Err(rejection) => {
            protocol::write(&mut out, &Opened::Rejected(rejection))?;
            return out.flush();
        }
    };
    let described = protocol::encode(&Opened::Described(file.description().clone()));
    match described {
        Ok(described) => out.write_all(&described)?,
        // This is the file's doing: it must not look like a parent that is gone.
        Err(too_long) => {
            let detail = format!(
                "has names and attributes of too many bytes ({too_long}); give it with fewer"
            );
            let rejection = Rejection::new(RejectReason::TooLarge, "file", detail);
            protocol::write(&mut out, &Opened::Rejected(rejection))?;
            return out.flush();
        }
    }
    out.flush()?;
    while let Some(request) = protocol::read::<Request>(&mut input)? {
        match answer(&mut file, &request, read_cells) {
            Ok(values) => {
                protocol::write(
                    &mut out,
                    &Answer::Values {
                        count: values.len() as u64,
                    },
                )?;
                write_values(&mut out, &values)?;
            }
            Err(rejection) => protocol::write(&mut out, &Answer::Rejected(rejection))?,
        }
        out.flush()?;
    }
    Ok(())
}

/// Writes values as little-endian bytes, many at a time.
fn write_values(out: &mut impl std::io::Write, values: &[f64]) -> std::io::Result<()> {
    let mut bytes = [0; 8 * AT_ONCE];
    values.chunks(AT_ONCE).try_for_each(|some| {
        for (to, value) in bytes.as_chunks_mut().0.iter_mut().zip(some) {
            *to = value.to_le_bytes();
        }
        out.write_all(&bytes[..8 * some.len()])
    })
}

/// Checks what a request would allocate before it is read.
fn answer(file: &mut DataFile, request: &Request, read_cells: u64) -> Result<Vec<f64>, Rejection> {
    let name = &request.variable;
    let missing = || Rejection::new(RejectReason::NoVariable, name, "is not in the file");
    let variable = file.description().variable(name).ok_or_else(missing)?;
    // What a part past its dimension would be is refused as such where it is read.
    let counts = variable.dimensions.iter().zip(&request.part);
    let counts = counts.map(|(dimension, part)| part.span(dimension.len).map_or(0, |span| span.1));
    let cells = counts.fold(u128::from(variable.numbers_a_value()), |n, count| {
        n.saturating_mul(u128::from(count))
    });
    if cells > u128::from(read_cells) {
        let detail = format!("{cells} values at once, at most {read_cells} are read");
        return Err(Rejection::new(RejectReason::TooLarge, name, detail));
    }
    file.read(name, &request.part)
}
