//! The engines of other projects.

use super::candidate::{Arithmetic, Candidate};
use super::hosts::{Host, Material, Program};
use super::server::Server;
use Arithmetic::{F32, Half, I8};
use std::cell::LazyCell;

/// Another engine, or another arithmetic of one.
#[derive(Clone, Copy, Debug)]
pub struct Rival {
    /// Its name in tables, for `--engines` and for its program.
    pub name: &'static str,
    /// What it computes with.
    pub arithmetic: Arithmetic,
    /// What runs it.
    pub host: Host,
}

const fn rival(name: &'static str, arithmetic: Arithmetic, host: Host) -> Rival {
    Rival { name, arithmetic, host }
}

/// Engines that classify.
pub const CLASSIFIERS: [Rival; 13] = [
    rival("onnxruntime", F32, Host::Python),
    rival("openvino", F32, Host::Python),
    rival("ncnn", F32, Host::Python),
    rival("tract", F32, Host::Rust),
    rival("rten", F32, Host::Rust),
    rival("torch", F32, Host::Torch),
    rival("torchscript", F32, Host::Torch),
    rival("openvino-bf16", Half, Host::Python),
    rival("ncnn-f16", Half, Host::Python),
    rival("ncnn-bf16", Half, Host::Python),
    rival("onnxruntime-i8", I8, Host::Python),
    rival("openvino-i8", I8, Host::Python),
    rival("ncnn-i8", I8, Host::Python),
];

/// Engines that sample farthest points.
pub const SAMPLERS: [Rival; 3] = [
    rival("numpy", F32, Host::Sampling),
    rival("fpsample", F32, Host::Sampling),
    rival("fpsample-tree", F32, Host::Sampling),
];

/// Starts those of `rivals` whose names are wanted, those in PyTorch only if `torch`. A
/// message names those that cannot be started, and the cause.
pub fn start(
    rivals: &[Rival],
    is_wanted: impl Fn(&str) -> bool,
    torch: bool,
    material: &Material,
) -> Vec<Candidate> {
    let may = |rival: &&Rival| is_wanted(rival.name) && (torch || rival.host != Host::Torch);
    let rivals: Vec<&Rival> = rivals.iter().filter(may).collect();
    let prepared = LazyCell::new(|| material.prepare());
    let mut candidates = Vec::new();
    for group in rivals.chunk_by(|a, b| a.host == b.host) {
        let host = group[0].host;
        let ready = if host.needs_preparing() { prepared.clone() } else { Ok(()) };
        match ready.and_then(|()| host.program(material)) {
            Ok(program) => candidates.extend(group.iter().filter_map(|r| candidate(r, &program))),
            Err(cause) => {
                let names: Vec<&str> = group.iter().map(|rival| rival.name).collect();
                println!("skipped {}: {cause}", names.join(", "));
            }
        }
    }
    candidates
}

fn candidate(rival: &Rival, program: &Program) -> Option<Candidate> {
    match Server::start(&mut program.of(rival.name)) {
        Ok(server) => Some(Candidate {
            name: rival.name.to_owned(),
            arithmetic: rival.arithmetic,
            ours: false,
            version: server.version.clone(),
            engine: Box::new(server),
        }),
        Err(cause) => {
            println!("skipped {}: {cause:#}", rival.name);
            None
        }
    }
}
