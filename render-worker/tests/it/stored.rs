//! Made-up products in a store, and jobs that draw them.

use contract::digest::Digest;
use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use storage::Store;

use crate::scenes::{FIVE_DEGREES, globe, job, ocean, tile};

/// Stores a product of these monthly values.
pub(crate) async fn product(
    store: &Store,
    name: &str,
    quantity: Quantity,
    grid: Grid,
    months: &[Vec<f32>],
) -> Manifest {
    let product: ProductId = name.parse().unwrap();
    let mut steps = vec![];
    let mut domain = vec![false; grid.cell_count()];
    for (month, values) in (1..).zip(months) {
        let period = Period::month(2000, month).unwrap();
        let field = storage::fields::write(store, &product, &grid, values, period)
            .await
            .unwrap();
        for (cell, value) in domain.iter_mut().zip(values) {
            *cell |= value.is_finite();
        }
        steps.push(Step {
            masked: None,
            period,
            field,
            raw_sha256: Digest::of(b""),
            origin: "made up".into(),
            valid_cells: 1,
            contributed: None,
        });
    }
    let domain = storage::domain::write(store, &product, &domain)
        .await
        .unwrap();
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        product,
        number: 1,
        title: name.into(),
        quantity,
        synthetic: true,
        source: String::new(),
        grid,
        steps,
        domain,
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
    };
    storage::manifests::commit(store, &manifest).await.unwrap();
    manifest
}

fn values(field: &render::Field) -> Vec<f32> {
    field
        .cells
        .content()
        .iter()
        .map(|value| if *value < -1e29 { f32::NAN } else { *value })
        .collect()
}

/// Two months of a flux with what they accumulate; a job that draws a tile of them on the 30th of January.
pub(crate) async fn two_months_in(store: &Store) -> RenderJob {
    let (flux, carbon) = two_months(store).await;
    at(&flux, &carbon, "2000-01-30")
}

/// A job that draws a map tile of a flux at a time; other modes of it lift particles by accumulated carbon.
pub(crate) fn at(flux: &Manifest, carbon: &Manifest, time: &str) -> RenderJob {
    let (view, style) = (tile(1, 0, 1, 256), job(Mode::Map, tile(0, 0, 0, 256)).style);
    let time = time.parse().unwrap();
    let job = RenderJob::of(flux, Some(carbon), time, Mode::Volume, view, style).unwrap();
    let mode = Mode::Map;
    RenderJob { mode, ..job }
}

/// Two months of a flux and what they accumulate.
pub(crate) async fn two_months(store: &Store) -> (Manifest, Manifest) {
    let scene = ocean(FIVE_DEGREES);
    let carbon = scene.accumulated.unwrap();
    let mut after = values(&scene.value.after);
    // A cloud over the second month: gaps to fill.
    after[20 * 72..20 * 72 + 6].fill(f32::NAN);
    let flux = product(
        store,
        "flux",
        Quantity::CarbonFlux,
        FIVE_DEGREES,
        &[values(&scene.value.before), after],
    )
    .await;
    let carbon = [values(&carbon.before), values(&carbon.after)];
    let carbon = product(
        store,
        "flux-accumulated",
        Quantity::AccumulatedCarbon,
        FIVE_DEGREES,
        &carbon,
    )
    .await;
    (flux, carbon)
}

/// The same product as a small map, quickly drawn; another picture for every `number`.
pub(crate) fn quick(job: &RenderJob, number: u32) -> RenderJob {
    let mut quick = RenderJob {
        mode: Mode::Map,
        view: globe(f64::from(number) / 10.0, 0.0, 2e7, 64),
        ..job.clone()
    };
    quick.style.slices = 1;
    quick
}

/// The same product in a picture that takes the twins a second or more; another one for every `number`.
pub(crate) fn slow(job: &RenderJob, number: u32) -> RenderJob {
    let mut slow = RenderJob {
        mode: Mode::Volume,
        view: View::Globe {
            lon_deg: f64::from(number),
            lat_deg: 20.0,
            height_m: 1e7,
            width_px: 1024,
            height_px: 1024,
            angles: contract::camera::CameraAngles::NADIR,
        },
        ..job.clone()
    };
    slow.style.particles_per_cell = 64;
    slow
}
