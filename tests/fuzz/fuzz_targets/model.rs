//! Any bytes are an error or a model that can be loaded, packed and run: neither
//! its header nor its card nor its weights make the reader panic, hang or take
//! memory that the file does not justify.
//!
//! Where the first byte is odd, the rest is the file. Where it is even, the rest is a
//! header, to which the length before it and as many values as it promises are
//! added: few mutations of a whole file leave these right.

#![no_main]

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use infer_cpu::{Classifier, Options, Precision};
use libfuzzer_sys::fuzz_target;

const MOST_VALUES: usize = 1 << 18;

/// One file a process, in memory where the system has such a folder.
static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = PathBuf::from("/dev/shm");
    let folder = if memory.is_dir() { memory } else { std::env::temp_dir() };
    folder.join(format!("edgepuck-fuzz-{}.safetensors", std::process::id()))
});

fuzz_target!(|bytes: &[u8]| {
    let Some((choice, content)) = bytes.split_first() else { return };
    let file = if choice % 2 == 1 { content.to_vec() } else { completed(content, *choice) };
    if fs::write(&*FILE, file).is_err() {
        return;
    }
    let precision = Precision::ALL[usize::from(choice / 2) % Precision::ALL.len()];
    let options = Options { precision, capacity: 16, ..Options::default() };
    let Ok(mut classifier) = Classifier::load(&FILE, &options) else { return };
    let cloud = [[0.0, 0.0, 0.1], [0.3, 0.0, 0.1], [0.3, 0.2, 0.0], [-0.1, 0.5, 0.2]];
    if let Ok(prediction) = classifier.classify(&cloud) {
        assert!(prediction.logits.iter().all(|logit| logit.is_finite()));
        assert!(prediction.class < classifier.classes().len());
    }
});

/// `header` as a file: its length before it, values by rule behind it.
fn completed(header: &[u8], seed: u8) -> Vec<u8> {
    let mut file = (header.len() as u64).to_le_bytes().to_vec();
    file.extend(header);
    let promised = serde_json::from_slice::<safetensors::tensor::Metadata>(header)
        .map_or(0, |metadata| metadata.data_len());
    let value = |i: usize| ((i * 37 + usize::from(seed)) % 64) as f32 / 64.0 - 0.5;
    let values =
        (0..promised.min(4 * MOST_VALUES).div_ceil(4)).flat_map(|i| value(i).to_le_bytes());
    file.extend(values.take(promised));
    file
}
