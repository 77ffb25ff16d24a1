//! `fluxglobe verify`: every stored object read and compared with its name or seal, every step of cubes with its digest, and
//! the journal of the event log in the data folder; a line for each that is not sound.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;
use contract::kind::Kind;
use contract::product::ProductId;
use storage::log::EmbeddedLog;
use storage::verify::{self, Fault, Finding, Report};
use storage::{StorageError, Store};

use crate::cli::{Settings, Verify};
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: &Verify) -> Result<ExitCode> {
    let store = deployment::store(settings)?;
    let product = options.product.as_ref();
    let keys = verify::keys(&store, product).await?;
    if let (Some(product), true) = (product, keys.is_empty()) {
        deployment::manifest(&store, product, &settings.data).await?;
    }
    let bar = progress::bar("verify", keys.len() as u64);
    let tell = |done: usize, finding: Option<&Finding>| {
        bar.set_position(done as u64);
        // Of a damaged part of a cube there is more to say.
        let is_of_cube = finding.is_some_and(|it| Kind::of(&it.key) == Some(Kind::Cube));
        if let (Some(finding), false) = (finding, options.json || is_of_cube) {
            bar.suspend(|| progress::result(&line(finding)).ok());
        }
    };
    let mut report = verify::run(&store, &keys, &tell).await?;
    cubes(&store, product, &mut report).await?;
    if product.is_none()
        && let Some(finding) = journal(&deployment::events(settings))?
    {
        tell(keys.len(), Some(&finding));
        report.findings.push(finding);
    }
    let is_of_cube = |it: &&Finding| Kind::of(&it.key) == Some(Kind::Cube);
    for finding in report.findings.iter().filter(is_of_cube) {
        if !options.json {
            bar.suspend(|| progress::result(&line(finding)))?;
        }
    }
    progress::done(&bar, &summary(&report));
    if keys.is_empty() {
        progress::say("nothing is stored there: is it what --data or --store should name?");
    }
    if options.json {
        progress::result(&serde_json::to_string_pretty(&report)?)?;
    }
    if report.findings.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    for advice in advice(&report) {
        progress::say(&advice);
    }
    Ok(ExitCode::FAILURE)
}

/// Adds what is wrong with cubes as wholes, and of damaged parts of them which arrays and steps those are of.
async fn cubes(store: &Store, product: Option<&ProductId>, report: &mut Report) -> Result<()> {
    let mut products = cube::verify::products(store).await?;
    products.retain(|one| product.is_none_or(|product| product == one));
    let findings = report.findings.iter();
    let damaged = findings.map(|finding| finding.key.clone()).collect();
    for product in products {
        let checked = cube::verify::check(store, &product, &damaged).await?;
        for finding in &mut report.findings {
            checked.explain(finding);
        }
        report.findings.extend(checked.findings);
    }
    report.findings.sort_by(|a, b| a.key.cmp(&b.key));
    Ok(())
}

/// What is wrong with the journal of the event log in a folder. It is no object: its key is where it lies in the data.
fn journal(events: &Path) -> Result<Option<Finding>> {
    match EmbeddedLog::check(events) {
        Ok(_entries) => Ok(None),
        Err(StorageError::Damaged { object, reason }) => Ok(Some(Finding {
            key: "events/journal.jsonl".parse()?,
            fault: Fault::Damaged,
            reason: format!("{object}: {reason}"),
        })),
        Err(error) => Err(error.into()),
    }
}

fn line(finding: &Finding) -> String {
    let Finding { key, fault, reason } = finding;
    match fault {
        Fault::Damaged => format!("{key} is damaged: {reason}"),
        Fault::Missing => format!("{key} is missing: {reason}"),
        Fault::Behind => format!("{key} is behind: {reason}"),
    }
}

fn summary(report: &Report) -> String {
    let Report {
        sound_count,
        unsealed_count,
        read_bytes,
        findings,
    } = report;
    let unsealed = if *unsealed_count > 0 {
        format!(", {unsealed_count} of before objects were sealed, with nothing to compare with")
    } else {
        String::new()
    };
    format!(
        "{sound_count} objects are sound{unsealed}, {} are not; {:.1} MB read",
        findings.len(),
        *read_bytes as f64 / 1e6
    )
}

/// Made again by `recompute --verify`.
const MADE_AGAIN: [Kind; 6] = [
    Kind::Field,
    Kind::Contributed,
    Kind::Domain,
    Kind::Cube,
    Kind::Sums,
    Kind::Tile,
];
/// Made again when they are next needed.
const WHEN_NEEDED: [Kind; 5] = [
    Kind::Weights,
    Kind::Accumulating,
    Kind::Check,
    Kind::Reading,
    Kind::Landing,
];

