//! The classifier as a library: loaded from a file or from memory, for clouds of any size.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "support/tiny_model.rs"]
mod tiny_model;

use formats::model_card::{ModelCard, Normalization};
use infer_cpu::kernel;
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, ClassifierTeam, Error, Options, Precision};
use test_support::IS_EMULATED;

fn model(folder: &std::path::Path, card: &ModelCard) -> std::path::PathBuf {
    tiny_model::write(&folder.join("m.safetensors"), &tiny_model::tensors(4), card)
}

#[test]
fn ten_million_points_are_classified() {
    // An emulator gets a tenth of the points.
    const N: usize = if IS_EMULATED { 1_000_000 } else { 10_000_000 };
    let folder = tempfile::tempdir().unwrap();
    let model = model(folder.path(), &ModelCard::default());
    // Weyl sequences of three irrational steps are evenly spread and distinct.
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
    let model = model(folder.path(), &ModelCard::default());
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

#[test]
fn a_team_answers_as_a_classifier_does_for_each_cloud() {
    let folder = tempfile::tempdir().unwrap();
    let model = overflowing_model(folder.path());
    let clouds: Vec<Vec<[f32; 3]>> = (0..30).map(|n| cloud()[..2 * n].to_vec()).collect();
    let with_ground = || clouds.iter().map(|cloud| (&cloud[..], Some(-1.0)));
    for precision in Precision::ALL {
        let options = |threads| Options { precision, threads, ..Options::default() };
        let mut alone = Classifier::load(&model, &options(1)).unwrap();
        let expected: Vec<_> = with_ground()
            .map(|(points, ground_z)| {
                let answer = alone.classify_on_ground(points, ground_z);
                answer
                    .map(|p| (p.logits.clone(), p.precision, p.n_points))
                    .map_err(|e| e.to_string())
            })
            .collect();
        assert_eq!(expected[0], Err(Error::NoPoints.to_string()));
        for threads in [1, 4] {
            let classifier = Classifier::load(&model, &options(threads)).unwrap();
            let mut team = ClassifierTeam::new(classifier).unwrap();
            for _ in 0..2 {
                let mut found = Vec::new();
                team.classify_many(with_ground(), |answer| {
                    found.push(
                        answer
                            .map(|p| (p.logits.clone(), p.precision, p.n_points))
                            .map_err(ToString::to_string),
                    );
                });
                assert_eq!(found, expected, "{precision}, {threads} threads");
            }
        }
    }
}

fn filtering_model(folder: &std::path::Path) -> std::path::PathBuf {
    let card = ModelCard {
        outlier_filter: true,
        sampler: Some("fps".to_owned()),
        points: Some(20),
        ..ModelCard::default()
    };
    model(folder, &card)
}

fn cloud_with_stray() -> Vec<[f32; 3]> {
    [vec![[90.0, -40.0, 30.0]], cloud()].concat()
}

#[test]
fn a_stray_changes_no_bit_of_a_model_that_filters_outliers() {
    let folder = tempfile::tempdir().unwrap();
    let model = filtering_model(folder.path());
    for kernels in kernel::available() {
        for threads in [1, 3] {
            let options = Options { kernel: Some(kernels.name), threads, ..Options::default() };
            let mut classifier = Classifier::load(&model, &options).unwrap();
            let alone = classifier.classify(&cloud()).unwrap().clone();
            assert_eq!((alone.n_points, alone.n_outliers), (60, 0));
            let found = classifier.classify(&cloud_with_stray()).unwrap();
            assert_eq!((found.n_points, found.n_outliers), (61, 1));
            assert_eq!(found.logits, alone.logits, "{} and {threads} threads", kernels.name);
            // The option overrides the card.
            let off = Options { outlier_filter: Some(false), ..options };
            let mut plain = Classifier::load(&model, &off).unwrap();
            assert_eq!(plain.classify(&cloud()).unwrap().logits, alone.logits);
            assert_ne!(plain.classify(&cloud_with_stray()).unwrap().logits, alone.logits);
        }
    }
}

#[test]
fn sampled_places_are_those_of_the_cloud_with_its_outliers() {
    let folder = tempfile::tempdir().unwrap();
    let mut classifier =
        Classifier::load(&filtering_model(folder.path()), &Options::default()).unwrap();
    let in_f64 = |cloud: Vec<[f32; 3]>| cloud.iter().map(|p| p.map(f64::from)).collect::<Vec<_>>();
    let expected: Vec<u32> =
        classifier.sample(&in_f64(cloud())).unwrap().iter().map(|place| place + 1).collect();
    assert_eq!(classifier.sample(&in_f64(cloud_with_stray())).unwrap(), expected);
}

#[test]
fn the_outlier_filter_is_for_clouds_in_the_unit_sphere() {
    let folder = tempfile::tempdir().unwrap();
    let model = filtering_model(folder.path());
    let metric = Options { normalization: Some(Normalization::Metric), ..Options::default() };
    let mut classifier = Classifier::load(&model, &metric).unwrap();
    assert_eq!(classifier.classify(&cloud_with_stray()).unwrap().n_outliers, 0);
    let asked = Options { outlier_filter: Some(true), ..metric };
    let error = Classifier::load(&model, &asked).err().unwrap();
    let expected = "expected clouds normalised to unit-sphere for the outlier filter, found metric";
    assert_eq!(error.to_string(), expected);
}
