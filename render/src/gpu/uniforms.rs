//! Structs of parameters: small, all in one buffer, each bound by itself.

/// Binding number of the first; the others follow.
pub const FIRST_UNIFORM: u32 = 16;
/// Room of each: what every device can begin a binding at a multiple of.
const ROOM_BYTES: usize = 256;

/// The bytes of structs in the order of their numbers, each at the start of its room.
pub fn packed(structs: &[&[u8]]) -> Vec<u8> {
    let mut packed = vec![0; structs.len() * ROOM_BYTES];
    for (room, bytes) in packed.chunks_exact_mut(ROOM_BYTES).zip(structs) {
        room[..bytes.len()].copy_from_slice(bytes);
    }
    packed
}

/// The binding of a struct, by its number from 0, in the buffer of all.
pub fn uniform(buffer: &wgpu::Buffer, number: u32) -> wgpu::BindGroupEntry<'_> {
    let room_bytes = ROOM_BYTES as u64;
    wgpu::BindGroupEntry {
        binding: FIRST_UNIFORM + number,
        resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer,
            offset: u64::from(number) * room_bytes,
            size: wgpu::BufferSize::new(room_bytes),
        }),
    }
}
