//! `--adapter list`: the adapters (GPUs and CPU) that can cast rays.

use crate::Outcome;
#[cfg(feature = "gpu")]
use sim_gpu::adapters::{AdapterKind, list_adapters};
use std::error::Error;
use std::fmt;
use std::io::Write;

#[cfg(feature = "gpu")]
const HOW_TO_GET_VULKAN: &str = "a GPU needs a Vulkan driver, which on Debian or Ubuntu \
     `apt-get install mesa-vulkan-drivers` installs for those of AMD and Intel";

/// The list of adapters is asked for in place of the name of one.
#[derive(Debug)]
pub struct ListAsked;

impl fmt::Display for ListAsked {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("expected an adapter; only the program lists them")
    }
}

impl Error for ListAsked {}

/// Whether the command line was not parsed further since it asks for the list.
pub fn are_asked_for(error: &clap::Error) -> bool {
    error.source().is_some_and(|source| source.is::<ListAsked>())
}

/// Lists every adapter, best first, and the CPU caster.
pub fn list() -> anyhow::Result<Outcome> {
    let mut out = std::io::stdout().lock();
    #[cfg(feature = "gpu")]
    let adapters = list_adapters();
    #[cfg(feature = "gpu")]
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
    #[cfg(not(feature = "gpu"))]
    writeln!(out, "This program was built without GPU support (the feature `gpu`).")?;
    #[cfg(feature = "gpu")]
    if adapters.iter().all(|adapter| adapter.kind == AdapterKind::Software) {
        writeln!(out, "No GPU was found; {HOW_TO_GET_VULKAN}.")?;
    }
    Ok(Outcome::Success)
}
