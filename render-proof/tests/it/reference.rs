//! The half-angle volume against pictures made another way, in double precision (`render_proof::reference`).

use contract::camera::CameraAngles;
use contract::colour::Stops;
use contract::job::{Mode, RenderJob, View};
use render::{Backend, Renderer, Scene};
use render_proof::ocean::{ONE_DEGREE, REGION, scene as ocean};
use render_proof::views::{globe, looking_at, tile};
use render_proof::{Difference, Fineness, Picture, ProofError, against_slices, reference};

fn job(mode: Mode, view: View) -> RenderJob {
    RenderJob {
        mode,
        ..render_proof::ocean::job(view)
    }
}

fn twins() -> Renderer {
    Renderer::new(Backend::Cpu).unwrap()
}

fn psnr_db(picture: &Picture, truth: &Picture) -> f64 {
    Difference::of(picture, truth).unwrap().psnr_db.unwrap()
}

fn drawn(job: &RenderJob, scene: &Scene) -> Picture {
    Picture::from(&twins().render(job, scene).unwrap())
}

#[test]
fn the_volume_is_near_the_reference_and_the_number_sees_what_it_should_see() {
    let scene = ocean(ONE_DEGREE);
    // A coast, sinks and sources.
    let job = job(Mode::Volume, globe(-122.0, 27.0, 2.2e6, 80));
    let truth = reference(&job, &scene, Fineness::default()).unwrap();
    let measured = |change: fn(&mut RenderJob)| {
        let mut job = job.clone();
        change(&mut job);
        psnr_db(&drawn(&job, &scene), &truth)
    };
    let full = measured(|_| {});
    let few = measured(|job| job.style.slices = 2);
    let other_light = measured(|job| job.style.sun.azimuth_deg += 180.0);
    let sprites = measured(|job| job.mode = Mode::Sprites);
    let thin = measured(|job| job.style.optical_depth *= 0.8);
    println!(
        "PSNR against the float64 reference: {full:.2} dB at 64 slices, {few:.2} dB at 2, {other_light:.2} dB lit from the other side, {sprites:.2} dB for unlit sprites, {thin:.2} dB a fifth thinner"
    );
    assert!(full >= 46.0, "{full} dB at 64 slices");
    for (worse, what) in [
        (few, "2 slices"),
        (other_light, "light from the other side"),
        (sprites, "sprites"),
        (thin, "four fifths of the depth"),
    ] {
        assert!(
            worse < full - 4.0,
            "{worse} dB with {what}, {full} dB without"
        );
    }
}

#[test]
fn stops_of_colour_opacity_and_size_mean_to_the_reference_what_they_mean_to_the_stages() {
    let scene = ocean(ONE_DEGREE);
    let mut job = job(Mode::Volume, globe(-122.0, 27.0, 2.2e6, 80));
    let transfer = &mut job.style.transfer;
    transfer.colours = "-1e-9:#2d004b,0:#f7f7f7,1e-9:#7f3b08".parse().unwrap();
    transfer.opacity = "-1e-9:1,0:0.2,1e-9:1".parse().unwrap();
    transfer.size = "-1e-9:1,0:0.7,1e-9:0.9".parse().unwrap();
    let truth = reference(&job, &scene, Fineness::default()).unwrap();
    let near = psnr_db(&drawn(&job, &scene), &truth);
    let far = |change: fn(&mut RenderJob)| {
        let mut job = job.clone();
        change(&mut job);
        psnr_db(&drawn(&job, &scene), &truth)
    };
    let colours = far(|job| job.style.transfer.colours = Stops::default());
    let opacity = far(|job| job.style.transfer.opacity = Stops::default());
    println!("{near:.2} dB, {colours:.2} dB in a palette, {opacity:.2} dB as opaque as usual");
    assert!(near >= 42.0, "{near} dB");
    assert!(colours < near - 10.0 && opacity < near - 10.0);
}

#[test]
fn more_slices_come_nearer_to_the_reference_on_a_globe_and_on_a_tile() {
    let scene = ocean(ONE_DEGREE);
    let renderer = twins();
    let views = [
        // Aslant: from straight above eight slices will do, as the light's layers are its own.
        (
            "globe",
            looking_at([-122.0, 27.0], 2.2e6, [150.0, 60.0], 64),
            46.0,
        ),
        ("tile", tile(3, 1, 3, 256), 49.0),
    ];
    for (name, view, least_db) in views {
        let job = job(Mode::Volume, view);
        let rows = against_slices(&renderer, &job, &scene, &[8, 64, 256])
            .unwrap()
            .rows;
        for row in &rows {
            println!("{name}: {} slices, {:?}", row.slices, row.difference);
        }
        let [eight, usual, many] = [0, 1, 2].map(|i| rows[i].difference);
        assert!(usual.psnr_db.unwrap() >= least_db, "{name}: {usual:?}");
        // Few slices are far off; from 64 on what is left does not come from slices, however many there are.
        let [few_db, usual_db, many_db] = [eight, usual, many].map(|d| d.psnr_db.unwrap());
        assert!(
            few_db < usual_db - 3.0 && many_db > usual_db - 3.0,
            "{name}"
        );
        assert!(
            eight.mean_flip > 1.5 * usual.mean_flip && many.mean_flip < 1.5 * usual.mean_flip,
            "{name}"
        );
    }
}

