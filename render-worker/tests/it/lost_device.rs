//! A graphics device that is lost, or that loses itself at every job: the worker goes on.

use contract::job::Mode;
use contract::job::RenderJob;
use render::{Backend, RenderError};
use render_worker::DrawError;
use render_worker::pipeline::IsWanted;
use storage::Store;

use crate::device;
use crate::here::Here;
use crate::stored::{quick, two_months_in};

#[tokio::test(flavor = "multi_thread")]
async fn a_job_is_drawn_on_a_fresh_device_when_its_own_is_lost() {
    if !device::is_wanted("a lost device") {
        return;
    }
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let service = Here::new(store, Backend::Gpu);
    for (lost, mode) in (0..).zip([Mode::Volume, Mode::Points, Mode::Sprites]) {
        let job = RenderJob {
            mode,
            ..job.clone()
        };
        let before = service.draw(&job).await.unwrap();
        assert_eq!(service.renderer().device_restarts(), lost);
        service.renderer().lose_device();
        assert_eq!(service.draw(&job).await.unwrap(), before, "{mode}");
        assert_eq!(
            service.renderer().device_restarts(),
            lost + 1,
            "the fault fired"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_loses_every_device_fails_and_the_next_one_is_drawn() {
    if !device::is_wanted("a job that loses devices") {
        return;
    }
    let store = Store::memory();
    // A plain map tile would need no device on a processor.
    let job = quick(&two_months_in(&store).await, 1);
    let service = Here::new(store, Backend::Gpu);
    let poison = || async {
        let scene = service.scene(&job).await?;
        service.renderer().lose_device();
        let wanted: IsWanted = std::sync::Arc::new(|| true);
        service.picture(&job, None, scene, wanted, ()).await
    };
    let failed = service.on_a_sound_device(poison).await.unwrap_err();
    assert!(failed.is_device_fault() && failed.is_final(), "{failed}");
    assert!(!matches!(failed, DrawError::Render(RenderError::NoAdapter)));
    assert_eq!(
        service.renderer().device_restarts(),
        1,
        "tried on a second device"
    );
    service.draw(&job).await.unwrap();
    assert_eq!(service.renderer().device_restarts(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn many_that_draw_on_a_device_that_is_lost_share_one_fresh_one() {
    if !device::is_wanted("many on a lost device") {
        return;
    }
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let service = Here::new(store, Backend::Gpu);
    // Equal jobs would be one.
    let jobs: Vec<RenderJob> = (0..6).map(|number| quick(&job, number)).collect();
    let mut before = vec![];
    for job in &jobs {
        before.push(service.draw(job).await.unwrap());
    }
    service.renderer().lose_device();
    let draw = |job: &RenderJob| {
        let (service, job) = (service.clone(), job.clone());
        tokio::spawn(async move { service.draw(&job).await.unwrap() })
    };
    let tasks: Vec<_> = jobs.iter().map(draw).collect();
    for (task, before) in tasks.into_iter().zip(before) {
        assert_eq!(task.await.unwrap(), before);
    }
    assert_eq!(service.renderer().device_restarts(), 1);
}
