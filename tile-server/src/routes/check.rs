//! `/api/check`: our budgets beside a paper's and an independent integration's, `null` where there is nothing to compare with.

use axum::Json;
use axum::extract::State;
use contract::check::Check;

use crate::error::ServerError;
use crate::extract::{NoOthers, UrlQuery};
use crate::state::AppState;

/// Our budgets beside a paper's and an independent integration's; `null` where there is nothing to compare with.
#[utoipa::path(
    get,
    path = "/api/check",
    operation_id = "check",
    tag = "statistics",
    responses(
        (status = 200, description = "The comparison", body = Option<Check>),
        (status = 400, description = "A parameter: there are none", body = crate::error::Refusal),
    ),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    _no: UrlQuery<NoOthers>,
) -> Result<Json<Option<Check>>, ServerError> {
    state.analyses.check().await.map(Json)
}
