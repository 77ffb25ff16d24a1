//! Whether a picture, or any of a film, shows nothing but sky and what rises over the horizon.

use contract::job::View;

/// What to tell of a view that has nothing of the earth's surface in it; nothing of one that has.
pub(crate) fn note(view: &View) -> Option<String> {
    let tilt = view.tilt_with_ground_deg()?;
    Some(format!(
        "nothing of the earth's surface is in the picture: the camera looks past it, at the sky and at what rises over the \
         horizon; a tilt of {tilt} degrees or less has some"
    ))
}

/// The same of the pictures of a film.
pub(crate) fn note_of_film(views: &[View]) -> Option<String> {
    let past = |view: &View| view.tilt_with_ground_deg().is_some();
    let first = views.iter().position(past)?;
    let (count, all) = (views.iter().filter(|view| past(view)).count(), views.len());
    let tilt = views[first].tilt_with_ground_deg()?;
    Some(format!(
        "{count} of {all} pictures have nothing of the earth's surface in them, picture {first} the first: the camera looks \
         past it, at the sky and at what rises over the horizon; there, a tilt of {tilt} degrees or less has some"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::camera::CameraAngles;

    fn view(tilt_deg: f64) -> View {
        View::Globe {
            lon_deg: 0.0,
            lat_deg: 0.0,
            height_m: 5e3,
            width_px: 640,
            height_px: 480,
            angles: CameraAngles {
                tilt_deg,
                ..CameraAngles::NADIR
            },
        }
    }

    #[test]
    fn a_look_into_the_sky_is_told_with_a_tilt_that_has_ground() {
        assert_eq!(note(&view(80.0)), None);
        let told = note(&view(150.0)).unwrap();
        assert!(told.contains("a tilt of 110.2 degrees or less"), "{told}");
        assert_eq!(note_of_film(&[view(80.0), view(90.0)]), None);
        let told = note_of_film(&[view(80.0), view(120.0), view(150.0), view(0.0)]).unwrap();
        assert!(told.starts_with("2 of 4 pictures"), "{told}");
        assert!(told.contains("picture 1 the first"), "{told}");
    }
}
