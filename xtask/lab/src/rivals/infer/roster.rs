//! The engines of other projects, the programs that run them, and the files that they need.

use super::candidate::{Arithmetic, Candidate, Label, Server};
use Arithmetic::{F32, Half, I8};
use std::cell::LazyCell;
use std::path::PathBuf;
use std::process::Command;
use xtask::venv::{Environment, programs, succeeds};

/// Another engine, or another arithmetic of one: its name in tables, for `--engines` and for its
/// program, its arithmetic, and its program.
pub type Rival = (&'static str, Arithmetic, Host);

pub const CLASSIFIERS: [Rival; 11] = [
    ("onnxruntime", F32, Host::Python),
    ("openvino", F32, Host::Python),
    ("ncnn", F32, Host::Python),
    ("torch", F32, Host::Torch),
    ("torchscript", F32, Host::Torch),
    ("openvino-bf16", Half, Host::Python),
    ("ncnn-f16", Half, Host::Python),
    ("ncnn-bf16", Half, Host::Python),
    ("onnxruntime-i8", I8, Host::Python),
    ("openvino-i8", I8, Host::Python),
    ("ncnn-i8", I8, Host::Python),
];

pub const SAMPLERS: [Rival; 3] = [
    ("numpy", F32, Host::Sampling),
    ("fpsample", F32, Host::Sampling),
    ("fpsample-tree", F32, Host::Sampling),
];

pub const TRAINERS: [Rival; 1] = [("torch", F32, Host::Training)];

/// Starts those of `rivals` whose names are wanted, those in PyTorch only if `torch`. A
/// message names those that cannot be started, and the cause.
pub fn start(
    rivals: &[Rival],
    is_wanted: impl Fn(&str) -> bool,
    torch: bool,
    material: &Material,
) -> Vec<Candidate> {
    let may = |(name, _, host): &&Rival| is_wanted(name) && (torch || !host.is_torch());
    let rivals: Vec<&Rival> = rivals.iter().filter(may).collect();
    let prepared = LazyCell::new(|| material.prepare());
    let mut candidates = Vec::new();
    for group in rivals.chunk_by(|a, b| a.2 == b.2) {
        let host = group[0].2;
        let ready = if host.needs_preparing() { prepared.clone() } else { Ok(()) };
        let [words, arguments] = match ready.and_then(|()| host.program(material)) {
            Ok(program) => program,
            Err(cause) => {
                let names: Vec<&str> = group.iter().map(|rival| rival.0).collect();
                println!("skipped {}: {cause}", names.join(", "));
                continue;
            }
        };
        for &&(name, arithmetic, _) in group {
            let label = Label { name: name.to_owned(), arithmetic, ours: false };
            match served(label, command(&words).arg(name).args(&arguments)) {
                Ok(candidate) => candidates.push(candidate),
                Err(cause) => println!("skipped {name}: {cause:#}"),
            }
        }
    }
    candidates
}

pub fn served(label: Label, command: &mut Command) -> anyhow::Result<Candidate> {
    let (server, version) = Server::start(command)?;
    Ok(Candidate { label, version, engine: Box::new(server) })
}

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
}

pub struct Material {
    pub model: PathBuf,
    /// The folder with the cloud, and the model in every form.
    pub folder: PathBuf,
}

/// The words before an engine's name on a command line, and the words after it.
pub type Program = [Vec<PathBuf>; 2];

impl Material {
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
        self == Self::Python
    }

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
        })
    }
}

/// The interpreter, which writes no compiled files beside its programs, and the script.
fn python(environment: &Environment<'_>, script: &str) -> Result<Vec<PathBuf>, String> {
    Ok(vec![environment.interpreter()?, "-B".into(), programs().join(script)])
}

pub fn command(words: &[PathBuf]) -> Command {
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]);
    command
}
