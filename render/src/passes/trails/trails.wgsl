// From cells of a flow to stored splats: one invocation makes the dots of one particle's trail, one after the other
// along its way.
@group(0) @binding(4) var<storage, read> velocity: array<Velocity>;

@compute @workgroup_size(SQUARE, SQUARE)
fn trails(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    clear_table(invocation);
    workgroupBarrier();
    let down = workgroup.y * SQUARE + local.y;
    let slot = workgroup.x * SQUARE + local.x;
    let row = cells.first_row + down;
    var trail: Trail;
    if (down < cells.row_count && slot < cells.slot_count && is_in_cap(row, slot)) { trail = trail_of(row, slot, workgroup.z); }
    let share = dot_share(trail.age);
    let first = first_splat(workgroup, workgroups) + invocation;
    for (var number = 0u; number < cells.particles_each; number++) {
        let at = first + number * SQUARE * SQUARE;
        if (trail.open <= 0.0) {
            store_nothing(at);
        } else {
            let here = drift_at(row, trail.col, trail.place);
            trail.open = min(trail.open, here.open);
            store(at, splat_of(dot_of(row, slot, number, trail, here.speed)));
            trail = stepped(row, trail, here, share);
        }
    }
    workgroupBarrier();
    add_sums(invocation);
}
