//! How much memory a device has of its own, which wgpu does not tell: asked of the driver.

/// Bit of a heap that lies on the device (`VK_MEMORY_HEAP_DEVICE_LOCAL_BIT`).
const DEVICE_LOCAL: u32 = 1;

/// Bytes of the largest heap on the device; none if the driver is not Vulkan.
#[expect(
    unsafe_code,
    reason = "the driver's own table is reached through the raw handles of the adapter"
)]
pub(super) fn own_bytes(adapter: &wgpu::Adapter) -> Option<u64> {
    // SAFETY: the handles live as long as the adapter, nothing is destroyed through them, and reading a table that the
    // driver made when it was loaded has no effect on anything.
    let properties = unsafe {
        let adapter = adapter.as_hal::<wgpu::hal::api::Vulkan>()?;
        let instance = adapter.shared_instance().raw_instance();
        instance.get_physical_device_memory_properties(adapter.raw_physical_device())
    };
    let count = (properties.memory_heap_count as usize).min(properties.memory_heaps.len());
    let heaps = properties.memory_heaps[..count].iter();
    let own = heaps.filter(|heap| heap.flags.as_raw() & DEVICE_LOCAL != 0);
    own.map(|heap| heap.size).max()
}
