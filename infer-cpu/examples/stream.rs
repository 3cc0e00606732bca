//! Classifies a stream of clouds by one classifier. Memory for the largest
//! cloud is allocated once, so that no frame allocates:
//!
//! ```text
//! cargo run --release -p infer-cpu --example stream
//! ```

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Options};

/// Points of the largest cloud that a sensor gives.
const CAPACITY: usize = 1024;

fn main() -> Result<(), Box<dyn Error>> {
    let weights = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights");
    // A program may embed the model instead: include_bytes!("edge-64.safetensors").
    let model = std::fs::read(weights.join("edge-64.safetensors"))?;
    let sampler = SamplerSpec { kind: SamplerKind::Fps, points: 64, ..SamplerSpec::default() };
    let options = Options { sampler: Some(sampler), capacity: CAPACITY, ..Options::default() };
    let mut classifier = Classifier::from_bytes(&model, &options)?;
    let mut cloud = Vec::with_capacity(CAPACITY);
    for frame in 0..10 {
        // A cylinder that grows from frame to frame stands in for a sensor.
        let height = 0.2 + 0.3 * frame as f32;
        let point = |i: usize| (i as f32 * 2.4, i as f32 / CAPACITY as f32 * height);
        cloud.clear();
        cloud.extend((0..CAPACITY).map(point).map(|(turn, z)| [turn.cos(), turn.sin(), z]));
        let start = Instant::now();
        let prediction = classifier.classify(&cloud)?;
        println!("frame {frame}: {} in {:.2?}", prediction.answer(), start.elapsed());
    }
    Ok(())
}
