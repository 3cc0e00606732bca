use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use formats::hash;
use formats::model_card::{ModelCard, Normalization};
use formats::weights::Tensor;

use super::checkpoint::Checkpoint;
use super::table::Table;

/// Flags for the facts on the card that neither the checkpoint nor the table states, or that
/// correct the table.
#[derive(clap::Args)]
pub struct CardArgs {
    /// File of class names, one per line, in the order of the logits [default: ModelNet40's classes
    /// if there are 40 logits]
    #[arg(long, value_name = "FILE")]
    classes: Option<PathBuf>,

    /// Sampler in training, by its name in infer-cpu [default: the table's]
    #[arg(long, value_name = "NAME")]
    sampler: Option<String>,

    /// Number of points that the sampler selects [default: the table's]
    #[arg(long, value_name = "N")]
    points: Option<usize>,

    /// Normalization of clouds in training: unit-sphere or none [default: the table's]
    #[arg(long, value_name = "NAME")]
    normalization: Option<Normalization>,

    /// Name of the training set
    #[arg(long, value_name = "TEXT")]
    training_set: Option<String>,

    /// Accuracy of the model, and the data of the measurement [default: as the checkpoint states]
    #[arg(long, value_name = "TEXT")]
    accuracy: Option<String>,

    /// Source of the weights [default: the checkpoint's name and SHA-256]
    #[arg(long, value_name = "TEXT")]
    provenance: Option<String>,
}

impl CardArgs {
    /// The card of the model with these `tensors`, read from the checkpoint at `path`.
    pub fn card(
        &self,
        path: &Path,
        checkpoint: &Checkpoint,
        table: &Table,
        tensors: &BTreeMap<String, Tensor>,
    ) -> anyhow::Result<ModelCard> {
        let mut card = table.card.clone();
        let n_logits = *widths(tensors, "fc").last().unwrap_or(&0);
        card.classes = self.classes(path, table, n_logits)?;
        if self.sampler.is_some() && self.sampler != card.sampler {
            card.sampler.clone_from(&self.sampler);
            (card.points, card.fps_start) = (None, None);
        }
        card.points = self.points.or(card.points);
        card.normalization = self.normalization.unwrap_or(card.normalization);
        card.training_set = self.training_set.clone().or(card.training_set);
        card.accuracy = match &checkpoint.accuracy {
            _ if self.accuracy.is_some() => self.accuracy.clone(),
            Ok(stated) => stated.clone().or(card.accuracy),
            Err(kind) => {
                formats::say!("{}: its accuracy is a {kind}; --accuracy states it", path.display());
                card.accuracy
            }
        };
        card.provenance = match &self.provenance {
            Some(text) => Some(text.clone()),
            None => {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                Some(format!("{name}, SHA-256 {}", hash::of_file(path)?))
            }
        };
        Ok(card)
    }

    fn classes(
        &self,
        checkpoint: &Path,
        table: &Table,
        n_logits: usize,
    ) -> anyhow::Result<Vec<String>> {
        let Some(path) = &self.classes else {
            let fits = table.default_classes.len() == n_logits;
            if !fits {
                let checkpoint = checkpoint.display();
                formats::say!(
                    "{checkpoint}: {n_logits} classes without names; --classes names them"
                );
            }
            return Ok(if fits { table.default_classes.clone() } else { Vec::new() });
        };
        let text = std::fs::read_to_string(path).with_context(|| format!("{}", path.display()))?;
        let names = text.lines().map(str::trim).filter(|name| !name.is_empty());
        let names: Vec<String> = names.map(str::to_owned).collect();
        if names.len() != n_logits {
            bail!("{}: {} class names for {n_logits} logits", path.display(), names.len());
        }
        if let Some(i) = (0..names.len()).find(|&i| names[..i].contains(&names[i])) {
            let (file, name) = (path.display(), &names[i]);
            bail!("{file}: expected a name for each class, found two classes `{name}`");
        }
        Ok(names)
    }
}

/// The widths of the trunk and the head, such as `3-64-128-1024 | 1024-512-256-40`.
pub fn all_widths(tensors: &BTreeMap<String, Tensor>) -> String {
    let joined =
        |stem| widths(tensors, stem).iter().map(ToString::to_string).collect::<Vec<_>>().join("-");
    format!("{} | {}", joined("feat.conv"), joined("fc"))
}

/// The number of inputs of layer `stem1`, and the numbers of outputs of `stem1`, `stem2`, ….
fn widths(tensors: &BTreeMap<String, Tensor>, stem: &str) -> Vec<usize> {
    let shape = |i: usize| Some(&tensors.get(&format!("{stem}{i}.weight"))?.shape[..]);
    let inputs = shape(1).and_then(|shape| shape.get(1)).copied();
    let outputs = (1..).map_while(|i| shape(i)?.first().copied());
    inputs.into_iter().chain(outputs).collect()
}
