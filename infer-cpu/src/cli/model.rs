//! Finds the model of a command.

use std::env;
use std::path::{Path, PathBuf};

use formats::model_card::ModelCard;

use super::Usage;

/// The environment variable that names a model file if `--model` does not.
const VARIABLE: &str = "EDGEPUCK_MODEL";

/// The bundled weights: the trained ones in any of the folders, else the random ones.
const NAMES: [&str; 2] = ["edge-64.safetensors", "untrained-test.safetensors"];

/// The flags for a model.
#[derive(clap::Args)]
pub struct ModelArgs {
    /// Model file in safetensors format [default: $EDGEPUCK_MODEL, else edge-64.safetensors (for
    /// whole objects of ModelNet40), or street-128.safetensors for `live`, in weights/ beside this
    /// program, in ../share/edgepuck/weights from there or in ./assets/weights]
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,

    /// Accept a model with random weights, such as the bundled test model
    #[arg(long)]
    allow_untrained: bool,
}

impl ModelArgs {
    pub fn open(&self) -> anyhow::Result<(PathBuf, ModelCard)> {
        self.open_or(&NAMES)
    }

    /// Opens the model, with `names` as the file names of suitable bundled weights.
    pub fn open_or(&self, names: &[&str]) -> anyhow::Result<(PathBuf, ModelCard)> {
        let path = find_or(self.model.as_deref(), names)?;
        let card = ModelCard::read(&path)?;
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

/// The path of the model `named`, else of [`VARIABLE`], else of the bundled one.
pub fn find(named: Option<&Path>) -> Result<PathBuf, Usage> {
    find_or(named, &NAMES)
}

fn find_or(named: Option<&Path>, names: &[&str]) -> Result<PathBuf, Usage> {
    if let Some(path) = named {
        return Ok(path.to_path_buf());
    }
    if let Some(path) = env::var_os(VARIABLE).filter(|path| !path.is_empty()) {
        return Ok(path.into());
    }
    let folders = folders();
    let candidates = names.iter().flat_map(|name| folders.iter().map(move |f| f.join(name)));
    candidates.into_iter().find(|path| path.is_file()).ok_or_else(|| {
        let folders: Vec<_> = folders.iter().map(|folder| folder.display().to_string()).collect();
        Usage(format!(
            "found no model: name one by --model or ${VARIABLE}, or put {} into one of {}",
            names[0],
            folders.join(", ")
        ))
    })
}

/// The folders that may have the bundled weights.
fn folders() -> Vec<PathBuf> {
    let program = env::current_exe().ok();
    let beside = program.as_deref().and_then(Path::parent);
    // The layouts of an unpacked archive, and of a package installed under /usr.
    let places =
        beside.map(|beside| ["weights", "../share/edgepuck/weights"].map(|at| beside.join(at)));
    let mut folders: Vec<PathBuf> = places.into_iter().flatten().collect();
    folders.push(Path::new("assets").join("weights"));
    // A debug build also finds the weights of its workspace.
    #[cfg(debug_assertions)]
    folders.push(Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights"));
    folders
}
