//! Classifies the clouds in some files by the bundled model of ModelNet40:
//!
//! ```text
//! cargo run --release -p infer-cpu --example classify -- chair.ply scan.npz
//! ```

use std::error::Error;
use std::path::Path;

use formats::cloud_file::read_cloud;
use infer_cpu::{Classifier, Options};

fn main() -> Result<(), Box<dyn Error>> {
    let weights = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights");
    let options = Options { threads: 2, drop_invalid: true, ..Options::default() };
    let mut classifier = Classifier::load(&weights.join("edge-64.safetensors"), &options)?;
    for file in std::env::args_os().skip(1) {
        let cloud = read_cloud(Path::new(&file))?;
        let prediction = classifier.classify_f64(&cloud)?;
        let percent = 100.0 * prediction.confidence();
        println!("{}: {} ({percent:.1} %)", file.display(), prediction.answer());
    }
    Ok(())
}
