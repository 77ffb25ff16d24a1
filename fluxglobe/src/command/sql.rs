//! `fluxglobe sql`: a question as text in; a table, CSV, JSON, or a file that other programs open out.

use std::cell::Cell;
use std::io::{IsTerminal as _, Read as _, Write};
use std::path::Path;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::sql::{Rows, Sql};
use export::answer::{self, AnswerFormat, Destination};

use crate::cli::{Settings, SqlFormat, SqlQuestion};
use crate::{deployment, progress};

/// Longest text that is read, bytes: beyond it is no question that is taken.
const MAX_TEXT_BYTES: u64 = 1 << 20;

pub(crate) async fn run(settings: &Settings, options: &SqlQuestion) -> Result<()> {
    let text = text(options)?;
    let form = form(options)?;
    let store = deployment::store(settings)?;
    let sql = Sql::new(
        &deployment::in_process(settings, store),
        options.limits.limits(),
    )?;
    let reached = Cell::new(Reached::Nothing);
    let answered = answered(&sql, &text, options, form, &reached);
    unless_cancelled(answered, &reached, tokio::signal::ctrl_c()).await
}

/// How far an answer has come, and with it what is said of one that is cancelled.
#[derive(Debug, Clone, Copy)]
enum Reached {
    /// Nobody sees anything of it: a table is printed at its end, and a file without a name goes with the program.
    Nothing,
    /// Standard output may have some of it.
    Streamed,
    /// A file is made whole and named, on a thread of its own.
    Finishing,
}

/// An answer, unless it is cancelled before. Once its file is made whole it is not: nobody could say whether the file is there.
async fn unless_cancelled(
    answered: impl Future<Output = Result<()>>,
    reached: &Cell<Reached>,
    cancelled: impl Future<Output = std::io::Result<()>>,
) -> Result<()> {
    let mut answered = pin!(answered);
    tokio::select! {
        // Listened to before anything is written.
        biased;
        asked = cancelled => asked?,
        ended = &mut answered => return ended,
    }
    match reached.get() {
        Reached::Nothing => bail!("cancelled; nothing was written"),
        Reached::Streamed => bail!("cancelled; what was written so far may not be whole"),
        Reached::Finishing => {
            progress::say("too late to cancel: the file is being made whole");
            answered.await
        }
    }
}

async fn answered(
    sql: &Sql,
    text: &str,
    options: &SqlQuestion,
    form: Option<AnswerFormat>,
    reached: &Cell<Reached>,
) -> Result<()> {
    let begun = Instant::now();
    let rows = sql.ask(text).await?;
    let count = match form {
        None => table(rows, options.max_rows as usize).await?,
        Some(form) => written(rows, form, options.output.as_deref(), reached).await?,
    };
    let seconds = begun.elapsed().as_secs_f64();
    progress::say(&format!("{count} ({seconds:.1} s)"));
    Ok(())
}

/// What is asked.
fn text(options: &SqlQuestion) -> Result<String> {
    let read = |from: &mut dyn std::io::Read, name: &str| {
        let mut text = String::new();
        let read = from.take(MAX_TEXT_BYTES).read_to_string(&mut text);
        read.with_context(|| format!("cannot read a question from {name}"))?;
        Ok(text)
    };
    match (&options.file, options.text.as_deref()) {
        (Some(path), _) => {
            let name = path.display().to_string();
            let file = std::fs::File::open(path);
            read(
                &mut file.with_context(|| format!("cannot read {name}"))?,
                &name,
            )
        }
        (None, None | Some("-")) => read(&mut std::io::stdin(), "standard input"),
        (None, Some(text)) => Ok(text.to_owned()),
    }
}

/// The form of the answer; none for a table.
fn form(options: &SqlQuestion) -> Result<Option<AnswerFormat>> {
    let by_name = options.output.as_deref().map(SqlFormat::of_file);
    let form = match (options.format, by_name) {
        (Some(form), _) | (None, Some(Some(form))) => form,
        (None, Some(None)) => bail!(
            "the ending of --output says no form: give .csv, .json, .arrow, .parquet or .nc, or --format"
        ),
        (None, None) => SqlFormat::Table,
    };
    let is_file = options.output.is_some();
    Ok(match form {
        SqlFormat::Table if is_file => {
            bail!("a table is for people: leave --output out, or give another --format")
        }
        SqlFormat::Table => None,
        SqlFormat::Csv => Some(AnswerFormat::Csv),
        SqlFormat::Json => Some(AnswerFormat::Json),
        SqlFormat::Arrow | SqlFormat::Parquet if !is_file && std::io::stdout().is_terminal() => {
            bail!("it is not for a terminal: give --output FILE, or send standard output on")
        }
        SqlFormat::Arrow => Some(AnswerFormat::Arrow),
        SqlFormat::Parquet => Some(AnswerFormat::Parquet),
        SqlFormat::Netcdf => Some(AnswerFormat::NetCdf),
    })
}

