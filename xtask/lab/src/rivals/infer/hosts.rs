//! The programs that run rivals, and the files that they need.

use std::path::PathBuf;
use std::process::Command;
use xtask::venv::{Environment, cache_dir, programs, succeeds};

const GENERAL: Environment<'_> = Environment {
    name: "infer-venv",
    requirements: "xtask/lab/peers/infer/requirements.txt",
    size: "about 150 MB",
};

const TORCH: Environment<'_> = Environment {
    name: "torch-venv",
    requirements: "xtask/lab/peers/infer/torch-requirements.txt",
    size: "about 5 GB",
};

/// What runs a rival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Host {
    /// `peers/infer/infer.py`.
    Python,
    /// The same, in the environment that holds PyTorch.
    Torch,
    /// `peers/train/train.py`, in that environment.
    Training,
    /// `peers/infer/fps.py`.
    Sampling,
    /// The package `peers/engines`.
    Rust,
}

/// The input of all rivals.
pub struct Material {
    /// The weights.
    pub model: PathBuf,
    /// The folder with the cloud, and the model in every form.
    pub folder: PathBuf,
}

/// The words before an engine's name on a command line, and the words after it.
pub type Program = [Vec<PathBuf>; 2];

impl Material {
    /// The file of the cloud.
    pub fn cloud(&self) -> PathBuf {
        self.folder.join("cloud.safetensors")
    }

    /// Writes the model in every form. An error is the cause, for the user.
    pub fn prepare(&self) -> Result<(), String> {
        let mut command = command(&python(&GENERAL, "infer/prepare.py")?);
        succeeds(command.arg(&self.model).arg(self.cloud()).arg(&self.folder))
    }
}

impl Host {
    /// Whether it runs what [`Material::prepare`] writes.
    pub fn needs_preparing(self) -> bool {
        matches!(self, Self::Python | Self::Rust)
    }

    /// Whether it runs PyTorch.
    pub fn is_torch(self) -> bool {
        matches!(self, Self::Torch | Self::Training)
    }

    /// Its program, installed or built if need be. An error is the cause, for the user.
    pub fn program(self, material: &Material) -> Result<Program, String> {
        let Material { model, folder } = material;
        let (model, folder) = (model.clone(), folder.clone());
        Ok(match self {
            Self::Python => [python(&GENERAL, "infer/infer.py")?, vec![model, folder]],
            Self::Torch => [python(&TORCH, "infer/infer.py")?, vec![model, folder]],
            Self::Training => [python(&TORCH, "train/train.py")?, vec![model, folder]],
            Self::Sampling => [python(&GENERAL, "infer/fps.py")?, vec![folder]],
            Self::Rust => [vec![build()?], vec![folder]],
        })
    }
}

/// The interpreter, which writes no compiled files beside its programs, and the script.
fn python(environment: &Environment<'_>, script: &str) -> Result<Vec<PathBuf>, String> {
    Ok(vec![environment.interpreter()?, "-B".into(), programs().join(script)])
}

/// The command of these words.
pub fn command(words: &[PathBuf]) -> Command {
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]);
    command
}

/// Builds the Rust engines; cargo knows whether there is anything to do.
fn build() -> Result<PathBuf, String> {
    let folder = cache_dir().join("engines");
    if !folder.exists() {
        eprintln!("building {} (some minutes)", folder.display());
    }
    let manifest = programs().join("engines/Cargo.toml");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--release", "--locked", "--manifest-path"]).arg(manifest);
    succeeds(cargo.arg("--target-dir").arg(&folder))?;
    Ok(folder.join("release").join(format!("engines{}", std::env::consts::EXE_SUFFIX)))
}
