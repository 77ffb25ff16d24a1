//! `fluxglobe rejected`: what was refused, as a table or JSON; and sent again once its cause is gone.

use anyhow::{Result, bail};
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use kafka_log::rejected;

use crate::cli::{Rejected, Settings};
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, command: Rejected) -> Result<()> {
    match command {
        Rejected::List { json, kafka } => {
            let log = deployment::needed_log(settings, &kafka).await?;
            list(&rejected::list(log.as_ref()).await?, json)
        }
        Rejected::Replay { origins, kafka } => {
            let log = deployment::needed_log(settings, &kafka).await?;
            let mut refusals = rejected::list(log.as_ref()).await?;
            if let Some(unknown) = origins.iter().find(|origin| {
                !refusals
                    .iter()
                    .any(|refusal| refusal.origin.as_ref() == Some(origin))
            }) {
                bail!(
                    "nothing was refused that came from {unknown}; see `fluxglobe rejected list`"
                );
            }
            if !origins.is_empty() {
                refusals
                    .retain(|refusal| refusal.origin.is_some_and(|from| origins.contains(&from)));
            }
            let replayed = rejected::replay(log.as_ref(), &refusals).await?;
            for gone in &replayed.gone {
                progress::say(&format!(
                    "{gone}: its message is no longer kept; send a new notice"
                ));
            }
            progress::result(&format!("{} sent again", replayed.sent))
        }
    }
}

fn list(refusals: &[rejected::Rejected], json: bool) -> Result<()> {
    if json {
        for refusal in refusals {
            let line = serde_json::json!({
                "origin": refusal.origin.map(|origin| origin.to_string()),
                "path": refusal.path,
                "reason": refusal.reason,
                "detail": refusal.detail,
                "attempt": refusal.attempt,
                "trace": refusal.trace,
            });
            progress::result(&line.to_string())?;
        }
        return Ok(());
    }
    if refusals.is_empty() {
        progress::say("nothing was refused");
        return Ok(());
    }
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(["origin", "attempt", "reason", "file", "what to do"]);
    for refusal in refusals {
        let reason = serde_json::to_value(refusal.reason)?;
        table.add_row([
            refusal
                .origin
                .map_or_else(|| "-".to_owned(), |origin| origin.to_string()),
            refusal.attempt.to_string(),
            reason.as_str().unwrap_or_default().to_owned(),
            refusal.path.clone(),
            refusal.detail.clone(),
        ]);
    }
    progress::result(&table.trim_fmt())
}
