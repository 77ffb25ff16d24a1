// A sum along the slices turns the depth given to each slice into the depth above its plane, one invocation a texel.
@group(0) @binding(1) var<storage, read_write> light: array<u32>;

const DARK = 0x7fffffffu;

@compute @workgroup_size(GROUP)
fn prefix(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let column = list_index(global, workgroups);
    let layer = params.light_width * params.light_height;
    if (column >= layer) { return; }
    var above = 0u;
    var at = column;
    // Eight at a time: loads that do not wait for one another.
    for (var base = 0u; base <= params.slices; base += 8u) {
        var own: array<u32, 8>;
        for (var j = 0u; j < 8u; j++) {
            if (base + j <= params.slices) { own[j] = light[at + j * layer]; }
        }
        for (var j = 0u; j < 8u; j++) {
            if (base + j <= params.slices) { light[at + j * layer] = above; }
            above = min(above + min(own[j], DARK), DARK);
        }
        at += 8u * layer;
    }
}
