//! A classifier as a library's user has it: from a file or from memory, without
//! a file while it works, and for clouds of any size.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "support/tiny_model.rs"]
mod tiny_model;

use formats::model_card::ModelCard;
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Error, Options, Precision};

#[test]
fn ten_million_points_are_classified() {
    const N: usize = 10_000_000;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.safetensors");
    let model = tiny_model::write(&path, &tiny_model::tensors(4), &ModelCard::default());
    // Weyl sequences of three irrational steps: spread evenly, and distinct.
    let at = |i: usize, step: f64| (i as f64 * step).fract() as f32;
    let cloud: Vec<[f32; 3]> =
        (0..N).map(|i| [at(i, 0.819_172_5), at(i, 0.671_043_6), at(i, 0.549_700_4)]).collect();
    for kind in [SamplerKind::Random, SamplerKind::Voxel] {
        let spec = SamplerSpec { kind, points: 512, ..SamplerSpec::default() };
        let options = Options { sampler: Some(spec), ..Options::default() };
        let mut classifier = Classifier::load(&model, &options).unwrap();
        let prediction = classifier.classify(&cloud).unwrap();
        assert_eq!(prediction.n_points, N, "{kind}");
        assert!((256..=512).contains(&prediction.n_used), "{kind}: {}", prediction.n_used);
    }
}

fn cloud() -> Vec<[f32; 3]> {
    let point = |i: u8| [f32::from(i % 7), f32::from(i % 5) * 0.3, f32::from(i) * 0.02];
    (0..60).map(point).collect()
}

/// A model whose trunk leaves the range of fp16, but not that of fp32.
fn overflowing_model(folder: &std::path::Path) -> std::path::PathBuf {
    let mut tensors = tiny_model::tensors(4);
    tiny_model::scale(&mut tensors, "feat.conv1.weight", 1e6);
    tiny_model::scale(&mut tensors, "feat.conv2.weight", 1e-6);
    tiny_model::write(&folder.join("m.safetensors"), &tensors, &ModelCard::default())
}

#[test]
fn bytes_are_as_good_as_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.safetensors");
    let model = tiny_model::write(&path, &tiny_model::tensors(4), &ModelCard::default());
    let bytes = std::fs::read(&model).unwrap();
    for precision in Precision::ALL {
        let options = Options { precision, ..Options::default() };
        let mut of_file = Classifier::load(&model, &options).unwrap();
        let mut of_bytes = Classifier::from_bytes(&bytes, &options).unwrap();
        let expected = of_file.classify(&cloud()).unwrap().logits.clone();
        assert_eq!(of_bytes.classify(&cloud()).unwrap().logits, expected, "{precision}");
    }
    let error = Classifier::from_bytes(&bytes[..100], &Options::default()).err().unwrap();
    assert!(error.to_string().starts_with("model in memory: header: "), "{error}");
}

#[test]
fn a_precision_that_overflows_falls_back_to_fp32_when_the_file_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let model = overflowing_model(folder.path());
    let mut exact = Classifier::load(&model, &Options::default()).unwrap();
    let expected = exact.classify(&cloud()).unwrap().logits.clone();
    let options = Options { precision: Precision::F16, ..Options::default() };
    let mut classifier = Classifier::load(&model, &options).unwrap();
    std::fs::remove_file(&model).unwrap();
    let prediction = classifier.classify(&cloud()).unwrap();
    assert_eq!(prediction.precision, Precision::F32);
    assert_eq!(prediction.logits, expected);
    assert!(matches!(Classifier::load(&model, &options), Err(Error::Format(_))));
}
