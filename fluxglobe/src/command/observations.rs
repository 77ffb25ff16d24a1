//! `fluxglobe observations`: which platforms there are, what they measured, and how a product compares with it.

use anyhow::{Result, bail};
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::matchup::{self, Fit, LeftOut, TimeMatch};
use compute::region::file;
use contract::manifest::AskedVersion;
use contract::masked::MaskedCells;
use contract::observation::{Filter, MAX_LIMIT, Observation, Quality};
use contract::region::{MaskCode, Region};
use contract::time::{Period, TimeMs};
use observations::ObservationStore;

use crate::cli::{MatchTime, Matchup, Observations, ObservationsAsked, Settings};
use crate::command::budget;
use crate::figures::figures;
use crate::instants::Instants;
use crate::{deployment, plot, progress};

pub(crate) async fn run(settings: &Settings, command: Observations) -> Result<()> {
    match command {
        Observations::List(asked) => list(settings, &asked).await,
        Observations::Query(asked) => query(settings, &asked).await,
        Observations::Matchup(options) => matchup(settings, &options).await,
    }
}

fn filter(asked: &ObservationsAsked) -> Result<Filter> {
    Ok(Filter {
        region: region(&asked.region)?,
        from: asked.from,
        to: asked.to,
        properties: asked.property.clone().into_iter().collect(),
        datasets: asked.dataset.clone().into_iter().collect(),
        platforms: asked.platform.clone().into_iter().collect(),
        kinds: asked.kind.into_iter().collect(),
        worst: asked.worst.unwrap_or(Quality::Bad),
        limit: asked.limit.min(MAX_LIMIT),
        ..Filter::default()
    })
}

/// A region that observations can be asked of.
///
/// # Errors
/// It is none, or the cells of a mask.
fn region(text: &str) -> Result<Region> {
    match (budget::region(text), MaskCode::split(text)) {
        (Ok(asked), _) => Ok(asked.region),
        (Err(_), Some((mask, _code)))
            if mask.parse::<AskedVersion>().is_ok() && !file::is_file_name(text) =>
        {
            bail!(
                "region {text}: observations are not asked for by the cells of a mask; give a box, a polygon or the name of a region"
            )
        }
        (Err(error), _) => Err(error),
    }
}

async fn list(settings: &Settings, asked: &ObservationsAsked) -> Result<()> {
    let objects = deployment::store(settings)?;
    let store = observations::open(&asked.store, &objects)?;
    let filter = filter(asked)?;
    let found = store.platforms(&filter).await?;
    let platforms = found.platforms;
    if platforms.is_empty() {
        check_dataset(store.as_ref(), asked).await?;
    }
    let warnings = masked(&objects, asked).await?;
    let warn = || {
        if !found.is_complete {
            progress::say(&cut_list(filter.limit));
        }
        for line in &warnings {
            progress::say(line);
        }
    };
    if asked.json {
        for platform in &platforms {
            progress::result(&serde_json::to_string(platform)?)?;
        }
        warn();
        return Ok(());
    }
    if platforms.is_empty() {
        let is_empty = store.datasets().await?.is_empty();
        progress::say(none(is_empty));
        return Ok(());
    }
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header([
        "dataset",
        "platform",
        "kind",
        "from",
        "to",
        "last lon, lat",
        "values",
        "properties",
    ]);
    let instants = Instants::of(platforms.iter().flat_map(|p| [p.first, p.last]));
    for p in platforms {
        table.add_row([
            p.dataset.to_string(),
            p.platform,
            p.kind.to_string(),
            instants.text(p.first),
            instants.text(p.last),
            format!("{:.3}, {:.3}", p.lon_deg, p.lat_deg),
            p.count.to_string(),
            p.properties.join(" "),
        ]);
    }
    progress::result(&table.trim_fmt())?;
    warn();
    Ok(())
}

/// # Errors
/// There are no observations of the dataset that is asked for; those that there are.
async fn check_dataset(store: &dyn ObservationStore, asked: &ObservationsAsked) -> Result<()> {
    let Some(dataset) = &asked.dataset else {
        return Ok(());
    };
    let known = store.datasets().await?;
    if known.contains(dataset) {
        return Ok(());
    }
    if known.is_empty() {
        bail!(
            "there is no dataset {dataset}, nor any other; land files of observations with `fluxglobe ingest`"
        );
    }
    let known: Vec<String> = known.iter().map(ToString::to_string).collect();
    bail!(
        "there is no dataset {dataset}; there are {}",
        known.join(", ")
    )
}

