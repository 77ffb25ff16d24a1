//! Counting, scanning, scattering and their twins.

use render::gpu::{Gpu, Slot};
use render::passes::scatter::{self, Scatter};
use render::passes::splat::{self, Splats};
use render::passes::{NO_PROBES, SHARED_PROBES};
use render::stages::bin::{self, Bin};
use render::stages::layout::{Entry, VIEW_GLOBE};
use render::stages::light::{self, Light};
use render::stages::sizes::list_count;

use super::{Twins, prove};

/// The entries of every list in an order that does not depend on arrival.
fn sorted_lists(list_ends: &[u32], entries: &[Entry]) -> Vec<Vec<[u32; 3]>> {
    let starts = std::iter::once(0).chain(list_ends.iter().copied());
    let lists = starts.zip(list_ends).map(|(start, end)| {
        let list = entries
            .get(start as usize..*end as usize)
            .unwrap_or_default();
        let mut list: Vec<_> = list
            .iter()
            .map(|entry| [entry.place, entry.size, entry.colour])
            .collect();
        list.sort_unstable();
        list
    });
    lists.collect()
}

/// Do two sets of lists hold the same entries, their colours and slopes but for the last bit?
fn same_lists(a: &[Vec<[u32; 3]>], b: &[Vec<[u32; 3]>]) -> bool {
    let same_colour = |a: u32, b: u32| {
        let channels = a.to_le_bytes().into_iter().zip(b.to_le_bytes());
        channels.into_iter().all(|(a, b)| a.abs_diff(b) <= 1)
    };
    let same = |a: &[u32; 3], b: &[u32; 3]| a[..2] == b[..2] && same_colour(a[2], b[2]);
    a.len() == b.len()
        && a.iter()
            .zip(b)
            .all(|(a, b)| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)))
}

#[test]
#[expect(clippy::too_many_lines, reason = "two passes and a scan in one chain")]
fn the_lists_hold_every_stored_splat_once_and_in_its_light() {
    for twins in [Twins::tile(), Twins::globe()] {
        let distance = |gpu: &Gpu, bin_source: &str, (scatter_source, probes): (&str, u32)| {
            let splats = Splats::new(gpu, splat::SOURCE, SHARED_PROBES);
            let light = Light::new(gpu);
            let bin = Bin::new(gpu, bin_source);
            let scatter = Scatter::new(gpu, scatter_source, probes);
            let mut params = twins.params;
            // Rounding may put a few more splats into a list than the twins have.
            params.lists.entry_capacity += params.lists.entry_capacity / 8 + 1024;
            let [first, second] = twins.stored();
            let [seen, lit, above, ends, entries] = twins.run_with(
                gpu,
                &params,
                |_| (),
                |f| {
                    splats.record(f).unwrap();
                    light.record(f).unwrap();
                    bin.record(f).unwrap();
                    scatter.record(f).unwrap();
                },
                [
                    first,
                    second,
                    (Slot::Light, twins.light.len() as u64 * 4),
                    (Slot::Counts, u64::from(list_count(&params)) * 4),
                    (
                        Slot::Entries,
                        u64::from(params.lists.entry_capacity) * size_of::<Entry>() as u64,
                    ),
                ],
            );
            let mut splats = twins.in_order(&seen, &lit);
            let above: Vec<u32> = bytemuck::pod_collect_to_vec(&above);
            light::cpu::shade(&params, &above, &mut splats);
            let mut own_ends = vec![0; list_count(&params) as usize];
            bin::cpu::count(&params, &splats, &mut own_ends);
            let mut own = vec![Entry::default(); bin::cpu::scan(&mut own_ends) as usize];
            bin::cpu::scatter(&params, &splats, &mut own_ends, &mut own);
            assert!(!own.is_empty());
            let ends: Vec<u32> = bytemuck::pod_collect_to_vec(&ends);
            let entries: Vec<Entry> = bytemuck::pod_collect_to_vec(&entries);
            let same = own_ends == ends
                && same_lists(
                    &sorted_lists(&ends, &entries),
                    &sorted_lists(&own_ends, &own),
                );
            if same { 0.0 } else { f32::INFINITY }
        };
        prove(
            "bin",
            bin::SOURCE,
            "counts[at] += start",
            "counts[at] += start + 1u",
            |gpu, source| distance(gpu, source, (scatter::SOURCE, SHARED_PROBES)),
        );
        if twins.params.view.kind == VIEW_GLOBE {
            let (right, wrong) = ("(above - below)", "(below - above)");
            prove("slope", scatter::SOURCE, right, wrong, |gpu, source| {
                distance(gpu, bin::SOURCE, (source, SHARED_PROBES))
            });
        }
        for (probes, right, wrong) in [
            (SHARED_PROBES, "exp(-near)", "exp(near)"),
            (
                SHARED_PROBES,
                "atomicAdd(&counts[tag - 1u], atomicLoad",
                "atomicAdd(&counts[tag - 1u], 1u + atomicLoad",
            ),
            (
                NO_PROBES,
                "return atomicAdd(&counts[list], 1u)",
                "return atomicAdd(&counts[list], 2u)",
            ),
        ] {
            prove("scatter", scatter::SOURCE, right, wrong, |gpu, source| {
                distance(gpu, bin::SOURCE, (source, probes))
            });
        }
    }
}
