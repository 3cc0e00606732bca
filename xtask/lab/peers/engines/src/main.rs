//! One inference engine, for `cargo xtask bench infer`:
//!
//! ```text
//! engines ENGINE FOLDER
//! ```
//!
//! FOLDER holds what `peers/infer/prepare.py` made of a model, and
//! cloud.safetensors: a cloud of N points is the first N of its `points`.
//! The protocol is that of `peers/infer/turns.py`.

mod rten_engine;
mod tract_engine;
mod turns;

use anyhow::{Result, bail};
use formats::weights::WeightsFile;
use std::path::Path;
use turns::Engine;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, folder] = &arguments[..] else { bail!("usage: engines ENGINE FOLDER") };
    turns::serve(start(name, Path::new(folder)))
}

fn start(name: &str, folder: &Path) -> Result<Engine> {
    let (version, ready): (_, turns::Ready) = match name {
        "tract" => (tract_engine::VERSION, tract_engine::ready),
        "rten" => (rten_engine::VERSION, rten_engine::ready),
        _ => bail!("no such engine: {name}"),
    };
    let points = WeightsFile::open(&folder.join("cloud.safetensors"))?.read("points")?.values;
    // Engines differ in which form of the model they run fast.
    let files = ["image.onnx", "rows.onnx"].map(|file| folder.join(file)).into();
    Ok(Engine { version, ready, files, points, run: None })
}
