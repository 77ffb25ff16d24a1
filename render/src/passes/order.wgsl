// Which cells are drawn, and how their particles are spread over invocations.
struct CellParams {
    first_row: u32, row_count: u32, slot_count: u32, particles_per_cell: u32, particle_shares: f32, particles_each: u32, splat_count: u32,
}
@group(0) @binding(19) var<uniform> cells: CellParams;

// Share of particle `k` of a cell: the last one may be there in part.
fn particle_share(k: u32) -> f32 {
    return clamp(cells.particle_shares - f32(k), 0.0, 1.0);
}

// Where the splats of a workgroup are stored: one after the other, workgroup by workgroup.
fn first_splat(workgroup: vec3<u32>, workgroups: vec3<u32>) -> u32 {
    let index = (workgroup.z * workgroups.y + workgroup.y) * workgroups.x + workgroup.x;
    return index * (SQUARE * SQUARE * cells.particles_each);
}
