//! Opens the adapter that a command line asks for.

use anyhow::Context;
use sim_gpu::effects::Effects;
use sim_gpu::internals::caster::AdapterRequest;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::job::Culling;

/// What a GPU may lack.
pub const HOW_TO_GET_VULKAN: &str = "a GPU needs a Vulkan driver, which on Debian or Ubuntu \
     `apt-get install mesa-vulkan-drivers` installs for those of AMD and Intel";

/// Flags of every command that casts.
#[derive(clap::Args)]
pub struct CasterArgs {
    /// Adapter that casts the rays: auto (a GPU if there is one, or else the CPU), cpu, or part
    /// of an adapter's name
    #[arg(long, default_value = "auto", value_name = "ADAPTER")]
    pub adapter: AdapterRequest,

    /// Also cast the beams that cannot hit any object; this is slower and gives the same output
    #[arg(long)]
    no_cull: bool,
}

impl CasterArgs {
    /// Opens the adapter for `effects` and says which it is.
    pub fn open(&self, effects: &Effects) -> anyhow::Result<OpenCaster> {
        if self.adapter != AdapterRequest::Auto {
            let caster =
                OpenCaster::open(&self.adapter, effects).context("cannot open the adapter")?;
            eprintln!("Casting on {}.", caster.name());
            return Ok(caster);
        }
        let (caster, passed_over) = OpenCaster::open_best(effects);
        for error in &passed_over {
            eprintln!("Skipped an adapter: {error}.");
        }
        if matches!(caster, OpenCaster::Cpu(_)) {
            eprintln!("No GPU was found, so the CPU casts.");
        } else {
            eprintln!("Casting on {}.", caster.name());
        }
        Ok(caster)
    }

    /// Whether beams that cannot hit are cast.
    pub fn culling(&self) -> Culling {
        if self.no_cull { Culling::Off } else { Culling::On }
    }
}
