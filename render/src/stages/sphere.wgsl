
// Shared by the stages that see the ground of the globe through a pixel.
const TURN = 6.2831855;

// Angle of a vector against the x axis, -pi to pi: Abramowitz and Stegun 4.4.49, good to 1e-7 on every device, unlike
// the arc functions of some.
fn angle_of(y: f32, x: f32) -> f32 {
    let wide = max(abs(x), abs(y));
    let t = min(abs(x), abs(y)) / max(wide, 1.0e-30);
    let q = t * t;
    let high = q * (-0.0752896400 + q * (0.0429096138 + q * (-0.0161657367 + q * 0.0028662257)));
    var angle = t * (1.0 + q * (-0.3333314528 + q * (0.1999355085 + q * (-0.1420889944 + q * (0.1065626393 + high)))));
    if (abs(y) > abs(x)) { angle = 0.25 * TURN - angle; }
    if (x < 0.0) { angle = 0.5 * TURN - angle; }
    if (y < 0.0) { return -angle; }
    return angle;
}

// Cosine between sight line and vertical at which lines on the sea surface are gone, and from which on they are whole.
const GRAZING = 0.1;
const CLEAR = 0.3;

struct Ground {
    on_ground: bool, lon: f32, lat: f32, normal: vec3<f32>, rim_px: f32, foot: vec3<f32>, nearest_at: f32, sight: vec3<f32>, way: f32,
}

// Where the sight line of a pixel's centre, `sight`, meets the sea surface and how far away; `rim_px` is how far inside the
// globe's outline it runs, `foot` its place nearest to the globe's centre, `nearest_at` the way from the eye there: negative
// behind the eye. From below the surface that is met from underneath, and `rim_px` is how far outside the core's outline.
fn ground_below(pixel: vec2<u32>) -> Ground {
    let x = (f32(i32(pixel.x) + view.origin_px.x) + 0.5 - view.center_px.x) / view.focal_px;
    let y = (view.center_px.y - f32(i32(pixel.y) + view.origin_px.y) - 0.5) / view.focal_px;
    let camera = view.eye;
    let sight = normalize(view.forward + view.right * x + view.up * y);
    let nearest_at = -dot(camera, sight);
    let foot = camera + sight * nearest_at;
    let miss_sq = dot(foot, foot);
    var ground: Ground;
    ground.foot = foot;
    ground.nearest_at = nearest_at;
    ground.sight = sight;
    let half_chord = sqrt(max(1.0 - miss_sq, 0.0));
    if (is_submerged()) {
        ground.rim_px = 1.0e6;
        if (nearest_at > 0.0) { ground.rim_px = (sqrt(miss_sq) - view.hides) * view.focal_px / max(nearest_at, 1.0e-6); }
        ground.on_ground = ground.rim_px > -0.5;
        ground.way = nearest_at + half_chord;
    } else {
        ground.rim_px = (1.0 - sqrt(miss_sq)) * view.focal_px / max(nearest_at, 1.0e-6);
        ground.on_ground = miss_sq < 1.0 && nearest_at > 0.0;
        ground.way = nearest_at - half_chord;
    }
    if (!ground.on_ground) { return ground; }
    ground.normal = camera + sight * ground.way;
    ground.lat = angle_of(ground.normal.z, length(ground.normal.xy));
    ground.lon = angle_of(ground.normal.x, ground.normal.y);
    return ground;
}

// Share of a line on the sea surface that is shown: where sight grazes it, lines far apart on the ground would be a tangle.
fn line_share(ground: Ground) -> f32 {
    return clamp((abs(dot(ground.sight, ground.normal)) - GRAZING) / (CLEAR - GRAZING), 0.0, 1.0);
}
