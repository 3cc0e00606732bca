//! `cargo xtask import-weights`: a PyTorch checkpoint into a model file.

mod card;
mod checkpoint;
mod table;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::Outcome;
use anyhow::Context;
use card::CardArgs;
use checkpoint::Checkpoint;
use formats::FormatError;
use formats::weights::{Tensor, tensor_part, write_weights};
use infer_cpu::{Classifier, Options};
use table::{Names, Table};

/// Flags of `import-weights`.
#[derive(clap::Args)]
pub struct Args {
    /// The checkpoint, as torch.save wrote it
    #[arg(value_name = "CHECKPOINT")]
    checkpoint: PathBuf,

    /// Model file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Importer table for a model whose layers bear names of their own
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,

    #[command(flatten)]
    card: CardArgs,
}

/// Imports the checkpoint.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let checkpoint = Checkpoint::open(&args.checkpoint)?;
    let tables = match &args.table {
        Some(path) => vec![Table::read(path)?],
        None => Table::builtin()?,
    };
    let (table, names) = table::choose(&tables, checkpoint.names())
        .with_context(|| format!("{}", args.checkpoint.display()))?;
    let tensors = checkpoint.read(&names)?;
    let card = args.card.card(&args.checkpoint, &checkpoint, table, &tensors)?;
    let widths = card::all_widths(&tensors);
    let mut metadata = card.to_metadata();
    metadata.insert("widths".to_owned(), widths.clone());
    check(&args.checkpoint, &names, &tensors, &metadata)?;
    write_weights(&args.out, &tensors, &metadata)?;
    eprintln!("{widths}, named as by {}: {}", table.name, args.out.display());
    Ok(Outcome::Success)
}

/// That infer-cpu loads a model file of these tensors. Errors name the
/// checkpoint at `source`, and tensors by their names there too.
fn check(
    source: &Path,
    names: &Names,
    tensors: &BTreeMap<String, Tensor>,
    metadata: &BTreeMap<String, String>,
) -> anyhow::Result<()> {
    let folder = tempfile::tempdir().context("no folder for temporary files")?;
    let path = folder.path().join("model.safetensors");
    write_weights(&path, tensors, metadata)?;
    match Classifier::load(&path, &Options::default()) {
        Ok(_) => Ok(()),
        Err(infer_cpu::Error::Format(FormatError::Malformed { part, cause, .. })) => {
            let renamed =
                names.iter().find(|(ours, theirs)| part == tensor_part(ours) && ours != theirs);
            let there = renamed.map(|(_, theirs)| format!(" (there `{theirs}`)"));
            let part = part + &there.unwrap_or_default();
            Err(FormatError::malformed(source, part, cause).into())
        }
        Err(other) => Err(other).with_context(|| format!("{}", source.display())),
    }
}
