//! The plan: which files of a product would be read as something else now, from its manifest and the notes of readings.

use std::collections::{BTreeMap, BTreeSet};

use contract::digest::Digest;
use contract::index::DimensionIndex;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{Manifest, Step};
use futures::{StreamExt as _, TryStreamExt as _};
use storage::{Store, manifests, verify};

use super::{By, Item, Plan, Reason, Request};
use crate::error::IngestError;
use crate::plan::Wish;
use crate::plan::profile::Profiles;
use crate::plan::recipe::{DECODER, Recipe};
use crate::put::reading::{self, Reading};

/// Notes that are read at the same time.
const NOTES_AT_ONCE: usize = 16;
/// Files that are named when many are in the way.
const NAMED: usize = 5;

/// What a request comes to. Nothing is written.
///
/// # Errors
/// There is no such product; a file that must be read is gone, or was read by a profile that is not known here.
pub async fn plan(
    store: &Store,
    profiles: &Profiles,
    request: &Request,
) -> Result<Plan, IngestError> {
    let stays = |detail: String| IngestError::Reread {
        product: request.product.to_string(),
        detail,
    };
    let newest = manifests::latest(store, &request.product).await;
    let manifest = newest
        .map_err(IngestError::storage("read the newest manifest"))?
        .ok_or_else(|| stays("there is no such product".to_owned()))?;
    let attached = store.attached_to(&manifest).await;
    let attached = attached.map_err(IngestError::storage("read what it is attached to"))?;
    if let Some(attachment) = attached {
        let product = &request.product;
        return Err(stays(format!(
            "it is attached to {}, and has no files here; run `fluxglobe attach --refresh {product}`",
            attachment.place()
        )));
    }
    if let (Some(from), Some(to)) = (request.from, request.to)
        && from >= to
    {
        return Err(stays(format!("no time lies between {from} and {to}")));
    }
    let mut plan = Plan {
        manifest: manifest.id(),
        items: vec![],
        fresh_count: 0,
        indexes: manifest.indexes.clone(),
    };
    // What was computed has no files.
    if manifest.derived_from.is_some() {
        return Ok(plan);
    }
    let known = Known::of(store, &manifest, request).await?;
    let files = files(&manifest, request);
    let read: Vec<Vec<Reading>> = futures::stream::iter(&files)
        .map(|file| known.readings(store, file))
        .buffered(NOTES_AT_ONCE)
        .try_collect()
        .await?;
    let mut in_the_way = vec![];
    for (file, readings) in files.iter().zip(&read) {
        let judged = known.judge(file, readings, profiles, request);
        match judged {
            Ok(Some(item)) if item.is_read || known.raw.contains(&item.raw_sha256) => {
                plan.items.push(item);
            }
            Ok(Some(item)) => {
                in_the_way.push(format!("{} is not in the store any more", item.file));
            }
            Ok(None) => plan.fresh_count += 1,
            Err(detail) => in_the_way.push(detail),
        }
    }
    if in_the_way.is_empty() {
        Ok(plan)
    } else {
        Err(stays(listed(&in_the_way)))
    }
}

/// The first few of many things.
pub(super) fn listed(all: &[String]) -> String {
    let shown = all[..all.len().min(NAMED)].join("; ");
    match all.len().saturating_sub(NAMED) {
        0 => shown,
        more => format!("{shown}; and {more} more"),
    }
}

/// A file of the product and the steps that it has there.
struct File<'a> {
    raw_sha256: Digest,
    origin: &'a str,
    steps: Vec<&'a Step>,
}

/// Files with a step in the asked time, in the order of their first steps.
fn files<'a>(manifest: &'a Manifest, request: &Request) -> Vec<File<'a>> {
    let is_asked = |step: &Step| {
        request.from.is_none_or(|from| step.period.end > from)
            && request.to.is_none_or(|to| step.period.start < to)
    };
    let mut asked = BTreeSet::new();
    let mut places: BTreeMap<(Digest, &str), usize> = BTreeMap::new();
    let mut files: Vec<File<'a>> = vec![];
    for step in &manifest.steps {
        let place = *places
            .entry((step.raw_sha256, &step.origin))
            .or_insert(files.len());
        if place == files.len() {
            files.push(File {
                raw_sha256: step.raw_sha256,
                origin: &step.origin,
                steps: vec![],
            });
        }
        files[place].steps.push(step);
        if is_asked(step) {
            asked.insert(place);
        }
    }
    let numbered = files.into_iter().enumerate();
    numbered
        .filter(|(place, _)| asked.contains(place))
        .map(|(_, file)| file)
        .collect()
}

/// What the store holds of the product.
struct Known<'a> {
    manifest: &'a Manifest,
    notes: BTreeMap<Digest, Vec<ObjectKey>>,
    fields: BTreeSet<ObjectKey>,
    raw: BTreeSet<Digest>,
}

impl<'a> Known<'a> {
    async fn of(
        store: &Store,
        manifest: &'a Manifest,
        request: &Request,
    ) -> Result<Self, IngestError> {
        let product = &manifest.product;
        let list = async |kind: Kind| {
            let folder = kind.folder();
            let listed = store.list(&format!("{folder}/{product}")).await;
            listed.map_err(IngestError::storage("list what is stored"))
        };
        let mut notes: BTreeMap<Digest, Vec<ObjectKey>> = BTreeMap::new();
        for key in reading::keys(store, product).await? {
            if let Some(raw) = reading::raw_of(&key) {
                notes.entry(raw).or_default().push(key);
            }
        }
        let mut fields: BTreeSet<ObjectKey> = list(Kind::Field).await?.into_iter().collect();
        if request.is_verified {
            let named = manifest.steps.iter().map(|step| step.field.clone());
            let damaged = verify::damaged(store, named)
                .await
                .map_err(IngestError::storage("check what is stored"))?;
            fields.retain(|field| !damaged.contains(field));
        }
        let digest = |key: ObjectKey| key.as_str().rsplit('/').next()?.parse().ok();
        Ok(Self {
            manifest,
            notes,
            fields,
            raw: list(Kind::Raw)
                .await?
                .into_iter()
                .filter_map(digest)
                .collect(),
        })
    }

