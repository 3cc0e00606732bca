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
use formats::labelled::read_labelled;
use formats::model_card::ModelCard;
use formats::outputs::{Overwrite, need_extension};
use formats::weights::{Tensor, tensor_part, write_half_weights, write_weights};
use infer_cpu::{Classifier, Options};
use table::{Names, Table};

#[derive(clap::Args)]
pub struct ImportWeightsArgs {
    /// Checkpoint file that torch.save wrote; if all its tensors are in f16, so are the model's
    #[arg(value_name = "CHECKPOINT")]
    checkpoint: PathBuf,

    /// Model file to write (.safetensors)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    overwrite: Overwrite,

    /// Importer table (TOML), for a model whose layers have other names
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,

    /// Packed NPZ file of clouds to calibrate int8 with, preferably from the training set
    #[arg(long, value_name = "NPZ")]
    calibrate: Option<PathBuf>,

    #[command(flatten)]
    card: CardArgs,
}

pub fn run(args: &ImportWeightsArgs) -> anyhow::Result<Outcome> {
    need_extension("--out", &args.out, &["safetensors"])?;
    args.overwrite.check([&*args.out])?;
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
    let ranges = check(args, &names, &tensors, &metadata)?;
    metadata.extend(ranges);
    let write = if checkpoint.is_half() { write_half_weights } else { write_weights };
    write(&args.out, &tensors, &metadata)?;
    formats::say!("{widths}, named as by {}: {}", table.name, args.out.display());
    Ok(Outcome::Success)
}

/// The metadata of `--calibrate`, which need the loaded network.
type Ranges = Option<(String, String)>;

/// Checks that infer-cpu loads a model file with these tensors, and calibrates the model. Errors
/// name the checkpoint, and also give a tensor's name in the checkpoint.
fn check(
    args: &ImportWeightsArgs,
    names: &Names,
    tensors: &BTreeMap<String, Tensor>,
    metadata: &BTreeMap<String, String>,
) -> anyhow::Result<Ranges> {
    let source = &args.checkpoint;
    let folder = tempfile::tempdir().context("no folder for temporary files")?;
    let path = folder.path().join("model.safetensors");
    write_weights(&path, tensors, metadata)?;
    match Classifier::load(&path, &Options::default()) {
        Ok(_) => args.calibrate.as_deref().map(|clouds| calibrate(&path, clouds)).transpose(),
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

/// The largest activations of the model on a sample of the clouds.
fn calibrate(model: &Path, clouds: &Path) -> anyhow::Result<(String, String)> {
    let set = read_labelled(clouds)?;
    let activation_ranges = infer_cpu::activation_ranges_of_set(model, &set)?;
    let card = ModelCard { activation_ranges, ..ModelCard::default() };
    let ranges = card.to_metadata().remove_entry("activation_ranges");
    ranges.context("the model has no activations to calibrate")
}
