//! `fluxglobe survey`: folders of files in; what would become of each, as the table of docs/data-sources.md, out. A survey of nothing,
//! and one in which nothing would land, fails.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use contract::index::DimensionIndex;
use ingest::Row;

use crate::cli::Survey;
use crate::progress;

pub(crate) async fn run(options: &Survey) -> Result<()> {
    let indexes = DimensionIndex::sorted(options.index.clone())?;
    let settings = ingest::Settings::with_current_program()?;
    let mut files = vec![];
    for folder in &options.folders {
        let found = ingest::data_files(folder);
        let found = found.with_context(|| format!("cannot read {}", folder.display()))?;
        if found.is_empty() {
            progress::say(&no_files(folder));
        }
        files.extend(found);
    }
    ensure!(
        !files.is_empty(),
        "there is nothing to survey: give folders of data files, or the files themselves"
    );
    let bar = progress::bar("survey", files.len() as u64);
    let rows = ingest::survey(&files, &indexes, &settings).await;
    // Nobody reads what is thrown away along time, but broken off in the middle it would be told as damaged.
    cube::compacted().await;
    let rows = rows?;
    bar.set_position(files.len() as u64);
    progress::done(&bar, &format!("{} files", files.len()));
    progress::result(&ingest::markdown(&rows))?;
    ensure_some_land(&rows)
}

/// Why a folder has no line in the table.
fn no_files(folder: &Path) -> String {
    format!(
        "{}: holds no data files (.{}); links in it are not followed",
        folder.display(),
        ingest::DATA_ENDINGS.join(", .")
    )
}

/// Fails if all files would be refused; what would land beside refused ones is an answer.
fn ensure_some_land(rows: &[Row]) -> Result<()> {
    ensure!(
        rows.iter().any(|row| !row.outcome.is_rejected()),
        "none of {} files would land: the table says why",
        rows.len()
    );
    Ok(())
}
