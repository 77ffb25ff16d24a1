//! One connection whose client must get on with it: a socket in, the same socket with two deadlines out.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::{Context, Poll, ready};

use prometheus::IntCounterVec;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Instant, Sleep};

use super::phase::{End, Progress};
use super::{Limits, Place};

/// A connection that ends with an error when its client takes too long.
pub(crate) struct Guarded {
    stream: TcpStream,
    limits: Limits,
    progress: Progress,
    alarm: Pin<Box<Sleep>>,
    has_ended: bool,
    ended: IntCounterVec,
    answers: Answers,
    _place: Place,
}

/// Requests of one connection that are being answered, counted by who answers them. Clones count the same.
#[derive(Clone, Default)]
pub(crate) struct Answers(Arc<AtomicUsize>);

/// Counts as long as it is there.
struct Answer(Answers);

impl Answers {
    /// An answer, counted until its head is there or nobody works at it any more.
    pub(crate) fn counting<F: Future>(
        &self,
        answer: F,
    ) -> impl Future<Output = F::Output> + use<F> {
        self.0.fetch_add(1, Ordering::AcqRel);
        let counted = Answer(self.clone());
        async move {
            let answer = answer.await;
            drop(counted);
            answer
        }
    }

    fn is_any(&self) -> bool {
        self.0.load(Ordering::Acquire) > 0
    }
}

impl Drop for Answer {
    fn drop(&mut self) {
        self.0.0.fetch_sub(1, Ordering::AcqRel);
    }
}

impl Guarded {
    pub(super) fn new(
        stream: TcpStream,
        limits: Limits,
        place: Place,
        ended: IntCounterVec,
    ) -> Self {
        let progress = Progress::new(Instant::now());
        let (at, _) = progress.due(limits.head, limits.idle);
        Self {
            stream,
            limits,
            progress,
            alarm: Box::pin(tokio::time::sleep_until(at)),
            has_ended: false,
            ended,
            answers: Answers::default(),
            _place: place,
        }
    }

    /// For whoever answers its requests.
    pub(crate) fn answers(&self) -> Answers {
        self.answers.clone()
    }

    /// Nothing moves now: is that the end? Wakes the task when it will be.
    fn wait<T>(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<T>> {
        if self.answers.is_any() {
            self.progress.answering();
        }
        while !self.has_ended {
            let (at, why) = self.progress.due(self.limits.head, self.limits.idle);
            // An alarm that rings too early is put off only then, so that bytes that come need not touch it.
            let alarm_at = self.alarm.deadline();
            if at < alarm_at || (self.alarm.is_elapsed() && at > alarm_at) {
                self.alarm.as_mut().reset(at);
            }
            ready!(self.alarm.as_mut().poll(cx));
            if Instant::now() >= at {
                self.end(why);
            }
        }
        Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
    }

    fn end(&mut self, why: End) {
        self.has_ended = true;
        self.ended.with_label_values(&[why.label()]).inc();
        tracing::debug!(why = why.label(), "a connection is ended");
    }

    fn wrote<T>(
        &mut self,
        cx: &mut Context<'_>,
        begin: &[u8],
        written: Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        match written {
            Poll::Ready(written) => {
                self.progress.wrote(begin, Instant::now());
                Poll::Ready(written)
            }
            Poll::Pending => {
                self.progress.answering();
                self.wait(cx)
            }
        }
    }
}

impl AsyncRead for Guarded {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let begin = buffer.filled().len();
        let me = &mut *self;
        match Pin::new(&mut me.stream).poll_read(cx, buffer) {
            Poll::Ready(read) => {
                let bytes = &buffer.filled()[begin..];
                if let Some(why) = me.progress.read(bytes, Instant::now()) {
                    me.end(why);
                    return Poll::Ready(Err(io::ErrorKind::InvalidData.into()));
                }
                Poll::Ready(read)
            }
            Poll::Pending => me.wait(cx),
        }
    }
}

impl AsyncWrite for Guarded {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.wrote(cx, bytes, written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(cx, parts);
        let begin = parts.first().map_or(&[][..], |part| part);
        self.wrote(cx, begin, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
