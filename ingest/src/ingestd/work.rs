//! Pieces of work that go on at the same time: preparing a file, publishing files of a product.

use std::future::Future;
use std::pin::{Pin, pin};
use std::sync::Arc;

use contract::product::ProductId;
use futures::stream::{FuturesUnordered, StreamExt as _};

use super::health::Health;
use super::publish_queue::Number;
use super::retry::{Caller, retry};
use crate::commit::Claim;
use crate::error::IngestError;
use crate::notice::{Answer, PendingNotice};
use crate::pipeline::{ObservedFile, Pipeline, Prepared};
use crate::put::StoredGranule;

/// What is under way.
pub(super) type Work<'a> = FuturesUnordered<Pin<Box<dyn Future<Output = Ended> + Send + 'a>>>;
/// A piece of work that ended; an error ends all of it.
pub(super) type Ended = Result<Done, IngestError>;

/// What a piece of work comes to.
pub(super) enum Done {
    Prepared(Number, Box<Prepared>),
    /// With what each file has of the product, whoever brought it first; none of a file of observations.
    Published(ProductId, Vec<(Number, Answer, Option<Claim>)>),
    /// Its message is somebody else's now.
    GivenUp,
}

/// A file that is ready for what is done in the order in which files came.
pub(super) enum Ready {
    Granule(Box<StoredGranule>),
    Observed(Box<ObservedFile>),
}

/// Polls the work that is under way while something else is waited for, which is never cancelled.
pub(super) async fn alongside<T>(
    work: &mut Work<'_>,
    ended: &mut Vec<Ended>,
    main: impl Future<Output = T>,
) -> T {
    let mut main = pin!(main);
    loop {
        tokio::select! {
            biased;
            result = &mut main => return result,
            Some(one) = work.next() => ended.push(one),
        }
    }
}

/// Takes a file as far as to the manifest.
pub(super) async fn prepare(
    pipeline: Pipeline<'_>,
    by: (Caller, &Health),
    number: Number,
    notice: Arc<PendingNotice>,
) -> Ended {
    let prepared = retry(by, "prepare", || pipeline.prepare(&notice)).await;
    let prepared = match prepared {
        Ok(prepared) => prepared,
        Err(error) => Prepared::Answered(by.0.refused(&notice, error)?),
    };
    Ok(Done::Prepared(number, Box::new(prepared)))
}

/// Looks whether a file that was there is there still, since others were published; else takes it as far as to the manifest.
pub(super) async fn prepare_again(
    pipeline: Pipeline<'_>,
    by: (Caller, &Health),
    (number, notice): (Number, Arc<PendingNotice>),
    (claim, answer): (Claim, Answer),
) -> Ended {
    match retry(by, "prepare", || pipeline.is_still_there(&claim)).await {
        Ok(true) => Ok(Done::Prepared(
            number,
            Box::new(Prepared::There(claim, answer)),
        )),
        Ok(false) | Err(_) => prepare(pipeline, by, number, notice).await,
    }
}

/// Publishes files of one product, and stores the observations of files of one dataset, in their order.
pub(super) async fn publish(
    pipeline: Pipeline<'_>,
    by: (Caller, &Health),
    (product, claims): (ProductId, Vec<Claim>),
    files: Vec<(Number, Ready)>,
) -> Ended {
    let (mut granules, mut observed) = (vec![], vec![]);
    for (number, file) in files {
        match file {
            Ready::Granule(granule) => granules.push((number, *granule)),
            Ready::Observed(file) => observed.push((number, file)),
        }
    }
    let mut answers = vec![];
    if !granules.is_empty() {
        answers = land(pipeline, by, &claims, granules).await?;
    }
    for (number, file) in observed {
        let answer = match retry(by, "store", || pipeline.store_observed(&file)).await {
            Ok(answer) => answer,
            Err(error) => by.0.refused(&file.notice, error)?,
        };
        answers.push((number, answer, None));
    }
    Ok(Done::Published(product, answers))
}

/// Publishes files of one product together; if that fails because of one of them, one by one.
async fn land(
    pipeline: Pipeline<'_>,
    by: (Caller, &Health),
    claims: &[Claim],
    files: Vec<(Number, StoredGranule)>,
) -> Result<Vec<(Number, Answer, Option<Claim>)>, IngestError> {
    let (numbers, granules): (Vec<Number>, Vec<StoredGranule>) = files.into_iter().unzip();
    let own: Vec<Claim> = granules.iter().map(Claim::of_granule).collect();
    let together = retry(by, "publish", || pipeline.commit(&granules, claims)).await;
    let answers = match together {
        Ok(answers) => answers,
        Err(error) if granules.len() > 1 && by.0.refuses(&error) => {
            tracing::error!(%error, "files of a product cannot be published together; one by one");
            let mut answers = Vec::with_capacity(granules.len());
            for own in granules.chunks(1) {
                match retry(by, "publish", || pipeline.commit(own, claims)).await {
                    Ok(alone) => answers.extend(alone),
                    Err(error) => answers.push(by.0.refused(&own[0].notice, error)?),
                }
            }
            answers
        }
        Err(error) => vec![by.0.refused(&granules[0].notice, error)?],
    };
    let answers = numbers.into_iter().zip(answers).zip(own);
    let answers = answers.map(|((number, answer), claim)| (number, answer, Some(claim)));
    Ok(answers.collect())
}
