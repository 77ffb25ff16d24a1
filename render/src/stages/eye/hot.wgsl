// Lists that are long beyond the others, where cells crowd (round a pole, along a limb): cut into parts, each summed up
// by a workgroup of its own before the eye looks. Sums of integers are the same however they are cut.

// Is any list of the picture cut? Kernels of their own, so that others pay nothing for it.
override HAS_PARTS: bool = false;

// Of a long list: its first part and 1; 0 where there was no room for its parts.
@group(0) @binding(8) var<storage, read_write> hot_lists: array<u32>;
// How many parts there are, and of each the list.
@group(0) @binding(9) var<storage, read_write> hot_parts: array<u32>;
// Red, green, blue and depth of every pixel of each part.
@group(0) @binding(10) var<storage, read_write> hot_sums: array<u32>;

const PART_SUMS = 1024u; // 4 times PIXELS

// What a list that is summed up in parts adds to a pixel, if it is such a list.
struct LongSum { is_there: bool, own: vec4<u32> }

fn long_sum(list: u32, length: u32, pixel: u32) -> LongSum {
    if (!HAS_PARTS) { return LongSum(false, vec4(0u)); }
    if (length <= lists.long_list) { return LongSum(false, vec4(0u)); }
    let first = hot_lists[list];
    if (first == 0u) { return LongSum(false, vec4(0u)); }
    var own = vec4(0u);
    let end = first - 1u + (length + part_entries() - 1u) / part_entries();
    for (var part = first - 1u; part < end; part++) {
        let at = part * PART_SUMS + pixel;
        let more = vec4(hot_sums[at], hot_sums[at + PIXELS], hot_sums[at + 2u * PIXELS], hot_sums[at + 3u * PIXELS]);
        own += min(more, vec4(MOST_SUM) - own);
    }
    return LongSum(true, own);
}

@compute @workgroup_size(SCREEN_TILE_PX, SCREEN_TILE_PX)
fn hot(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    for (var channel = 0u; channel < 4u; channel++) { atomicStore(&sums[channel * PIXELS + invocation], 0u); }
    workgroupBarrier();
    let parts = min(hot_parts[0], MOST_HOT_PARTS);
    for (var part = workgroup.x; part < parts; part += workgroups.x) {
        let list = hot_parts[1u + part];
        if (list == NO_LIST) { continue; }
        let tile = list / view.slices;
        look_up_hidden(vec2(tile % view.tiles.x, tile / view.tiles.x), invocation);
        set_corner(vec2(tile % view.tiles.x, tile / view.tiles.x));
        workgroupBarrier();
        var begin = 0u;
        if (list > 0u) { begin = min(list_ends[list - 1u], lists.entry_capacity); }
        begin += (part + 1u - hot_lists[list]) * part_entries();
        let end = min(begin + part_entries(), min(list_ends[list], lists.entry_capacity));
        var own = summed(begin, end, invocation);
        for (var channel = 0u; channel < 4u; channel++) { hot_sums[part * PART_SUMS + channel * PIXELS + invocation] = own[channel]; }
    }
}
