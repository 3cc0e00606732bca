use crate::flags::dataset_folder;
use crate::gen_scenes::parts;
use crate::{Outcome, gen_dataset};
use edgepuck_dataset::merge;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Args {
    /// Folders of all the shards, of gen-dataset or of gen-scenes
    #[arg(required = true, value_name = "SHARD")]
    shards: Vec<PathBuf>,

    /// Folder to write the merged dataset to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let folders = args.shards.iter().map(|shard| dataset_folder(shard).to_path_buf());
    let folders: Vec<PathBuf> = folders.collect();
    if folders.iter().any(|folder| parts::record(folder).exists()) {
        parts::merge(&folders, &args.out)?;
        program::say!("{}: {}", formats::counted(folders.len(), "part"), args.out.display());
        return Ok(Outcome::Success);
    }
    let manifest = merge(&folders, &args.out)?;
    program::say!("{}: {}", formats::counted(manifest.meshes.len(), "mesh"), args.out.display());
    if manifest.adapters.len() > 1 {
        program::say!(
            "The shards were cast on different adapters ({}): the clean scans equal those of one \
             run, but the noise differs in its last digits.",
            manifest.adapters.join(", ")
        );
    }
    gen_dataset::end(&args.out, &manifest)
}
