use crate::adapters::ListAsked;
use anyhow::Context;
use sim_gpu::Caster;

/// Flags of every command that casts.
#[derive(clap::Args)]
pub struct CasterArgs {
    /// What casts the rays: auto, cpu, or part of a GPU's name; `list` lists them
    ///
    /// auto is a GPU if there is one, or else the CPU.
    #[arg(long, default_value = "auto", value_name = "ADAPTER|list", value_parser = adapter)]
    adapter: String,
}

impl CasterArgs {
    /// Opens the adapter and says which it is.
    pub fn caster(&self) -> anyhow::Result<Caster> {
        let caster = Caster::named(&self.adapter)
            .context("cannot open the adapter (`--adapter list` lists all)")?;
        match caster.why_no_gpu() {
            Some(why) if self.adapter == "auto" => program::say!("Casting on the CPU: {why}."),
            _ => {
                caster.skipped().iter().for_each(|why| program::say!("Skipped an adapter: {why}."));
                program::say!("Casting on {}.", caster.name());
            }
        }
        Ok(caster)
    }
}

fn adapter(word: &str) -> Result<String, ListAsked> {
    if word == "list" { Err(ListAsked) } else { Ok(word.to_owned()) }
}
