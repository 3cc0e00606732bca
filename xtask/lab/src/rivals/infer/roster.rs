//! The engines of other projects.

use super::candidate::{Arithmetic, Candidate, Label};
use super::hosts::{Host, Material, command};
use super::server::Server;
use Arithmetic::{F32, Half, I8};
use std::cell::LazyCell;
use std::process::Command;

/// Another engine, or another arithmetic of one: its name in tables, for `--engines` and
/// for its program, what it computes with, and what runs it.
pub type Rival = (&'static str, Arithmetic, Host);

/// Engines that classify.
pub const CLASSIFIERS: [Rival; 13] = [
    ("onnxruntime", F32, Host::Python),
    ("openvino", F32, Host::Python),
    ("ncnn", F32, Host::Python),
    ("tract", F32, Host::Rust),
    ("rten", F32, Host::Rust),
    ("torch", F32, Host::Torch),
    ("torchscript", F32, Host::Torch),
    ("openvino-bf16", Half, Host::Python),
    ("ncnn-f16", Half, Host::Python),
    ("ncnn-bf16", Half, Host::Python),
    ("onnxruntime-i8", I8, Host::Python),
    ("openvino-i8", I8, Host::Python),
    ("ncnn-i8", I8, Host::Python),
];

/// Engines that sample farthest points.
pub const SAMPLERS: [Rival; 3] = [
    ("numpy", F32, Host::Sampling),
    ("fpsample", F32, Host::Sampling),
    ("fpsample-tree", F32, Host::Sampling),
];

/// Engines that train.
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

/// A candidate that `command` serves.
pub fn served(label: Label, command: &mut Command) -> anyhow::Result<Candidate> {
    let (server, version) = Server::start(command)?;
    Ok(Candidate { label, version, engine: Box::new(server) })
}
