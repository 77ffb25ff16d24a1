//! Questions as SQL with numbered parameters: nothing that was asked stands in the text.

use contract::observation::TrackQuery;
use contract::product::ProductId;
use tokio_postgres::types::ToSql;

use super::upsert::system_time;
use crate::area::Area;
use crate::filter::CheckedFilter;

/// A statement and its parameters.
pub(super) struct Question<'a> {
    sql: String,
    parameters: Vec<Box<dyn ToSql + Sync + Send + 'a>>,
}

impl<'a> Question<'a> {
    pub(super) fn sql(&self) -> &str {
        &self.sql
    }

    pub(super) fn parameters(&self) -> Vec<&(dyn ToSql + Sync)> {
        self.parameters
            .iter()
            .map(|parameter| parameter.as_ref() as &(dyn ToSql + Sync))
            .collect()
    }

    fn new() -> Self {
        Self {
            sql: String::new(),
            parameters: vec![],
        }
    }

    /// Adds a parameter; its place in the text.
    fn parameter(&mut self, value: impl ToSql + Sync + Send + 'a) -> String {
        self.parameters.push(Box::new(value));
        format!("${}", self.parameters.len())
    }
}

/// Rows from the page on, one more than the limit.
pub(super) fn observations<'a>(checked: &'a CheckedFilter<'_>) -> Question<'a> {
    let mut question = Question::new();
    let mut wanted = conditions(&mut question, checked);
    if let Some(key) = &checked.after {
        let key = [
            question.parameter(system_time(key.time)),
            question.parameter(key.dataset.as_str()),
            question.parameter(key.platform.as_str()),
            question.parameter(key.property.as_str()),
            question.parameter(key.depth_m),
        ];
        wanted.push(format!(
            "(obs_time, dataset, platform, property, depth_m) > ({})",
            key.join(", ")
        ));
    }
    let limit = question.parameter(i64::from(checked.filter.limit) + 1);
    question.sql = format!(
        "SELECT dataset, platform, kind, obs_time, ST_X(place), ST_Y(place), depth_m, property, value, unit, quality \
         FROM observation {} ORDER BY obs_time, dataset, platform, property, depth_m LIMIT {limit}",
        all_of(&wanted)
    );
    question
}

/// Platforms of the wanted rows, one more than the limit; the last row of a platform is that of its latest time, then first
/// property, least depth.
pub(super) fn platforms<'a>(checked: &'a CheckedFilter<'_>) -> Question<'a> {
    let mut question = Question::new();
    let wanted = conditions(&mut question, checked);
    let limit = question.parameter(i64::from(checked.filter.limit) + 1);
    question.sql = format!(
        "WITH wanted AS (SELECT dataset, platform, kind, obs_time, ST_X(place) AS lon, ST_Y(place) AS lat, property, depth_m \
             FROM observation {}), \
         latest AS (SELECT DISTINCT ON (dataset, platform) dataset, platform, kind, lon, lat FROM wanted \
             ORDER BY dataset, platform, obs_time DESC, property, depth_m), \
         summed AS (SELECT dataset, platform, min(obs_time) AS first, max(obs_time) AS last, \
             min(lon) AS west, max(lon) AS east, \
             min(CASE WHEN lon < 0 THEN lon + 360 ELSE lon END) AS west_360, \
             max(CASE WHEN lon < 0 THEN lon + 360 ELSE lon END) AS east_360, \
             min(lat) AS south, max(lat) AS north, \
             array_agg(DISTINCT property ORDER BY property) AS properties, count(*) AS count \
             FROM wanted GROUP BY dataset, platform) \
         SELECT dataset, platform, kind, first, last, west, east, west_360, east_360, south, north, lon, lat, properties, count \
         FROM summed JOIN latest USING (dataset, platform) ORDER BY dataset, platform LIMIT {limit}",
        all_of(&wanted)
    );
    question
}

/// Datasets by name, each found by the index from the one before it.
pub(super) fn datasets() -> Question<'static> {
    let sql = "WITH RECURSIVE known AS (SELECT min(dataset) AS dataset FROM observation UNION ALL \
             SELECT (SELECT min(dataset) FROM observation WHERE dataset > known.dataset) FROM known \
             WHERE known.dataset IS NOT NULL) \
         SELECT dataset FROM known WHERE dataset IS NOT NULL ORDER BY dataset";
    Question {
        sql: sql.to_owned(),
        parameters: vec![],
    }
}

