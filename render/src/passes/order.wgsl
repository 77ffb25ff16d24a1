// Where the splats of a workgroup are stored: one after the other, workgroup by workgroup.
fn first_splat(workgroup: vec3<u32>, workgroups: vec3<u32>) -> u32 {
    let index = (workgroup.z * workgroups.y + workgroup.y) * workgroups.x + workgroup.x;
    return index * (SQUARE * SQUARE * params.particles_each);
}
