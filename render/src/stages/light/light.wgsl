// A sum along the layers turns the depth given to each layer into twice the depth above its middle: that above its upper
// plane and that above its lower one; the layer behind the last holds twice the whole. A column of texels is cut into segments, one invocation each, whose sums are added up in shared memory.
@group(0) @binding(1) var<storage, read_write> light: array<u32>;

const DARK = 0x7fffffffu;
const COLUMNS = 32u; // of a workgroup
const SEGMENTS = 8u;
const STEP = 8u; // loads that do not wait for one another

var<workgroup> segment_sums: array<u32, 256>;

// Sum that stops at DARK; both terms are at most that.
fn deeper(a: u32, b: u32) -> u32 {
    return min(a + b, DARK);
}

@compute @workgroup_size(COLUMNS, SEGMENTS)
fn prefix(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>) {
    let layer = lighting.size.x * lighting.size.y;
    let column = (workgroup.y * workgroups.x + workgroup.x) * COLUMNS + local.x;
    // One layer more: it receives the whole.
    let length = (lighting.layers + SEGMENTS) / SEGMENTS;
    let begin = min(local.y * length, lighting.layers + 1u);
    let end = select(begin, min(begin + length, lighting.layers + 1u), column < layer);
    var sum = 0u;
    for (var base = begin; base < end; base += STEP) {
        var own: array<u32, 8>;
        for (var j = 0u; j < STEP; j++) {
            own[j] = 0u;
            if (base + j < end) { own[j] = light[(base + j) * layer + column]; }
        }
        for (var j = 0u; j < STEP; j++) { sum = deeper(sum, min(own[j], DARK)); }
    }
    segment_sums[local.y * COLUMNS + local.x] = sum;
    workgroupBarrier();
    var above = 0u;
    for (var before = 0u; before < local.y; before++) { above = deeper(above, segment_sums[before * COLUMNS + local.x]); }
    for (var base = begin; base < end; base += STEP) {
        var own: array<u32, 8>;
        for (var j = 0u; j < STEP; j++) {
            own[j] = 0u;
            if (base + j < end) { own[j] = light[(base + j) * layer + column]; }
        }
        for (var j = 0u; j < STEP; j++) {
            let below = deeper(above, min(own[j], DARK));
            if (base + j < end) { light[(base + j) * layer + column] = above + below; }
            above = below;
        }
    }
}

// The same without segments and without waiting: see the eye's `alone`.
@compute @workgroup_size(GROUP)
fn straight(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let layer = lighting.size.x * lighting.size.y;
    let column = list_index(global, workgroups);
    if (column >= layer) { return; }
    var above = 0u;
    for (var i = 0u; i <= lighting.layers; i++) {
        let at = i * layer + column;
        let below = deeper(above, min(light[at], DARK));
        light[at] = above + below;
        above = below;
    }
}