    /// What a file was ever read as.
    async fn readings(&self, store: &Store, file: &File<'_>) -> Result<Vec<Reading>, IngestError> {
        let mut readings = vec![];
        for key in self.notes.get(&file.raw_sha256).into_iter().flatten() {
            let note = reading::get(store, key).await?;
            readings.extend(note.filter(|note| note.steps[0].origin == file.origin));
        }
        Ok(readings)
    }

    /// Is a file to be read, and why? None if it is as it would be read now.
    fn judge(
        &self,
        file: &File<'_>,
        readings: &[Reading],
        profiles: &Profiles,
        request: &Request,
    ) -> Result<Option<Item>, String> {
        let item = |by, reason, is_read| Item {
            file: file.origin.to_owned(),
            raw_sha256: file.raw_sha256,
            periods: file.steps.iter().map(|step| step.period).collect(),
            reason,
            is_read,
            by,
        };
        let input = |recipe: &Recipe| recipe.input(file.raw_sha256, file.origin);
        let indexes = self.manifest.indexes.as_slice();
        let (by, wanted) = match wanted((file, indexes), readings, profiles, request)? {
            Wanted::As(by, recipe) => (by, recipe),
            Wanted::Anyhow => return Ok(Some(item(By::Found, Reason::Missing, false))),
            Wanted::AsItIs => return Ok(None),
        };
        if request.is_forced {
            return Ok(Some(item(by, Reason::Forced, false)));
        }
        let is_whole = |r: &&Reading| r.steps.iter().all(|step| self.fields.contains(&step.field));
        let mut alike = readings
            .iter()
            .filter(|r| input(&r.recipe) == input(&wanted));
        Ok(match alike.next() {
            None => Some(item(by, Reason::Stale, false)),
            Some(done) if !is_whole(&done) => Some(item(by, Reason::Missing, false)),
            Some(done) if self.is_settled(file, done) => None,
            Some(_) => Some(item(by, Reason::Stale, true)),
        })
    }

    /// Does the product hold all of what a file was read as, but for what other files have the time of?
    fn is_settled(&self, file: &File<'_>, reading: &Reading) -> bool {
        let has_time = |step: &Step| {
            let mut all = self.manifest.steps.iter();
            all.any(|other| other.period.overlaps(step.period))
        };
        holds(file, reading)
            && reading
                .steps
                .iter()
                .filter(|step| !file.steps.contains(step))
                .all(has_time)
    }
}

/// Are the steps that a file has in the product what it was read as?
fn holds(file: &File<'_>, reading: &Reading) -> bool {
    file.steps.iter().all(|step| reading.steps.contains(step))
}

/// How a file should have been read.
enum Wanted {
    As(By, Recipe),
    /// It is not known how it was read.
    Anyhow,
    /// Whoever asks does not know the profile, and nothing else has changed.
    AsItIs,
}

/// `indexes`: those of further dimensions at which the files of the product are read.
fn wanted(
    (file, indexes): (&File<'_>, &[DimensionIndex]),
    readings: &[Reading],
    profiles: &Profiles,
    request: &Request,
) -> Result<Wanted, String> {
    if let Some(profile) = &request.profile {
        let wish = Wish {
            profile: Some(profile),
            indexes,
            ..Wish::default()
        };
        return Ok(Wanted::As(By::Given, Recipe::of(wish)));
    }
    let now = |reading: &Reading| match &reading.recipe.profile {
        None => {
            let variable = reading.recipe.variable.clone();
            let wish = Wish {
                variable: variable.as_deref(),
                indexes,
                ..Wish::default()
            };
            let recipe = Recipe::of(wish);
            Some((variable.map_or(By::Found, By::Variable), recipe))
        }
        Some(used) => profiles
            .iter()
            .find(|profile| profile.name == used.name)
            .map(|profile| {
                let wish = Wish {
                    profile: Some(profile),
                    indexes,
                    ..Wish::default()
                };
                (By::Named(used.name.clone()), Recipe::of(wish))
            }),
    };
    let is_current = |r: &&Reading| now(r).is_some_and(|(_, recipe)| recipe == r.recipe);
    // The reading that the product holds, if there are several one that would be repeated; else one of a run that was
    // killed.
    let held = || readings.iter().filter(|reading| holds(file, reading));
    let basis = held()
        .find(is_current)
        .or_else(|| held().next())
        .or_else(|| readings.iter().find(is_current));
    let Some(basis) = basis else {
        return Ok(Wanted::Anyhow);
    };
    match (now(basis), &basis.recipe) {
        (Some((by, recipe)), _) => Ok(Wanted::As(by, recipe)),
        (None, Recipe { decoder, .. }) if *decoder == DECODER && !request.is_forced => {
            Ok(Wanted::AsItIs)
        }
        (None, Recipe { profile, .. }) => {
            let name = profile.as_ref().map_or("", |used| used.name.as_str());
            let origin = file.origin;
            Err(format!(
                "{origin} was read by profile {name}, which is not known here; give it with --profile or --profiles"
            ))
        }
    }
}