/// Of each dataset that was asked for, what files gave a value for and what is no observation.
async fn masked(store: &storage::Store, asked: &ObservationsAsked) -> Result<Vec<String>> {
    let mut lines = vec![];
    for (dataset, notes) in ingest::observation::notes(store).await? {
        let all: MaskedCells = notes.iter().map(|note| note.masked).sum();
        let is_asked = asked.dataset.as_ref().is_none_or(|asked| *asked == dataset);
        let Some(most) = notes.iter().max_by_key(|note| note.masked.total()) else {
            continue;
        };
        if is_asked && !all.is_none() {
            let files = notes.iter().filter(|note| !note.masked.is_none()).count();
            lines.push(format!(
                "{dataset}: {all} in {files} of {} files; most in {}, {} beside {} observations",
                notes.len(),
                most.file,
                most.masked.total(),
                most.observations
            ));
        }
    }
    Ok(lines)
}

async fn query(settings: &Settings, asked: &ObservationsAsked) -> Result<()> {
    let store = observations::open(&asked.store, &deployment::store(settings)?)?;
    let (rows, is_all) = all(store.as_ref(), asked).await?;
    if rows.is_empty() {
        check_dataset(store.as_ref(), asked).await?;
        progress::say(none(store.datasets().await?.is_empty()));
    }
    let warn = || {
        if !is_all {
            progress::say(&cut(asked.limit));
        }
    };
    if asked.json {
        for row in &rows {
            progress::result(&serde_json::to_string(row)?)?;
        }
        warn();
        return Ok(());
    }
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header([
        "time", "dataset", "platform", "lon, lat", "depth m", "property", "value", "unit",
        "quality",
    ]);
    for o in rows {
        table.add_row([
            o.time.to_string(),
            o.dataset.to_string(),
            o.platform,
            format!("{:.3}, {:.3}", o.lon_deg, o.lat_deg),
            format!("{}", o.depth_m),
            o.property,
            format!("{}", o.value),
            o.unit,
            o.quality.to_string(),
        ]);
    }
    progress::result(&table.trim_fmt())?;
    warn();
    Ok(())
}

/// What is said where nothing is listed, of a store without any observation or of one that has others.
fn none(is_empty: bool) -> &'static str {
    if is_empty {
        "no observations; land files of them with `fluxglobe ingest`"
    } else {
        "no observation is what was asked for; `fluxglobe observations list` without other words tells which there are"
    }
}

/// What is said where there are more observations than the limit.
fn cut(limit: u32) -> String {
    format!("these are the first {limit}, and there are more: --limit takes up to 1000000")
}

/// What is said where there are more platforms than a list holds.
fn cut_list(limit: u32) -> String {
    let more = if limit < MAX_LIMIT {
        format!("--limit takes up to {MAX_LIMIT}")
    } else {
        "ask for one --dataset, a --region or a period (--from, --to)".to_owned()
    };
    format!("these are the first {limit} platforms, and there are more: {more}")
}

/// Up to the limit, page by page; and whether these are all that there are.
async fn all(
    store: &dyn ObservationStore,
    asked: &ObservationsAsked,
) -> Result<(Vec<Observation>, bool)> {
    let (mut filter, mut rows) = (filter(asked)?, vec![]);
    loop {
        filter.limit = (asked.limit - rows.len() as u32).min(MAX_LIMIT);
        let page = store.query(&filter).await?;
        rows.extend(page.observations);
        if page.next.is_none() || rows.len() >= asked.limit as usize {
            return Ok((rows, page.next.is_none()));
        }
        filter.after = page.next;
    }
}

/// Observations that are held against a product.
struct Chosen {
    observations: Vec<Observation>,
    left_out: LeftOut,
    /// Are these all that are fit?
    is_all: bool,
}

/// The ends of the time of which observations are asked for: those of the product where they are left open. Others have no partner,
/// and would take the places of those that have.
fn window([from, to]: [Option<TimeMs>; 2], covered: Option<Period>) -> Result<[Option<TimeMs>; 2]> {
    let start = from.or(covered.map(|period| period.start));
    let end = to.or(covered.map(|period| period.end));
    if let (Some(start), Some(end)) = (start, end)
        && start >= end
    {
        bail!("there is no time from {start} to {end}: the product has nothing there");
    }
    Ok([start, end])
}

