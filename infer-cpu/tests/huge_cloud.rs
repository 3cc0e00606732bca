//! Ten million points, thinned by the samplers that take them in one look.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "support/tiny_model.rs"]
mod tiny_model;

use formats::model_card::ModelCard;
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Options};

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
