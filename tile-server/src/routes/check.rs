//! `/api/check`: our budgets beside a paper's and an independent integration's, `null` where there is nothing to compare with.

use axum::Json;
use axum::extract::State;

use crate::backend::Check;
use crate::error::ServerError;
use crate::state::AppState;

pub(crate) async fn get(State(state): State<AppState>) -> Result<Json<Option<Check>>, ServerError> {
    state.analyses.check().await.map(Json)
}