/// Up to the limit, those of a time that are fit, page by page.
async fn chosen(
    store: &dyn ObservationStore,
    asked: &ObservationsAsked,
    [from, to]: [Option<TimeMs>; 2],
    fit: Fit,
) -> Result<Chosen> {
    // What is not fit is counted: it is asked for, too.
    let mut filter = Filter {
        from,
        to,
        worst: Quality::Bad,
        limit: MAX_LIMIT,
        ..filter(asked)?
    };
    let (mut observations, mut left_out) = (vec![], LeftOut::default());
    let most = asked.limit as usize;
    loop {
        let page = store.query(&filter).await?;
        let mut rest = page.observations.into_iter();
        let room = most - observations.len();
        let taken = rest.by_ref().filter(|o| fit.takes(o, &mut left_out));
        observations.extend(taken.take(room));
        let is_last = page.next.is_none();
        if is_last || observations.len() >= most {
            let is_all = is_last && rest.next().is_none();
            return Ok(Chosen {
                observations,
                left_out,
                is_all,
            });
        }
        filter.after = page.next;
    }
}

async fn matchup(settings: &Settings, options: &Matchup) -> Result<()> {
    if options.asked.property.is_none() {
        bail!("say what is held against the product: --property, such as sea_surface_temperature");
    }
    let store = deployment::store(settings)?;
    let manifest = deployment::manifest(&store, &options.product, &settings.data).await?;
    let found = observations::open(&options.asked.store, &store)?;
    let fit = Fit {
        worst: options.asked.worst.unwrap_or(Fit::default().worst),
        deepest_m: options.deepest,
    };
    let covered = manifest.extent();
    let window = window([options.asked.from, options.asked.to], covered)?;
    let chosen = chosen(found.as_ref(), &options.asked, window, fit).await?;
    if chosen.observations.is_empty() {
        check_dataset(found.as_ref(), &options.asked).await?;
        if chosen.left_out != LeftOut::default() {
            bail!(
                "no observation is {fit}: {}; --worst and --deepest take others",
                left_out(chosen.left_out)
            );
        }
    }
    let time = match options.time {
        MatchTime::Nearest => TimeMatch::Nearest,
        MatchTime::Linear => TimeMatch::Linear,
    };
    let mut matched = matchup::matchup(&store, &manifest, &chosen.observations, time).await?;
    matched.fit = Some(fit);
    matched.left_out.quality = chosen.left_out.quality;
    matched.left_out.depth = chosen.left_out.depth;
    if matched.rows.is_empty() {
        bail!(
            "no observation has a value of {} beside it: {}; the product covers {}, and --from, --to and --region say which observations are taken{}",
            matched.manifest,
            without_partner(matched.left_out),
            covered.map_or_else(|| "no time".to_owned(), |period| period.to_string()),
            if chosen.is_all {
                String::new()
            } else {
                format!("; {}", cut(options.asked.limit))
            }
        );
    }
    if let Some(file) = &options.plot {
        plot::write(file, &matchup::scatter_svg(&matched)?)?;
    }
    if !chosen.is_all {
        progress::say(&cut(options.asked.limit));
    }
    if options.asked.json {
        return progress::result(&serde_json::to_string_pretty(&matched)?);
    }
    progress::result(&compared(&matched).to_string())?;
    progress::say(&format!(
        "{} less {} at {} of {} observations, {fit}; left out: {}",
        matched.manifest,
        matched.property,
        matched.rows.len(),
        chosen.observations.len() as u64 + chosen.left_out.quality + chosen.left_out.depth,
        left_out(matched.left_out)
    ));
    progress::say(&manifest.source);
    Ok(())
}

/// Why there is no pair at all.
fn without_partner(out: LeftOut) -> String {
    if out == LeftOut::default() {
        "there is none of that time".to_owned()
    } else {
        left_out(out)
    }
}

