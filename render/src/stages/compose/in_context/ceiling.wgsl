// What an eye below the sea surface sees behind the particles: the surface from underneath, land and coasts dark on it, and
// the core, all through the water.

fn water_before(spot: Spot) -> vec3<f32> {
    return water_light(dot(spot.ground.sight, view.eye) / length(view.eye));
}

// The surface; a map lies on it, and lines on that.
fn ceiling_colour(spot: Spot, pixel: vec2<u32>, blended: vec4<f32>) -> vec4<f32> {
    var seen = vec4(0.0);
    if (has_surface()) {
        var no_floor: Terrain;
        let shares = ground_mask(pixel).xy;
        seen = vec4(plain(spot.ground.lon, spot.ground.lat, shares, no_floor, pixel) * daylight(spot.sun.z), 1.0);
    }
    if (has_coast_above()) { seen = blended + seen * (1.0 - blended.w); }
    seen = over(trail_colour(pixel), seen, true);
    let own = surface_lines(pixel, 0.0);
    seen = over(own.isoline, over(own.graticule, seen, true), true);
    seen = over(coast_colour(spot, pixel, 0.0), seen, true);
    return vec4(mix(water_before(spot) * seen.w, seen.xyz, kept_over(spot.ground.way)), seen.w);
}

// The core, where a globe is drawn.
fn deep_colour(spot: Spot) -> vec4<f32> {
    if (!has_surface()) { return vec4(0.0); }
    let foot = spot.ground.foot;
    let way = spot.ground.nearest_at - sqrt(max(view.hides * view.hides - dot(foot, foot), 0.0));
    return vec4(mix(water_before(spot), view.deep, kept_over(way)), 1.0);
}

fn from_below(spot: Spot, pixel: vec2<u32>, blended: vec4<f32>) -> vec4<f32> {
    var around = vec4(0.0);
    if (spot.cover > 0.0) { around = ceiling_colour(spot, pixel, blended) * spot.cover; }
    if (spot.cover < 1.0) { around += deep_colour(spot) * (1.0 - spot.cover); }
    if (has_coast_above()) { return around; }
    return blended + around * (1.0 - blended.w);
}
