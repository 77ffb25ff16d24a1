// What an eye below the sea surface looks through: water, and the surface from underneath.

// Light of the water itself where nothing else is seen: dark towards the deep. `up` is the cosine of the way against the
// vertical at the eye.
fn water_light(up: f32) -> vec3<f32> {
    let t = clamp((up + 0.9) / 1.3, 0.0, 1.0);
    return mix(view.deep, view.water, t * t * (3.0 - 2.0 * t));
}

// Share of light that a way through the water leaves (Beer-Lambert).
fn kept_over(way: f32) -> f32 {
    return exp(-view.water_per_unit * way);
}

// Light of the surface from underneath, at a sine of the sun's elevation.
fn ceiling_light(sun: f32) -> vec3<f32> {
    return view.ceiling * (1.0 + view.sun_share * (clamp(sun, 0.0, 1.0) - 0.75));
}
