//! Finds the model of a command.

use std::env;
use std::path::{Path, PathBuf};

use formats::model_card::ModelCard;

use super::Usage;
use crate::model::network::open;

/// The environment variable that names a model if `--model` does not.
const VARIABLE: &str = "EDGEPUCK_MODEL";

/// The default model, for whole objects.
const DEFAULT: &str = "edge-64";

/// The flags for a model.
#[derive(clap::Args)]
pub struct ModelArgs {
    /// Model: edge-64 (whole objects of ModelNet40), set-64 (the same, more accurate and slower),
    /// shapes-rotational-64 (scans of the built-in shapes), street-128 (clusters of streets), or a file in
    /// safetensors format [default: $EDGEPUCK_MODEL, else edge-64, or street-bev for `live`]
    #[arg(long, value_name = "MODEL")]
    model: Option<PathBuf>,

    /// Accept a model with random weights, such as the bundled test model
    #[arg(long)]
    allow_untrained: bool,
}

impl ModelArgs {
    /// Whether the user named a model.
    pub fn is_named(&self) -> bool {
        self.model.is_some() || variable().is_some()
    }

    pub fn open(&self) -> anyhow::Result<(PathBuf, ModelCard)> {
        self.open_or(DEFAULT)
    }

    /// Opens the model, or the bundled one of the name `default`.
    pub fn open_or(&self, default: &str) -> anyhow::Result<(PathBuf, ModelCard)> {
        let path = find_or(self.model.as_deref(), default);
        let (_, card) = open(&path)?;
        if !card.trained && !self.allow_untrained {
            return Err(Usage(format!(
                "{} is untrained: its weights and its answers are random; name a trained \
                 model by --model, or use this one by --allow-untrained",
                path.display()
            ))
            .into());
        }
        Ok((path, card))
    }
}

/// The path of the model `named`, else of [`VARIABLE`], else the name of the bundled one.
pub fn find(named: Option<&Path>) -> PathBuf {
    find_or(named, DEFAULT)
}

fn find_or(named: Option<&Path>, default: &str) -> PathBuf {
    named.map(Path::to_path_buf).or_else(variable).unwrap_or_else(|| default.into())
}

fn variable() -> Option<PathBuf> {
    env::var_os(VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from)
}