/// Prints rows as a table, and says how many there are.
async fn table(mut rows: Rows, most: usize) -> Result<String> {
    let columns = answer::shown_columns(rows.schema());
    let mut table = Table::new();
    table
        .load_preset(NOTHING)
        .set_header(columns.iter().map(|column| &column.name));
    let mut count = 0;
    let mut is_cut = false;
    while let Some(batch) = rows.next().await? {
        let left = most - count;
        is_cut = batch.num_rows() > left;
        let shown = answer::shown_rows(&batch.slice(0, batch.num_rows().min(left)))?;
        count += shown.len();
        table.add_rows(shown);
        if is_cut {
            break;
        }
    }
    for (place, column) in columns.iter().enumerate() {
        if let Some(own) = table.column_mut(place)
            && column.is_number
        {
            own.set_cell_alignment(CellAlignment::Right);
        }
    }
    progress::result(&table.trim_fmt())?;
    Ok(if is_cut {
        format!("the first {count} rows: --max-rows shows more, --output FILE writes all")
    } else {
        counted(count)
    })
}

/// Writes rows, each batch on a thread for what blocks.
async fn written(
    mut rows: Rows,
    form: AnswerFormat,
    output: Option<&Path>,
    reached: &Cell<Reached>,
) -> Result<String> {
    let is_gone = Arc::new(AtomicBool::new(false));
    let to = match output {
        Some(path) => Destination::File(path.to_owned()),
        None => Destination::Stream(Box::new(Out {
            is_gone: Arc::clone(&is_gone),
        })),
    };
    let writing = async {
        if output.is_none() {
            reached.set(Reached::Streamed);
        }
        let mut file = answer::answer(form, to, rows.schema())?;
        let mut count = 0;
        while let Some(batch) = rows.next().await? {
            count += batch.num_rows();
            let append = tokio::task::spawn_blocking(move || {
                file.append(&batch)?;
                Ok::<_, export::ExportError>(file)
            });
            file = append.await??;
        }
        if output.is_some() {
            reached.set(Reached::Finishing);
        }
        tokio::task::spawn_blocking(move || file.finish()).await??;
        if output.is_none() && matches!(form, AnswerFormat::Json) {
            // What is said next stands on a line of its own.
            progress::result("")?;
        }
        Ok::<_, anyhow::Error>(count)
    };
    match writing.await {
        Ok(count) => Ok(match output {
            Some(path) => format!("{} in {}", counted(count), path.display()),
            None => counted(count),
        }),
        // A reader that went away (`| head`) is no failure.
        Err(_broken) if is_gone.load(Ordering::Relaxed) => {
            Ok("whoever read the answer went away".to_owned())
        }
        Err(error) => Err(error),
    }
}

fn counted(rows: usize) -> String {
    match rows {
        1 => "1 row".to_owned(),
        rows => format!("{rows} rows"),
    }
}

/// Standard output, which remembers that nobody reads it any more.
struct Out {
    is_gone: Arc<AtomicBool>,
}

impl Out {
    fn noticed<T>(&self, outcome: std::io::Result<T>) -> std::io::Result<T> {
        if let Err(error) = &outcome
            && error.kind() == std::io::ErrorKind::BrokenPipe
        {
            self.is_gone.store(true, Ordering::Relaxed);
        }
        outcome
    }
}

impl Write for Out {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.noticed(std::io::stdout().write(bytes))
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.noticed(std::io::stdout().flush())
    }
}

#[cfg(test)]
mod tests {
    use std::future;

    use super::*;

    #[tokio::test]
    async fn an_answer_that_is_cancelled_says_what_is_there_of_it() {
        for (reached, wanted) in [
            (Reached::Nothing, "nothing was written"),
            (Reached::Streamed, "may not be whole"),
        ] {
            let cancelled = future::ready(Ok(()));
            let reached = Cell::new(reached);
            let ended = unless_cancelled(future::pending(), &reached, cancelled).await;
            let told = ended.unwrap_err().to_string();
            assert!(told.contains(wanted), "{told}");
        }
    }

    #[tokio::test]
    async fn a_file_that_is_made_whole_is_not_cancelled() {
        let is_whole = Cell::new(false);
        let finishing = async {
            tokio::task::yield_now().await;
            is_whole.set(true);
            Ok(())
        };
        let reached = Cell::new(Reached::Finishing);
        let ended = unless_cancelled(finishing, &reached, future::ready(Ok(()))).await;
        assert!(ended.is_ok() && is_whole.get(), "{ended:?}");
    }
}