/// One place for each time of a platform; of more than the limit those that `track::thinned` keeps.
pub(super) fn track(query: &TrackQuery) -> Question<'_> {
    let mut question = Question::new();
    let mut wanted = vec![
        format!("dataset = {}", question.parameter(query.dataset.as_str())),
        format!("platform = {}", question.parameter(query.platform.as_str())),
    ];
    if let Some(from) = query.from {
        wanted.push(format!(
            "obs_time >= {}",
            question.parameter(system_time(from))
        ));
    }
    if let Some(to) = query.to {
        wanted.push(format!(
            "obs_time < {}",
            question.parameter(system_time(to))
        ));
    }
    let gaps = question.parameter(i64::from(query.limit) - 1);
    question.sql = format!(
        "WITH way AS (SELECT DISTINCT ON (obs_time) obs_time, ST_X(place) AS lon, ST_Y(place) AS lat FROM observation {} \
             ORDER BY obs_time, property, depth_m), \
         numbered AS (SELECT obs_time, lon, lat, row_number() OVER (ORDER BY obs_time) - 1 AS nth, count(*) OVER () - 1 AS final \
             FROM way) \
         SELECT obs_time, lon, lat FROM numbered WHERE nth = final OR {gaps}::bigint > 0 \
             AND nth % greatest((final + {gaps}::bigint - 1) / greatest({gaps}::bigint, 1), 1) = 0 ORDER BY obs_time",
        all_of(&wanted)
    );
    question
}

fn all_of(conditions: &[String]) -> String {
    if conditions.is_empty() {
        String::new()
    } else {
        format!("WHERE {}", conditions.join(" AND "))
    }
}

fn conditions<'a>(question: &mut Question<'a>, checked: &'a CheckedFilter<'_>) -> Vec<String> {
    let filter = checked.filter;
    let mut all = vec![];
    if let Some(from) = filter.from {
        all.push(format!(
            "obs_time >= {}",
            question.parameter(system_time(from))
        ));
    }
    if let Some(to) = filter.to {
        all.push(format!(
            "obs_time < {}",
            question.parameter(system_time(to))
        ));
    }
    let lists: [(&str, Vec<&str>); 4] = [
        (
            "property",
            filter.properties.iter().map(String::as_str).collect(),
        ),
        (
            "dataset",
            filter.datasets.iter().map(ProductId::as_str).collect(),
        ),
        (
            "platform",
            filter.platforms.iter().map(String::as_str).collect(),
        ),
        ("kind", filter.kinds.iter().map(|k| k.as_str()).collect()),
    ];
    for (column, list) in lists {
        if !list.is_empty() {
            all.push(format!(
                "{column} = ANY({}::text[])",
                question.parameter(list)
            ));
        }
    }
    if filter.worst.flag() < 4 {
        let worst = i16::from(filter.worst.flag());
        all.push(format!("quality <= {}", question.parameter(worst)));
    }
    all.extend(place(question, &checked.area));
    all
}

/// The index finds what meets a box, in single precision; the comparisons after it are exact.
fn place(question: &mut Question<'_>, area: &Area) -> Option<String> {
    if *area == Area::Everywhere {
        return None;
    }
    if let Some(wkb) = area.polygons_wkb() {
        let polygons = question.parameter(wkb);
        return Some(format!(
            "ST_Intersects(place, ST_GeomFromWKB({polygons}::bytea, 4326))"
        ));
    }
    let boxes: Vec<String> = area
        .boxes()
        .into_iter()
        .map(|bounds| {
            let [west, south, east, north] =
                bounds.map(|degrees| format!("{}::float8", question.parameter(degrees)));
            format!(
                "(place && ST_MakeEnvelope({west}, {south}, {east}, {north}, 4326) \
                 AND ST_X(place) BETWEEN {west} AND {east} AND ST_Y(place) BETWEEN {south} AND {north})"
            )
        })
        .collect();
    Some(format!("({})", boxes.join(" OR ")))
}
