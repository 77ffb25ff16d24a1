//! The Vulkan adapters of this machine, in the order in which they are numbered.

use super::memory;
use crate::adapter::Adapter;
use crate::backend;

/// An adapter that a device can be asked of.
pub(crate) struct Found {
    pub(super) adapter: wgpu::Adapter,
    pub(super) info: wgpu::AdapterInfo,
    pub(super) known: Adapter,
}

/// All adapters, as people name them: by their number here, by where they are plugged in or by their name.
pub fn adapters() -> Vec<Adapter> {
    found().into_iter().map(|found| found.known).collect()
}

impl Found {
    pub(crate) fn known(&self) -> &Adapter {
        &self.known
    }
}

pub(crate) fn found() -> Vec<Found> {
    let mut wanted_instance = wgpu::InstanceDescriptor::new_without_display_handle();
    // Draws whose counts a shader wrote would be checked by another shader each. Only the classic renderer has such
    // draws, and is to be measured without.
    wanted_instance
        .flags
        .remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    let instance = wgpu::Instance::new(wanted_instance);
    let there = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let with_facts = there.into_iter().map(|adapter| {
        let info = adapter.get_info();
        let known = Adapter::of(&info, memory::own_bytes(&adapter));
        Found {
            adapter,
            info,
            known,
        }
    });
    let mut found: Vec<Found> = with_facts.collect();
    backend::order(&mut found, Found::known);
    found
}
