//! What to draw with, and which of the adapters of a host that means.

use crate::adapter::Adapter;
use crate::error::RenderError;

/// What to draw with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Backend {
    /// Compute shaders on the most able Vulkan adapter, in software where there is no graphics card; on all cards where
    /// the most able adapters are several.
    Gpu,
    /// The same, but never in software.
    HardwareGpu,
    /// The adapters that these texts mean: each is a number in the list of [`adapters`](crate::adapters), a PCI address or
    /// a part of a name, which may mean several.
    Adapters(Vec<String>),
    /// The stages' CPU twins.
    Cpu,
}

/// Numbers of the adapters to draw on, of those that [`adapters`](crate::adapters) lists.
///
/// # Errors
/// `NoAdapter`, `SoftwareAdapter` where a card is required, `UnknownAdapter` for a text that means none.
pub fn chosen(backend: &Backend, there: &[Adapter]) -> Result<Vec<usize>, RenderError> {
    match backend {
        Backend::Gpu => most_able(there),
        Backend::HardwareGpu => {
            let chosen = most_able(there)?;
            let software = chosen.iter().find(|&&at| there[at].is_software());
            match software {
                Some(&at) => Err(RenderError::SoftwareAdapter {
                    adapter: there[at].name().to_owned(),
                }),
                None => Ok(chosen),
            }
        }
        Backend::Adapters(wanted) => {
            let meant = wanted.iter().map(|text| meant(text, there));
            meant.collect::<Result<Vec<_>, _>>().map(|of_text| {
                let mut all = Vec::new();
                for at in of_text.concat() {
                    if !all.contains(&at) {
                        all.push(at);
                    }
                }
                all
            })
        }
        Backend::Cpu => Ok(Vec::new()),
    }
}

/// Puts adapters into the order in which they are numbered: cards first, equal ones by where they are plugged in.
pub(crate) fn order<T>(adapters: &mut [T], of: impl Fn(&T) -> &Adapter) {
    adapters.sort_by(|a, b| {
        let (a, b) = (of(a), of(b));
        let key = |adapter: &Adapter| {
            let address = adapter.pci_address().map(str::to_owned);
            (adapter.rank(), address, adapter.name().to_owned())
        };
        key(a).cmp(&key(b))
    });
}

/// All cards of their own that there are; else the first of what there is, since the rest shares its memory or its cores.
fn most_able(there: &[Adapter]) -> Result<Vec<usize>, RenderError> {
    let mut chosen: Vec<usize> = Vec::new();
    for (at, adapter) in there.iter().enumerate() {
        let is_card = adapter.rank() == 0;
        // Two drivers may tell of one card.
        let is_known = adapter.pci_address().is_some()
            && chosen
                .iter()
                .any(|&known| there[known].pci_address() == adapter.pci_address());
        if chosen.is_empty() || (is_card && !is_known) {
            chosen.push(at);
        }
    }
    if chosen.is_empty() {
        return Err(RenderError::NoAdapter);
    }
    Ok(chosen)
}

fn meant(text: &str, there: &[Adapter]) -> Result<Vec<usize>, RenderError> {
    let text = text.trim();
    let unknown = || RenderError::UnknownAdapter {
        wanted: text.to_owned(),
        there: listed(there),
    };
    if text.is_empty() {
        return Err(unknown());
    }
    if let Ok(number) = text.parse::<usize>() {
        return (number < there.len())
            .then(|| vec![number])
            .ok_or_else(unknown);
    }
    let lower = text.to_lowercase();
    let is_meant = |adapter: &Adapter| {
        adapter.pci_address() == Some(&*lower) || adapter.name().to_lowercase().contains(&lower)
    };
    let meant: Vec<usize> = (0..there.len())
        .filter(|&at| is_meant(&there[at]))
        .collect();
    if meant.is_empty() {
        return Err(unknown());
    }
    Ok(meant)
}

