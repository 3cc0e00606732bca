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
use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile, write_weights};
use table::Table;

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
    check(&args.checkpoint, &tensors, &metadata)?;
    write_weights(&args.out, &tensors, &metadata)?;
    eprintln!("{widths}, named as by {}: {}", table.name, args.out.display());
    Ok(Outcome::Success)
}

/// That a model file of these tensors can be loaded; errors name the
/// checkpoint at `source`.
fn check(
    source: &Path,
    tensors: &BTreeMap<String, Tensor>,
    metadata: &BTreeMap<String, String>,
) -> anyhow::Result<()> {
    let folder = tempfile::tempdir().context("no folder for temporary files")?;
    let path = folder.path().join("model.safetensors");
    write_weights(&path, tensors, metadata)?;
    load(&path).map_err(|error| match error {
        FormatError::Malformed { part, cause, .. } => FormatError::malformed(source, part, cause),
        other => other,
    })?;
    Ok(())
}

fn load(path: &Path) -> Result<(), FormatError> {
    let mut file = WeightsFile::open(path)?;
    ModelCard::from_metadata(path, &file.metadata())?;
    for name in file.shapes().into_keys() {
        file.read(&name)?;
    }
    Ok(())
}
