//! `fluxglobe survey`: folders of files in; what would become of each, as the table of docs/data-sources.md, out.

use anyhow::{Context as _, Result};

use crate::cli::Survey;
use crate::progress;

pub(crate) async fn run(options: &Survey) -> Result<()> {
    let settings = ingest::Settings::with_current_program()?;
    let mut files = vec![];
    for folder in &options.folders {
        let found = ingest::data_files(folder);
        files.extend(found.with_context(|| format!("cannot read {}", folder.display()))?);
    }
    let bar = progress::bar("survey", files.len() as u64);
    let rows = ingest::survey(&files, &settings).await?;
    bar.set_position(files.len() as u64);
    progress::done(&bar, &format!("{} files", files.len()));
    progress::result(&ingest::markdown(&rows))
}