/// What to do about what was found.
fn advice(report: &Report) -> Vec<String> {
    let mut advice = vec![];
    let found = |kinds: &[Kind]| {
        let is_of =
            |finding: &&Finding| Kind::of(&finding.key).is_some_and(|it| kinds.contains(&it));
        report.findings.iter().find(is_of)
    };
    if found(&MADE_AGAIN).is_some() {
        advice.push(
            "fields, counts, domains, cubes, sums and tiles are made again by: fluxglobe recompute --product PRODUCT --verify; what an attached product refers to, where its store has changed, by: fluxglobe attach --refresh PRODUCT, and where it has moved, by: fluxglobe attach URL --variable NAME --product PRODUCT --replace"
                .to_owned(),
        );
    }
    if found(&WHEN_NEEDED).is_some() {
        advice.push("weights, kept sums, comparisons and notes of readings and landings are made again when they are next needed".to_owned());
    }
    if let Some(protocol) = found(&[Kind::Protocol]) {
        advice.push(format!(
            "{} is written again by the next service that starts: remove it",
            protocol.key
        ));
    }
    if let Some(raw) = found(&[Kind::Raw]) {
        advice.push(format!(
            "{} is an input file: ingest it again from where it came, which replaces what is damaged",
            raw.key
        ));
    }
    if let Some(note) = found(&[Kind::ObservationFile]) {
        advice.push(format!(
            "{} is a note of a file of observations: ingest that file again, which replaces the note",
            note.key
        ));
    }
    if let Some(hint) = found(&[Kind::Newest]) {
        advice.push(format!(
            "{} is a hint: versions of its product are listed until the next one is published, which writes it again",
            hint.key
        ));
    }
    if let Some(pin) = found(&[Kind::Pin]) {
        advice.push(format!(
            "{} keeps a version that somebody cites: `fluxglobe gc` removes nothing until it is released (fluxglobe keep --release PRODUCT@NUMBER), and pinned again if that is still so",
            pin.key
        ));
    }
    if let Some(series) = found(&[Kind::Series]) {
        advice.push(format!(
            "{} was written by a program of before and is read by nobody: `fluxglobe gc` removes it",
            series.key
        ));
    }
    let lists = [
        Kind::Manifest,
        Kind::ManifestPage,
        Kind::Observations,
        Kind::ObservationIndex,
    ];
    if let Some(list) = found(&lists) {
        advice.push(format!(
            "{} cannot be made again: restore it from a copy of the store",
            list.key
        ));
    }
    advice
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_journal_is_a_finding_and_a_whole_one_or_none_is_not() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(journal(folder.path()).unwrap(), None);
        let path = folder.path().join("journal.jsonl");
        std::fs::write(&path, "{\"offsets\":{\"granule.notice/ingest\":1}}\n").unwrap();
        assert_eq!(journal(folder.path()).unwrap(), None);
        std::fs::write(&path, "{\"offsets\":{\"granule.notice/ingest\":1]}\n").unwrap();
        let finding = journal(folder.path()).unwrap().unwrap();
        assert!(line(&finding).contains("entry 1 of"), "{}", line(&finding));
    }

    #[test]
    fn each_kind_that_is_damaged_has_its_advice() {
        for kind in Kind::ALL {
            let report = Report {
                findings: vec![Finding {
                    key: format!("{}/p/a", kind.folder()).parse().unwrap(),
                    fault: Fault::Damaged,
                    reason: "x".to_owned(),
                }],
                ..Report::default()
            };
            assert_eq!(advice(&report).len(), 1, "{kind:?}");
        }
        let report = |key: &str| Report {
            findings: vec![Finding {
                key: key.parse().unwrap(),
                fault: Fault::Damaged,
                reason: "x".to_owned(),
            }],
            ..Report::default()
        };
        for (key, what_to_do) in [
            ("frames/p/a.parquet", "recompute"),
            ("cubes/p/repo", "recompute"),
            ("raw/p/a", "ingest it again"),
            ("manifests/p/1.json", "restore"),
            ("pins/p/0000000001.json", "keep --release"),
            ("newest/p/number.json", "the next one is published"),
            ("weights/a.parquet", "when they are next needed"),
        ] {
            let advice = advice(&report(key)).join("; ");
            assert!(advice.contains(what_to_do), "{key}: {advice}");
        }
        assert!(summary(&report("raw/p/a")).contains("1 are not"));
    }
}
