//! The classifier as a library: loaded from a file or from memory, for clouds of any size.

use crate::tiny_model;
use formats::model_card::ModelCard;
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
    // None begins at 0: a point at the origin is a lost return.
    let at = |i: usize, step: f64| ((i as f64 + 0.5) * step).fract() as f32;
    let cloud: Vec<[f32; 3]> =
        (0..N).map(|i| [at(i, 0.819_172_5), at(i, 0.671_043_6), at(i, 0.549_700_4)]).collect();
    let spec = SamplerSpec { kind: SamplerKind::Random, points: 512, ..SamplerSpec::default() };
    let options = Options { sampler: Some(spec), ..Options::default() };
    let mut classifier = Classifier::load(&model, &options).unwrap();
    let prediction = classifier.classify(&cloud).unwrap();
    assert_eq!((prediction.n_points, prediction.n_used), (N, 512));
}

fn cloud() -> Vec<[f32; 3]> {
    let point = |i: u8| [f32::from(i % 7), f32::from(i % 5) * 0.3, f32::from(i) * 0.02];
    (0..60).map(point).collect()
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
fn a_team_answers_as_a_classifier_does_for_each_cloud() {
    let folder = tempfile::tempdir().unwrap();
    let model = model(folder.path(), &ModelCard::default());
    let clouds: Vec<Vec<[f32; 3]>> = (0..30).map(|n| cloud()[..2 * n].to_vec()).collect();
    let with_ground = || clouds.iter().map(|cloud| (&cloud[..], Some(-1.0)));
    for precision in Precision::ALL {
        let options = |threads| Options { precision, threads, ..Options::default() };
        let mut alone = Classifier::load(&model, &options(1)).unwrap();
        let expected: Vec<_> = with_ground()
            .map(|(points, ground_z)| {
                let answer = alone.classify_on_ground(points, ground_z);
                answer.map(|p| (p.logits.clone(), p.n_points)).map_err(|e| e.to_string())
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
                        answer.map(|p| (p.logits.clone(), p.n_points)).map_err(ToString::to_string),
                    );
                });
                assert_eq!(found, expected, "{precision}, {threads} threads");
            }
        }
    }
}

/// Of the four corners and the middle of a square the first point is the farthest from the mean, of equal ones
/// the least; then follow the opposite corner and the lesser of the other two. The squares of a cloud of
/// 1e-310 m are 0, but it is first scaled by a power of two: its ends are kept, and its middle is not.
#[test]
fn the_farthest_points_are_chosen_of_a_tie_and_of_a_subnormal_cloud() {
    let square = [[0.0; 3], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]];
    let subnormal = [[0.0; 3], [1e-310, 0.0, 0.0], [-1e-310, 0.0, 0.0]];
    for (cloud, kept) in [(&square[..], &[4, 1, 3][..]), (&subnormal, &[2, 1])] {
        let spec =
            SamplerSpec { kind: SamplerKind::Fps, points: kept.len(), ..SamplerSpec::default() };
        assert_eq!(infer_cpu::choose(cloud, &spec).unwrap(), kept);
    }
}
