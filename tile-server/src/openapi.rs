//! The description of every address that clients may ask, OpenAPI 3.1: written beside each handler, gathered here.
//!
//! `openapi.json` beside this crate's sources is what it says; a test holds the two together, and the viewer's types are
//! generated from it.

pub(crate) mod words;

use std::sync::LazyLock;

use utoipa::openapi::header::HeaderBuilder;
use utoipa::openapi::path::{Operation, Parameter, ParameterIn};
use utoipa::openapi::{ContentBuilder, ObjectBuilder, Ref, RefOr, Response, ResponseBuilder, Type};
use utoipa::{Modify, OpenApi};

use crate::error::Refusal;
use crate::routes::{
    analysis, area, budget, check, correlation, difference, events, globe, health, hovmoller,
    legend, line, metrics, observations, openapi, palettes, platforms, point, products, regions,
    stream, tilejson, tiles, zarr,
};

/// What an operation that takes long or needs others answers when it cannot.
const RETRY_AFTER: &str = "Seconds after which the same request may succeed";

#[derive(OpenApi)]
#[openapi(
    info(
        title = "Fluxglobe",
        description = "Map tiles, views of the globe, series, carbon budgets, the catalogue and observations.\n\n\
            Everything is read with GET or HEAD, by anybody; other methods are answered with 405, and whose `Accept-Encoding` allows \
            neither gzip nor an answer as it is, with 406. Where a geometry may be too long \
            for an address, POST with it as the body asks the same and writes nothing. Times are ISO 8601 and \
            any instant is valid, not only stored steps; `from` and `to` bound the half-open period `[from, to)`. \
            Answers about a product name its version in `manifest`, and the parameter of that name asks for it again. \
            Every refusal is a `Refusal`; those with `Retry-After` may succeed later."
    ),
    servers((url = "/", description = "This server")),
    paths(
        tiles::get,
        tilejson::get,
        globe::get,
        stream::get,
        products::list,
        legend::get,
        regions::list,
        palettes::list,
        events::get,
        openapi::get,
        point::get,
        line::get,
        line::post,
        area::get,
        area::post,
        analysis::get,
        analysis::post,
        correlation::get,
        correlation::post,
        difference::get,
        difference::post,
        hovmoller::get,
        hovmoller::post,
        budget::get,
        budget::post,
        budget::history,
        budget::post_history,
        check::get,
        zarr::get,
        zarr::get_2,
        platforms::get,
        observations::get,
        health::live,
        health::ready,
        metrics::get,
    ),
    components(schemas(
        Refusal,
        contract::analysis::Along,
        contract::analysis::BasePeriod,
        contract::analysis::CalendarBins,
        contract::earth::Earth,
        contract::geometry::Sampling,
        contract::observation::PlatformKind,
        contract::region::Cells,
        contract::rows::RowsForm,
        contract::time::TimeStep,
        words::Background,
        words::BaseMap,
        words::GeoJson,
        words::LegendForm,
        words::Mode,
        words::Palette,
        words::Scale,
    )),
    tags(
        (name = "pictures", description = "Tiles and views of the globe"),
        (name = "catalogue", description = "What there is, and what is new"),
        (name = "statistics", description = "Numbers of places and regions"),
        (name = "observations", description = "Buoys, ships, stations and profiles"),
        (name = "operation", description = "For those who run the server"),
    ),
    modifiers(&Refusals, &SentAlong),
)]
struct Description;

/// Adds what the layers below all handlers answer, so that no handler has to say it.
struct Refusals;

impl Modify for Refusals {
    fn modify(&self, description: &mut utoipa::openapi::OpenApi) {
        let items = description.paths.paths.values_mut();
        let operations = items.flat_map(|item| item.get.iter_mut().chain(&mut item.post));
        for operation in operations {
            for (status, response) in refusals(operation) {
                let answers = &mut operation.responses.responses;
                answers
                    .entry(status.to_owned())
                    .or_insert_with(|| response.into());
            }
        }
    }
}

/// Takes the parameters out of what is asked by POST that the body stands for.
struct SentAlong;

/// What says where in an address.
const PLACES: [&str; 4] = ["region", "line", "lon", "lat"];

impl Modify for SentAlong {
    fn modify(&self, description: &mut utoipa::openapi::OpenApi) {
        let items = description.paths.paths.values_mut();
        for operation in items.filter_map(|item| item.post.as_mut()) {
            let parameters = operation.parameters.get_or_insert_default();
            let is = |one: &RefOr<Parameter>, names: &[&str]| matches!(one, RefOr::T(one) if names.contains(&one.name.as_str()));
            // Where parts are taken too, either may be sent and the other stand in the address.
            let takes_parts = parameters.iter().any(|one| is(one, &["regions"]));
            parameters.retain(|one| takes_parts || !is(one, &PLACES));
        }
    }
}

/// How an operation may be refused, or answered that a copy is right.
fn refusals(operation: &Operation) -> Vec<(&'static str, Response)> {
    let parameters = operation.parameters.as_deref().unwrap_or_default();
    let takes = |place: &ParameterIn| {
        let is_there =
            |one: &RefOr<Parameter>| matches!(one, RefOr::T(one) if one.parameter_in == *place);
        parameters.iter().any(is_there)
    };
    let mut all = vec![
        ("500", refusal("A defect of this server", false)),
        (
            "503",
            refusal(
                "Too much to do, or a part that is needed does not answer",
                true,
            ),
        ),
        ("504", refusal("The answer took too long", true)),
    ];
    if operation.request_body.is_none() && takes(&ParameterIn::Path) {
        let text = "The copy that `If-None-Match` names is still right";
        let unchanged = ResponseBuilder::new().description(text).build();
        all.push(("304", unchanged));
    }
    if operation.request_body.is_some() {
        let text = "The answer is still the one whose tag `If-None-Match` names";
        all.push(("412", refusal(text, false)));
        all.push(("413", refusal("The body is longer than 64 MiB", false)));
        let text = "The body is not said to be GeoJSON, or is compressed";
        all.push(("415", refusal(text, false)));
    }
    if takes(&ParameterIn::Path) || takes(&ParameterIn::Query) {
        let text = "A parameter is not valid, or missing; the reason says what would be";
        all.push(("400", refusal(text, false)));
    }
    if takes(&ParameterIn::Path) {
        let text = "Nothing of that name; the reason says where names are listed";
        all.push(("404", refusal(text, false)));
        let text =
            "A store of others, to which the product is attached, does not hold what it held";
        all.push(("502", refusal(text, false)));
    }
    all
}

fn refusal(text: &str, may_succeed_later: bool) -> Response {
    let body = ContentBuilder::new()
        .schema(Some(Ref::from_schema_name("Refusal")))
        .build();
    let response = ResponseBuilder::new()
        .description(text)
        .content("application/json", body);
    if !may_succeed_later {
        return response.build();
    }
    let seconds = ObjectBuilder::new().schema_type(Type::Integer);
    let header = HeaderBuilder::new()
        .schema(Some(seconds))
        .description(Some(RETRY_AFTER));
    response.header("retry-after", header.build()).build()
}

/// The description as JSON; the same program always says the same bytes.
pub(crate) fn json() -> &'static str {
    static JSON: LazyLock<String> = LazyLock::new(|| {
        let text = Description::openapi().to_pretty_json();
        text.expect("a description has string keys only") + "\n"
    });
    &JSON
}