#[test]
fn from_any_side_the_volume_is_near_the_reference() {
    let scene = ocean(ONE_DEGREE);
    // Slices stand askew to the sheet (docs/performance-quality.md).
    for (target, distance_m, angles, least_db) in [
        ([-122.0, 27.0], 2.2e6, [0.0, 45.0], 45.0),
        ([-122.0, 27.0], 2.2e6, [150.0, 60.0], 49.0),
        ([-150.0, 0.0], 3.0e6, [-45.0, 75.0], 51.0),
        // Against the sun and with it, the limb in sight.
        ([-150.0, 0.0], 6.0e6, [135.0, 50.0], 48.0),
        ([-150.0, 0.0], 6.0e6, [-45.0, 50.0], 46.0),
    ] {
        let job = job(Mode::Volume, looking_at(target, distance_m, angles, 96));
        let truth = reference(&job, &scene, Fineness::default()).unwrap();
        let difference = Difference::of(&drawn(&job, &scene), &truth).unwrap();
        println!("{target:?} from {distance_m} m, {angles:?}: {difference:?}");
        assert!(
            difference.psnr_db.unwrap() >= least_db,
            "{target:?} {angles:?}: {difference:?}"
        );
    }
}

#[test]
fn from_below_the_sea_the_volume_is_near_the_reference() {
    let scene = ocean(ONE_DEGREE);
    // From under sources of the tropics, at the sinks of middle latitudes and at what stands on the surface.
    for (place, depth_m, [heading_deg, tilt_deg], least_db) in [
        ([-128.0, 8.0], 3e5, [0.0, 95.0], 51.0),
        ([-150.0, 2.0], 6e5, [200.0, 105.0], 51.0),
        ([-128.0, 8.0], 4e5, [20.0, 60.0], 35.0),
    ] {
        let [lon_deg, lat_deg] = place;
        let view = View::Globe {
            lon_deg,
            lat_deg,
            height_m: -depth_m,
            width_px: 96,
            height_px: 64,
            angles: CameraAngles {
                heading_deg,
                tilt_deg,
                ..CameraAngles::NADIR
            },
        };
        let mut job = job(Mode::Volume, view);
        job.style.slices = 128;
        let truth = reference(&job, &scene, Fineness::default()).unwrap();
        let covered = truth.rgba.iter().filter(|pixel| pixel[3] > 0.1).count();
        let difference = Difference::of(&drawn(&job, &scene), &truth).unwrap();
        println!("{place:?}, {depth_m} m deep, tilt {tilt_deg}: {covered} px, {difference:?}");
        assert!(covered > 500, "{covered} pixels of 6144");
        assert!(difference.psnr_db.unwrap() >= least_db, "{difference:?}");
    }
}

#[test]
fn a_region_in_fine_cells_is_near_the_reference_from_afar() {
    let scene = ocean(REGION);
    let mut job = job(Mode::Volume, globe(-135.0, 20.5, 5.3e6, 160));
    job.style.particles_per_cell = 1;
    let truth = reference(&job, &scene, Fineness::default()).unwrap();
    let difference = Difference::of(&drawn(&job, &scene), &truth).unwrap();
    println!("a region: {difference:?}");
    // Light and slices that reached round the globe would be much coarser: 42 dB and 0.05.
    assert!(difference.psnr_db.unwrap() >= 47.0 && difference.mean_flip <= 0.024);
    // The sea fills the middle of the picture, so that much is compared.
    let covered = truth.rgba.iter().filter(|pixel| pixel[3] > 0.1).count();
    assert!(covered * 3 > truth.rgba.len());
}

#[test]
fn shorter_steps_do_not_move_the_reference() {
    let scene = ocean(ONE_DEGREE);
    for view in [
        globe(-122.0, 27.0, 2.2e6, 48),
        globe(-100.0, 20.0, 9.0e6, 40),
    ] {
        let job = job(Mode::Volume, view);
        let usual = reference(&job, &scene, Fineness::default()).unwrap();
        for steps_per_radius in [16, 32] {
            let fine = reference(&job, &scene, Fineness { steps_per_radius }).unwrap();
            let moved = Difference::of(&usual, &fine).unwrap();
            println!("{steps_per_radius} steps a radius: {moved:?}");
            assert!(
                moved.most_levels < 0.1 && moved.mean_flip < 1e-3,
                "{moved:?}"
            );
        }
        let coarse = reference(
            &job,
            &scene,
            Fineness {
                steps_per_radius: 1,
            },
        );
        let moved = Difference::of(&usual, &coarse.unwrap()).unwrap();
        assert!(moved.most_levels > 0.1, "coarse steps are seen: {moved:?}");
    }
}

#[test]
fn a_picture_that_the_reference_cannot_draw_is_refused() {
    let scene = ocean(ONE_DEGREE);
    let mut with_globe = job(Mode::Volume, globe(0.0, 0.0, 5e6, 16));
    with_globe.style.globe_surface = true;
    let mut uncertain = job(Mode::Volume, globe(0.0, 0.0, 5e6, 16));
    uncertain.style.uncertainty = true;
    let points = job(Mode::Points, globe(0.0, 0.0, 5e6, 16));
    for job in [with_globe, uncertain, points] {
        let refused = reference(&job, &scene, Fineness::default());
        assert!(
            matches!(refused, Err(ProofError::NoReference)),
            "{refused:?}"
        );
    }
}
