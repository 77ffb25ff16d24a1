// No list is cut into parts; in pictures where cells crowd, `hot.wgsl` stands in the place of this.
fn long_sum(list: u32, length: u32, pixel: u32) -> LongSum {
    return LongSum(false, vec4(0u));
}
