//! How large the buffers and dispatches of a picture are: what follows from its parameters alone.

use crate::stages::layout::{LIGHT_OFF, SQUARE};
use crate::stages::params::Params;

/// Bytes of each half of a stored splat: what the eye sees, and where it lies in the light.
pub const HALF_BYTES: u64 = 16;

/// Workgroups over the cells of a picture: across, down, and through the particles of a cell.
pub fn workgroups(params: &Params) -> [u32; 3] {
    let cells = &params.cells;
    [
        cells.slot_count.div_ceil(SQUARE),
        cells.row_count.div_ceil(SQUARE),
        cells.particles_per_cell.div_ceil(cells.particles_each),
    ]
}

/// Where a particle's splat is stored: `down` rows below the first one drawn, in column `slot` of the table.
pub fn stored_at(params: &Params, down: u32, slot: u32, particle: u32) -> usize {
    let [across, along, _] = workgroups(params);
    let each = params.cells.particles_each;
    let group = ((particle / each) * along + down / SQUARE) * across + slot / SQUARE;
    let invocation = down % SQUARE * SQUARE + slot % SQUARE;
    ((group * each + particle % each) * SQUARE * SQUARE + invocation) as usize
}

/// Lists of a picture: screen tiles times slices.
pub fn list_count(params: &Params) -> u32 {
    params.view.tiles.element_product() * params.view.slices
}

/// Numbers in the light buffer: its layers and one for the whole.
pub fn texel_count(params: &Params) -> usize {
    let [width, height] = params.lighting.size.to_array().map(|side| side as usize);
    width * height * (params.lighting.layers as usize + 1)
}

/// Bytes of the light buffer; of one that is bound but never read if particles are not lit.
pub fn light_bytes(params: &Params) -> u64 {
    if params.lighting.mode == LIGHT_OFF {
        4
    } else {
        texel_count(params) as u64 * 4
    }
}
