use anyhow::Context;
use sim_gpu::Caster;

pub const HOW_TO_GET_VULKAN: &str = "a GPU needs a Vulkan driver, which on Debian or Ubuntu \
     `apt-get install mesa-vulkan-drivers` installs for those of AMD and Intel";

/// Flags of every command that casts.
#[derive(clap::Args)]
pub struct CasterArgs {
    /// What casts the rays: auto (a GPU if there is one, or else the CPU), cpu, or part of a GPU's
    /// name, as `edgepuck adapters` lists them
    #[arg(long, default_value = "auto", value_name = "ADAPTER")]
    adapter: String,
}

impl CasterArgs {
    /// Opens the adapter and says which it is.
    pub fn caster(&self) -> anyhow::Result<Caster> {
        let caster = Caster::named(&self.adapter).context("cannot open the adapter")?;
        match caster.why_no_gpu() {
            Some(why) if self.adapter == "auto" => formats::say!("Casting on the CPU: {why}."),
            _ => {
                caster.skipped().iter().for_each(|why| formats::say!("Skipped an adapter: {why}."));
                formats::say!("Casting on {}.", caster.name());
            }
        }
        Ok(caster)
    }
}
