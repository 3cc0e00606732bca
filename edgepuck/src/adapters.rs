use crate::Outcome;
use crate::caster::HOW_TO_GET_VULKAN;
use sim_gpu::internals::gpu::{AdapterKind, list_adapters};
use std::io::Write;

/// Lists every adapter, best first, and the CPU caster.
pub fn run() -> anyhow::Result<Outcome> {
    let adapters = list_adapters();
    let mut out = std::io::stdout().lock();
    for adapter in &adapters {
        writeln!(out, "{}", adapter.name)?;
        writeln!(
            out,
            "    {}, {}, {}; largest binding {} MiB",
            adapter.kind,
            adapter.backend,
            adapter.driver,
            adapter.max_binding_bytes >> 20
        )?;
    }
    writeln!(out, "cpu\n    the CPU caster, on all cores; it needs no driver")?;
    if adapters.iter().all(|adapter| adapter.kind == AdapterKind::Software) {
        writeln!(out, "No GPU was found; {HOW_TO_GET_VULKAN}.")?;
    }
    Ok(Outcome::Success)
}
