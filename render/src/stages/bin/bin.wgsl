// From the lengths of lists to their starts: an exclusive scan in two steps.
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> block_sums: array<u32>;
// Long lists and their parts: see the eye's `hot.wgsl`.
@group(0) @binding(3) var<storage, read_write> hot_lists: array<u32>;
@group(0) @binding(4) var<storage, read_write> hot_parts: array<atomic<u32>>;

const PER_INVOCATION = 8u;

// Finds room for the parts of a long list.
fn cut(list: u32, length: u32) {
    let parts = (length + part_entries() - 1u) / part_entries();
    let first = atomicAdd(&hot_parts[0], parts);
    let fits = first + parts <= MOST_HOT_PARTS;
    for (var part = first; part < min(first + parts, MOST_HOT_PARTS); part++) {
        atomicStore(&hot_parts[1u + part], select(NO_LIST, list, fits));
    }
    hot_lists[list] = select(0u, first + 1u, fits);
}

var<workgroup> partial: array<u32, GROUP>;

// Sum of `own` over the invocations before this one; `partial[GROUP - 1]` then holds the whole.
fn scan_workgroup(invocation: u32, own: u32) -> u32 {
    partial[invocation] = own;
    workgroupBarrier();
    for (var distance = 1u; distance < GROUP; distance *= 2u) {
        var before = 0u;
        if (invocation >= distance) { before = partial[invocation - distance]; }
        workgroupBarrier();
        partial[invocation] += before;
        workgroupBarrier();
    }
    return partial[invocation] - own;
}

@compute @workgroup_size(GROUP)
fn scan_blocks(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    let block = workgroup.x + workgroup.y * workgroups.x;
    let base = (block * GROUP + invocation) * PER_INVOCATION;
    let length = view.tiles.x * view.tiles.y * view.slices;
    var before: array<u32, PER_INVOCATION>;
    var sum = 0u;
    for (var j = 0u; j < PER_INVOCATION; j++) {
        before[j] = sum;
        if (base + j < length) {
            let own = counts[base + j];
            sum += own;
            if (own > lists.long_list) { cut(base + j, own); }
        }
    }
    let start = scan_workgroup(invocation, sum);
    for (var j = 0u; j < PER_INVOCATION; j++) {
        if (base + j < length) { counts[base + j] = start + before[j]; }
    }
    if (invocation == GROUP - 1u) { block_sums[block] = start + sum; }
}

@compute @workgroup_size(GROUP)
fn scan_add(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    let block = workgroup.x + workgroup.y * workgroups.x;
    // Every workgroup sums up the blocks before its own: there are some hundred, and a step between would cost more.
    var own = 0u;
    for (var before = invocation; before < block; before += GROUP) { own += block_sums[before]; }
    scan_workgroup(invocation, own);
    let start = partial[GROUP - 1u];
    let length = view.tiles.x * view.tiles.y * view.slices;
    for (var j = 0u; j < PER_INVOCATION; j++) {
        let at = (block * PER_INVOCATION + j) * GROUP + invocation;
        if (at < length) { counts[at] += start; }
    }
}
