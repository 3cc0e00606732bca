//! The programs that run rivals, and the files that they need.

use std::path::{Path, PathBuf};
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
    size: "about 3 GB",
};

/// Keeps Python from writing compiled files beside its programs.
const NO_CACHE: &str = "-B";

/// What runs a rival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Host {
    /// `peers/infer/infer.py`.
    Python,
    /// The same, in the environment that holds PyTorch.
    Torch,
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

/// An installed program, and its arguments after the engine's name.
pub struct Program {
    words: Vec<PathBuf>,
    arguments: Vec<PathBuf>,
}

impl Material {
    /// The file of the cloud.
    pub fn cloud(&self) -> PathBuf {
        self.folder.join("cloud.safetensors")
    }

    /// Writes the model in every form.
    ///
    /// # Errors
    /// The cause, for the user.
    pub fn prepare(&self) -> Result<(), String> {
        let mut command = Command::new(GENERAL.interpreter()?);
        command.arg(NO_CACHE).arg(programs().join("infer/prepare.py"));
        succeeds(command.arg(&self.model).arg(self.cloud()).arg(&self.folder))
    }
}

impl Host {
    /// Whether it runs what [`Material::prepare`] writes.
    pub fn needs_preparing(self) -> bool {
        matches!(self, Self::Python | Self::Rust)
    }

    /// Its program, installed or built if need be.
    ///
    /// # Errors
    /// The cause, for the user.
    pub fn program(self, material: &Material) -> Result<Program, String> {
        let python = |environment: Environment, script: &str, arguments: &[&PathBuf]| {
            let words = vec![environment.interpreter()?, NO_CACHE.into(), programs().join(script)];
            let arguments = arguments.iter().map(|&path| path.clone()).collect();
            Ok(Program { words, arguments })
        };
        let Material { model, folder } = material;
        match self {
            Self::Python => python(GENERAL, "infer/infer.py", &[model, folder]),
            Self::Torch => python(TORCH, "infer/infer.py", &[model, folder]),
            Self::Sampling => python(GENERAL, "infer/fps.py", &[folder]),
            Self::Rust => Ok(Program { words: vec![build()?], arguments: vec![folder.clone()] }),
        }
    }
}

/// The command that trains in PyTorch, beginning with `model`, on the clouds in
/// `folder`.
///
/// # Errors
/// The cause, for the user.
pub fn trainer(model: &Path, folder: &Path) -> Result<Command, String> {
    let mut command = Command::new(TORCH.interpreter()?);
    command.arg(NO_CACHE).arg(programs().join("train/train.py")).arg("torch");
    command.arg(model).arg(folder);
    Ok(command)
}

impl Program {
    /// The command that runs `engine`.
    pub fn of(&self, engine: &str) -> Command {
        let mut command = Command::new(&self.words[0]);
        command.args(&self.words[1..]).arg(engine).args(&self.arguments);
        command
    }
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
