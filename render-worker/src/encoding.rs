//! Drawn pictures in, with what a job has drawn over them as bytes out, on as many cores as there are; who draws next waits
//! for none of it.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::thread;

use bytes::Bytes;
use contract::encoding::Encoding;
use contract::job::RenderJob;
use render::Image;
use tokio::sync::Semaphore;

use crate::annotation::{self, Lifted};
use crate::error::DrawError;

/// The cores that encode pictures. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Encoders {
    /// One permit a core.
    cores: Arc<Semaphore>,
    count: usize,
}

impl Encoders {
    /// One for every core of this machine.
    pub(crate) fn on_all_cores() -> Self {
        Self::new(thread::available_parallelism().unwrap_or(NonZeroUsize::MIN))
    }

    fn new(count: NonZeroUsize) -> Self {
        Self {
            cores: Arc::new(Semaphore::new(count.get())),
            count: count.get(),
        }
    }

    /// How many pictures are encoded now.
    pub(crate) fn busy(&self) -> usize {
        self.count - self.cores.available_permits()
    }

    /// The bytes of a picture, with the annotations of a job over it if one is given, whose columns go so far. `turn` is let go as
    /// soon as a core is free for it, before encoding begins: whoever holds it back until then draws no more pictures than
    /// the cores can take.
    pub(crate) async fn encode(
        &self,
        annotated: Option<(RenderJob, Lifted)>,
        image: Image,
        encoding: Encoding,
        turn: impl Send + 'static,
    ) -> Result<Bytes, DrawError> {
        let finished = move || -> Result<Bytes, DrawError> {
            let image = match annotated {
                Some((job, lifted)) => annotation::annotated(&job, &lifted, image)?,
                None => image,
            };
            Ok(match encoding {
                Encoding::Png => image.encode_png()?,
                Encoding::Jpeg { quality } => image.encode_jpeg(quality)?,
            })
        };
        self.run(turn, finished).await?
    }

    /// Does some work when a core is free for it.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        turn: impl Send + 'static,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, DrawError> {
        // It is never closed, but a closed semaphore would only mean that nothing is counted.
        let core = Arc::clone(&self.cores).acquire_owned().await;
        drop(turn);
        let working = tokio::task::spawn_blocking(move || {
            let done = work();
            drop(core);
            done
        });
        working.await.map_err(DrawError::Thread)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
    use std::time::Duration;

    use futures::FutureExt as _;

    use super::*;

    /// Longer than any machine needs.
    const LIMIT: Duration = Duration::from_mins(1);

    /// Something that tells when it is let go, by ending the channel.
    fn turn() -> (SyncSender<()>, Receiver<()>) {
        sync_channel(1)
    }

    fn is_over(turn: &Receiver<()>) -> bool {
        turn.recv_timeout(LIMIT) == Err(RecvTimeoutError::Disconnected)
    }

    #[tokio::test]
    async fn a_turn_to_draw_is_over_while_its_picture_is_encoded() {
        let encoders = Encoders::new(NonZeroUsize::MIN);
        let (held, over) = turn();
        // Encoding ends only after the turn has.
        let was_over = encoders.run(held, move || is_over(&over)).await.unwrap();
        assert!(was_over, "the turn was held while the picture was encoded");
        assert_eq!(encoders.busy(), 0);
    }

    #[tokio::test]
    async fn a_turn_is_kept_while_no_core_is_free() {
        let encoders = Encoders::new(NonZeroUsize::MIN);
        let (go, wait) = sync_channel::<()>(1);
        let (held, _over) = turn();
        let mut first = Box::pin(encoders.run(held, move || wait.recv_timeout(LIMIT)));
        assert!(first.as_mut().now_or_never().is_none());
        assert_eq!(encoders.busy(), 1);
        let (held, over) = turn();
        let mut second = Box::pin(encoders.run(held, || ()));
        assert!(second.as_mut().now_or_never().is_none());
        assert!(
            over.try_recv()
                .is_err_and(|e| e == std::sync::mpsc::TryRecvError::Empty)
        );
        go.send(()).unwrap();
        first.await.unwrap().unwrap();
        second.await.unwrap();
        assert!(is_over(&over));
    }

    #[tokio::test]
    async fn what_is_given_up_before_it_has_a_core_is_not_encoded() {
        let encoders = Encoders::new(NonZeroUsize::MIN);
        let (go, wait) = sync_channel::<()>(1);
        let mut first = Box::pin(encoders.run((), move || wait.recv_timeout(LIMIT)));
        assert!(first.as_mut().now_or_never().is_none());
        let (held, over) = turn();
        let (told, encoded) = sync_channel(1);
        let mut second = Box::pin(encoders.run(held, move || told.send(())));
        assert!(second.as_mut().now_or_never().is_none());
        drop(second);
        assert!(is_over(&over), "its turn is the next one's");
        go.send(()).unwrap();
        first.await.unwrap().unwrap();
        encoders.run((), || ()).await.unwrap();
        assert_eq!(encoded.try_recv().ok(), None);
    }
}
