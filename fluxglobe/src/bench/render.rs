//! `fluxglobe bench render`: frames of made-up seas, or of a product that has landed, and what they take.

use anyhow::{Context as _, Result};
use contract::camera::CameraAngles;
use contract::job::View;
use contract::look_at::LookAt;
use render_proof::bench::command;

use super::quality::scenes;
use crate::cli::{BenchRender, Settings};
use crate::deployment;

/// From the place that is looked at: as far as the made-up sea is seen from.
const DISTANCE_M: f64 = 5.3e6;
/// Away from the sun, as the made-up sea is seen.
const HEADING_DEG: f64 = 200.0;

pub(crate) async fn run(settings: &Settings, options: BenchRender) -> Result<()> {
    let BenchRender {
        bench,
        layer,
        look_at,
    } = options;
    let Some(product) = layer else {
        return command::run(&bench);
    };
    let store = deployment::store(settings)?;
    let manifest = storage::manifests::latest(&store, &product).await?;
    let manifest = manifest.with_context(|| format!("{product} has not landed here"))?;
    let desk = deployment::single_desk(settings, store.clone()).await?;
    let view = move |size_px: [u32; 2], tilt_deg: f64| -> Result<View> {
        let look_at = LookAt {
            target: look_at,
            distance_m: DISTANCE_M,
            angles: CameraAngles {
                heading_deg: if tilt_deg > 0.0 { HEADING_DEG } else { 0.0 },
                tilt_deg,
                ..CameraAngles::NADIR
            },
        };
        Ok(look_at.view(size_px)?)
    };
    let plain = view([64, 64], 0.0)?;
    let (job, scene) = scenes::landed(&desk, &store, &manifest, plain).await?;
    // The device is opened anew: the desk's is not to share its time.
    drop(desk);
    let measure = move || {
        command::run_on(&bench, &scene, &|size_px, slices, tilt_deg| {
            let mut job = job.clone();
            job.view = view(size_px, tilt_deg)?;
            job.style.slices = slices;
            Ok(job)
        })
    };
    tokio::task::spawn_blocking(measure).await?
}