fn listed(there: &[Adapter]) -> String {
    let one = |(number, adapter): (usize, &Adapter)| match adapter.pci_address() {
        Some(address) => format!("{number} {} at {address}", adapter.name()),
        None => format!("{number} {}", adapter.name()),
    };
    let all: Vec<String> = there.iter().enumerate().map(one).collect();
    if all.is_empty() {
        return "none".to_owned();
    }
    all.join("; ")
}

#[cfg(test)]
mod tests {
    use wgpu::DeviceType::{Cpu, DiscreteGpu, IntegratedGpu};

    use super::*;

    /// As a driver might tell of them, out of order.
    fn host() -> Vec<Adapter> {
        let mut there = vec![
            Adapter::told("llvmpipe (LLVM 15.0.6, 256 bits)", Cpu, None),
            Adapter::told("NVIDIA H200", DiscreteGpu, Some("0000:a1:00.0")),
            Adapter::told("Intel UHD 630", IntegratedGpu, Some("0000:00:02.0")),
            Adapter::told("NVIDIA H200", DiscreteGpu, Some("0000:21:00.0")),
            Adapter::told(
                "NVIDIA H200 (another driver)",
                DiscreteGpu,
                Some("0000:21:00.0"),
            ),
        ];
        order(&mut there, |adapter| adapter);
        there
    }

    fn named(texts: &[&str]) -> Result<Vec<usize>, String> {
        let texts = texts.iter().map(|text| (*text).to_owned()).collect();
        chosen(&Backend::Adapters(texts), &host()).map_err(|error| error.to_string())
    }

    #[test]
    fn all_cards_of_a_host_are_drawn_on_each_once() {
        let there = host();
        let addresses: Vec<_> = there.iter().map(Adapter::pci_address).collect();
        assert_eq!(
            addresses,
            [
                Some("0000:21:00.0"),
                Some("0000:21:00.0"),
                Some("0000:a1:00.0"),
                Some("0000:00:02.0"),
                None
            ]
        );
        for backend in [Backend::Gpu, Backend::HardwareGpu] {
            assert_eq!(chosen(&backend, &there).unwrap(), [0, 2], "{backend:?}");
        }
        // What shares the processor's memory or cores is one alone.
        assert_eq!(chosen(&Backend::Gpu, &there[3..]).unwrap(), [0]);
        let twice = [there[4].clone(), there[4].clone()];
        assert_eq!(chosen(&Backend::Gpu, &twice).unwrap(), [0]);
        assert!(chosen(&Backend::Cpu, &there).unwrap().is_empty());
    }

    #[test]
    fn a_software_adapter_is_no_card_and_none_is_none() {
        let there = host();
        let refused = chosen(&Backend::HardwareGpu, &there[4..]).unwrap_err();
        assert!(
            matches!(&refused, RenderError::SoftwareAdapter { adapter } if adapter.contains("llvmpipe"))
        );
        for backend in [Backend::Gpu, Backend::HardwareGpu] {
            let refused = chosen(&backend, &[]).unwrap_err();
            assert!(matches!(refused, RenderError::NoAdapter), "{refused}");
        }
    }

    #[test]
    fn an_adapter_is_named_by_number_address_or_part_of_its_name() {
        assert_eq!(named(&["4"]).unwrap(), [4]);
        assert_eq!(named(&["0000:A1:00.0"]).unwrap(), [2]);
        assert_eq!(named(&["h200"]).unwrap(), [0, 1, 2]);
        assert_eq!(named(&["intel", " 2 "]).unwrap(), [3, 2]);
        assert_eq!(named(&["2", "0000:a1:00.0"]).unwrap(), [2], "once each");
    }

    #[test]
    fn an_adapter_that_is_not_there_is_refused_with_those_that_are() {
        for wanted in ["5", "Radeon", "", "-1"] {
            let refused = named(&["0", wanted]).unwrap_err();
            assert!(
                refused.contains(&format!("{wanted:?}"))
                    && refused.contains("2 NVIDIA H200 at 0000:a1:00.0")
                    && refused.contains("4 llvmpipe"),
                "{refused}"
            );
        }
    }
}
