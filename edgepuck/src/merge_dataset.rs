//! `cargo xtask merge-dataset`: shards into one dataset.

use crate::{Outcome, gen_dataset};
use edgepuck_dataset::merge::merge;
use std::path::PathBuf;

/// Flags of `merge-dataset`.
#[derive(clap::Args)]
pub struct Args {
    /// The shards' folders, all of them
    #[arg(required = true, value_name = "SHARD")]
    shards: Vec<PathBuf>,

    /// Folder of the whole dataset
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Merges the shards.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let manifest = merge(&args.shards, &args.out)?;
    eprintln!("{} meshes: {}", manifest.meshes.len(), args.out.display());
    if manifest.adapters.len() > 1 {
        eprintln!(
            "Parts were cast on different adapters ({}): clean scans are what one run gives, \
             noise differs in its last digits.",
            manifest.adapters.join(", ")
        );
    }
    gen_dataset::end(&args.out, &manifest)
}
