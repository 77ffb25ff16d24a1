//! `fluxglobe adapters`: what this machine can draw on.

use anyhow::Result;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use render::Adapter;
use serde::Serialize;

use crate::cli::{Adapters, Settings};
use crate::{deployment, progress};

/// One adapter, as `--json` prints it.
#[derive(Debug, Serialize)]
struct Listed {
    /// What `--adapter` may name it by.
    number: usize,
    name: String,
    /// `discrete_gpu`, `integrated_gpu`, `virtual_gpu`, `cpu` or `other`.
    kind: &'static str,
    pci_address: Option<String>,
    driver: String,
    /// Memory of its own; none where that is the computer's.
    memory_bytes: Option<u64>,
    /// Pictures drawn on it at the same time if nothing else is asked for.
    draws_at_once: usize,
    /// Is it drawn on by the settings given?
    is_used: bool,
}

pub(crate) fn run(settings: &Settings, options: &Adapters) -> Result<()> {
    let backend = deployment::backend(settings)?;
    let there = render::adapters();
    // None may be fit: then that is what the table shows.
    let used = render::chosen(&backend, &there);
    let listed = |(number, adapter): (usize, &Adapter)| Listed {
        number,
        name: adapter.name().to_owned(),
        kind: adapter.kind(),
        pci_address: adapter.pci_address().map(str::to_owned),
        driver: adapter.driver().to_owned(),
        memory_bytes: adapter.own_bytes(),
        draws_at_once: adapter.draws_at_once().get(),
        is_used: used.as_ref().is_ok_and(|used| used.contains(&number)),
    };
    let rows: Vec<Listed> = there.iter().enumerate().map(listed).collect();
    if options.json {
        progress::result(&serde_json::to_string_pretty(&rows)?)?;
    } else if !rows.is_empty() {
        progress::result(&table(&rows).trim_fmt())?;
    }
    used?;
    Ok(())
}

fn table(rows: &[Listed]) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header([
        "",
        "number",
        "name",
        "kind",
        "PCI address",
        "memory",
        "driver",
    ]);
    for row in rows {
        let memory = |bytes: u64| format!("{:.0} GiB", bytes as f64 / f64::from(1 << 30));
        table.add_row([
            if row.is_used { "*" } else { "" },
            &row.number.to_string(),
            &row.name,
            row.kind,
            row.pci_address.as_deref().unwrap_or(""),
            &row.memory_bytes.map_or(String::new(), memory),
            &row.driver,
        ]);
    }
    table
}
