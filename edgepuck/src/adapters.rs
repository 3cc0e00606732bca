//! `cargo xtask adapters`: what can cast.

use crate::Outcome;
use crate::caster::HOW_TO_GET_VULKAN;
use sim_gpu::gpu::list_adapters;
use std::io::Write;

/// Lists every adapter, best first, and the CPU twin.
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
    writeln!(out, "cpu\n    the CPU twin, without a driver, on all cores")?;
    if adapters.is_empty() {
        writeln!(out, "No GPU and no software Vulkan was found; {HOW_TO_GET_VULKAN}.")?;
    }
    Ok(Outcome::Success)
}