/// How a product and observations differ, one row in the unit that people read.
fn compared(matched: &matchup::Matchup) -> Table {
    let s = &matched.statistics;
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| figures(v, 4));
    let with_unit = |name: &str| match matched.unit.as_str() {
        "" => name.to_owned(),
        unit => format!("{name}, {unit}"),
    };
    let columns = [
        ("pairs".to_owned(), s.count.to_string()),
        (with_unit("bias"), number(s.bias)),
        (with_unit("RMSE"), number(s.rmse)),
        ("r".to_owned(), number(s.correlation)),
        (with_unit("mean observed"), number(s.observed_mean)),
        (with_unit("mean of the product"), number(s.gridded_mean)),
    ];
    let mut table = Table::new();
    table.load_preset(NOTHING);
    let (header, row): (Vec<String>, Vec<String>) = columns.into_iter().unzip();
    table.set_header(header);
    table.add_row(row);
    for column in table.column_iter_mut() {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Why observations have no partner, in words.
fn left_out(out: LeftOut) -> String {
    let reasons = [
        (out.quality, "of worse quality"),
        (out.depth, "deeper"),
        (out.other_time, "at times that no step covers"),
        (out.outside, "outside the grid"),
        (out.no_data, "in cells without data"),
    ];
    let there = reasons.into_iter().filter(|(count, _)| *count > 0);
    let texts: Vec<String> = there
        .map(|(count, reason)| format!("{count} {reason}"))
        .collect();
    if texts.is_empty() {
        "none".to_owned()
    } else {
        texts.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use compute::matchup::statistics::Statistics;

    use super::*;

    #[test]
    fn a_list_that_is_cut_says_how_to_see_the_rest() {
        let text = cut_list(1000);
        assert!(text.contains("the first 1000 platforms") && text.ends_with("up to 10000"));
        let text = cut_list(MAX_LIMIT);
        assert!(text.contains("the first 10000 platforms") && text.contains("--dataset"));
    }

    #[test]
    fn the_cells_of_a_mask_are_refused_as_such() {
        assert_eq!(region("global").unwrap(), Region::Global);
        for text in ["basins:5", "basins@2:southern"] {
            let refused = region(text).unwrap_err().to_string();
            assert!(
                refused.contains("not asked for by the cells of a mask"),
                "{refused}"
            );
        }
        let refused = region("chna-sea").unwrap_err().to_string();
        assert!(refused.contains("china-sea"), "{refused}");
    }

    #[test]
    fn a_question_without_an_answer_is_no_store_without_observations() {
        assert!(none(true).contains("fluxglobe ingest"));
        let text = none(false);
        assert!(
            text.contains("asked for") && !text.contains("ingest"),
            "{text}"
        );
    }

    #[test]
    fn observations_of_the_time_of_the_product_are_compared_where_no_other_is_said() {
        let covered = Period::year(2010).unwrap();
        let (start, end) = (Some(covered.start), Some(covered.end));
        assert_eq!(window([None, None], Some(covered)).unwrap(), [start, end]);
        let march: TimeMs = "2010-03".parse().unwrap();
        let asked = window([Some(march), None], Some(covered)).unwrap();
        assert_eq!(asked, [Some(march), end]);
        assert_eq!(window([None, None], None).unwrap(), [None, None]);
        let after: TimeMs = "2012".parse().unwrap();
        let refused = window([Some(after), None], Some(covered)).unwrap_err();
        assert!(refused.to_string().contains("nothing there"), "{refused}");
        let out = LeftOut {
            no_data: 3,
            ..LeftOut::default()
        };
        assert_eq!(without_partner(out), "3 in cells without data");
        assert!(without_partner(LeftOut::default()).contains("none of that time"));
    }

    #[test]
    fn a_comparison_is_a_row_with_units_and_what_is_left_out_is_told_in_words() {
        let left = LeftOut {
            other_time: 3,
            outside: 0,
            no_data: 2,
            quality: 4,
            depth: 0,
        };
        let pairs = [(20.0, 21.0), (22.0, 24.0)];
        let matched = matchup::Matchup {
            product: "sst".parse().unwrap(),
            manifest: "sst@1-00000000".parse().unwrap(),
            title: String::new(),
            source: String::new(),
            synthetic: false,
            property: "sea_surface_temperature".to_owned(),
            unit: "°C".to_owned(),
            time_match: TimeMatch::Nearest,
            rows: vec![],
            statistics: Statistics::of(&pairs.into_iter()),
            left_out: left,
            fit: Some(Fit::default()),
        };
        let text = compared(&matched).to_string();
        let words = |line: &str| line.split_whitespace().map(str::to_owned).collect();
        let lines: Vec<Vec<String>> = text.lines().map(words).collect();
        assert_eq!(
            lines[0].join(" "),
            "pairs bias, °C RMSE, °C r mean observed, °C mean of the product, °C"
        );
        // Differences 1 and 2: mean 1.5, mean square 2.5.
        assert_eq!(
            lines[1],
            ["2", "1.5000", "1.5811", "1.0000", "21.0000", "22.5000"]
        );
        assert_eq!(
            left_out(left),
            "4 of worse quality, 3 at times that no step covers, 2 in cells without data"
        );
        assert_eq!(left_out(LeftOut::default()), "none");
    }
}
