//! Opens the adapter that a command line asks for.

use anyhow::Context;
use sim_gpu::caster::AdapterRequest;
use sim_gpu::caster::Caster;
use sim_gpu::effects::Effects;
use sim_gpu::job::Culling;

/// How to install an adapter where none is found.
pub const HOW_TO_GET_VULKAN: &str =
    "on Debian or Ubuntu, `apt-get install mesa-vulkan-drivers` installs software Vulkan";

/// Flags of every command that casts.
#[derive(clap::Args)]
pub struct CasterArgs {
    /// Adapter that casts the rays: auto (the first available of GPU, software Vulkan and CPU;
    /// gen-scenes passes over software Vulkan), cpu, or part of an adapter's name
    #[arg(long, default_value = "auto", value_name = "ADAPTER")]
    pub adapter: AdapterRequest,

    /// Also cast the beams that cannot hit any object; this is slower and gives the same output
    #[arg(long)]
    no_cull: bool,
}

impl CasterArgs {
    /// Opens the adapter for `effects` and says which it is.
    pub fn open(&self, effects: &Effects) -> anyhow::Result<Caster> {
        if self.adapter != AdapterRequest::Auto {
            let caster = self.open_quietly(effects)?;
            eprintln!("Casting on {}.", caster.name());
            return Ok(caster);
        }
        let (caster, passed_over) = Caster::open_best(effects);
        for error in &passed_over {
            eprintln!("Skipped an adapter: {error}.");
        }
        if matches!(caster, Caster::Cpu(_)) {
            eprintln!("No adapter was found, so the CPU casts; {HOW_TO_GET_VULKAN}.");
        } else {
            eprintln!("Casting on {}.", caster.name());
        }
        Ok(caster)
    }

    /// Opens the adapter for `effects` and for scenes of many objects. The CPU casts at the
    /// nearest object first and leaves out what it hides, so that software Vulkan, which runs
    /// on the same cores, takes two to three times as long.
    pub fn open_for_scenes(&self, effects: &Effects) -> anyhow::Result<Caster> {
        let caster = self.open_quietly(effects)?;
        let is_better_on_cpu = self.adapter == AdapterRequest::Auto && caster.is_software_vulkan();
        Ok(if is_better_on_cpu { Caster::Cpu(effects.clone()) } else { caster })
    }

    fn open_quietly(&self, effects: &Effects) -> anyhow::Result<Caster> {
        Caster::open(&self.adapter, effects).context("cannot open the adapter")
    }

    /// Whether beams that cannot hit are cast.
    pub fn culling(&self) -> Culling {
        if self.no_cull { Culling::Off } else { Culling::On }
    }
}
