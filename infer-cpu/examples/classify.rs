//! Prints the class of a cloud, by the model of a file or by the bundled one of ModelNet40:
//!
//! ```text
//! cargo run --release -p infer-cpu --example classify -- chair.ply [model.safetensors]
//! ```

use std::error::Error;
use std::path::{Path, PathBuf};

use infer_cpu::{Classifier, Options, read_cloud};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let cloud = arguments.next().ok_or("expected the path of a cloud")?;
    let bundled =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights/edge-64.safetensors");
    let model = arguments.next().unwrap_or(bundled);

    let mut classifier = Classifier::load(&model, &Options::default())?;
    let prediction = classifier.classify_f64(&read_cloud(&cloud)?)?;
    println!("{} ({:.1} %)", prediction.answer(), 100.0 * prediction.confidence());
    Ok(())
}
