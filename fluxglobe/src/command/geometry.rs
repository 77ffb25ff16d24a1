//! Lines of a command line: a text or the name of a file in, a line with its name out.

use std::path::Path;

use anyhow::Result;
use compute::region::file;
use contract::geometry::AskedLine;

/// The line of a text, or of a file, which it is then called by.
pub(crate) fn line(text: &str) -> Result<AskedLine> {
    if !file::is_file_name(text) {
        return Ok(text.parse()?);
    }
    Ok(AskedLine {
        line: file::text(Path::new(text))?.parse()?,
        name: text.to_owned(),
    })
}
