//! Pieces of work that go on at the same time: preparing a file, publishing files of a product.

use std::future::Future;
use std::pin::{Pin, pin};
use std::sync::Arc;

use contract::product::ProductId;
use futures::stream::{FuturesUnordered, StreamExt as _};

use super::health::Health;
use super::publish_queue::Number;
use super::retry::retry;
use crate::notice::answer::{Answer, Asked, Ready};
use crate::error::blame;
use crate::land;
use crate::pipeline::Pipeline;
use crate::put::StoredGranule;

/// What is under way.
pub(super) type Work<'a> = FuturesUnordered<Pin<Box<dyn Future<Output = Done> + Send + 'a>>>;

/// A piece of work that ended.
pub(super) enum Done {
    /// A file can be published.
    ToPublish(Number, Box<StoredGranule>),
    Answered(Number, Box<Answer>),
    Published(ProductId, Vec<(Number, Answer)>),
    /// Its message is somebody else's now.
    GivenUp,
}

/// Polls the work that is under way while something else is waited for, which is never cancelled.
pub(super) async fn alongside<T>(
    work: &mut Work<'_>,
    done: &mut Vec<Done>,
    main: impl Future<Output = T>,
) -> T {
    let mut main = pin!(main);
    loop {
        tokio::select! {
            biased;
            result = &mut main => return result,
            Some(one) = work.next() => done.push(one),
        }
    }
}

/// Takes a file as far as to the manifest.
pub(super) async fn prepare(
    pipeline: Pipeline<'_>,
    health: &Health,
    number: Number,
    asked: Arc<Asked>,
) -> Done {
    let ready = retry(health, "prepare", || land::prepare(&pipeline, &asked)).await;
    match ready {
        Ok(Ready::ToCommit(granule)) => Done::ToPublish(number, Box::new(granule)),
        Ok(Ready::Answered(answer)) => Done::Answered(number, Box::new(answer)),
        Err(error) => Done::Answered(number, Box::new(asked.refused(blame(&error)))),
    }
}

/// Publishes files of one product together; if that fails because of one of them, one by one.
pub(super) async fn publish(
    pipeline: Pipeline<'_>,
    health: &Health,
    product: ProductId,
    batch: Vec<(Number, Arc<Asked>, StoredGranule)>,
) -> Done {
    let pairs: Vec<_> = batch
        .iter()
        .map(|(_, asked, granule)| (asked.as_ref(), granule))
        .collect();
    let together = retry(health, "publish", || land::commit(&pipeline, &pairs)).await;
    let answers = match together {
        Ok(answers) => answers,
        Err(error) if pairs.len() == 1 => vec![pairs[0].0.refused(blame(&error))],
        Err(_) => {
            let mut answers = Vec::with_capacity(pairs.len());
            for pair in &pairs {
                let own = std::slice::from_ref(pair);
                let alone = retry(health, "publish", || land::commit(&pipeline, own)).await;
                answers.extend(alone.unwrap_or_else(|error| vec![pair.0.refused(blame(&error))]));
            }
            answers
        }
    };
    let numbers = batch.iter().map(|(number, _, _)| *number);
    Done::Published(product, numbers.zip(answers).collect())
}
