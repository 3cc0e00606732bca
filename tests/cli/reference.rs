//! Compares the logits of weights from other repositories with those of PyTorch.
//!
//! The references are in `../shared/data/reference`, if it is present.

use crate::Folder;
use formats::labelled::{LabelledSet, read_labelled};
use infer_cpu::sampler::{FpsStart, SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Normalization, Options, Precision};
use ndarray::Array2;
use test_support::{need, shared_data};

fn imported(checkpoint: &str) -> Result<(LabelledSet, Folder), String> {
    let checkpoint = shared_data(&format!("checkpoints/{checkpoint}.pth"))?;
    let clouds = shared_data("modelnet40-clouds/dev.npz")?;
    let folder = Folder::new();
    folder.succeeds(&format!("import-weights {} --out m.safetensors", checkpoint.display()));
    Ok((read_labelled(&clouds).unwrap(), folder))
}

fn loaded(folder: &Folder, options: &Options) -> Classifier {
    Classifier::load(&folder.at("m.safetensors"), options).unwrap()
}

/// 64 points from the first by farthest point sampling, as that network was trained. 1020 of 1234
/// is 82.66 %.
#[test]
fn the_network_of_3dcertify_gives_its_reference_logits_and_accuracy() {
    let (set, folder) = need!(imported("3dcertify_64p_natural"));
    let reference = need!(shared_data("reference/3dcertify_64p/logits_fps64.npy"));
    let reference: Array2<f32> = ndarray_npy::read_npy(reference).unwrap();
    let sampler = SamplerSpec {
        kind: SamplerKind::Fps,
        points: 64,
        fps_start: FpsStart::First,
        ..SamplerSpec::default()
    };
    let options = Options {
        sampler: Some(sampler),
        // They are normalised, and rounded to 16 bits since.
        normalization: Some(Normalization::None),
        ..Options::default()
    };
    let mut classifier = loaded(&folder, &options);
    let mut right = 0;
    for (i, expected) in reference.rows().into_iter().enumerate() {
        let prediction = classifier.classify(set.cloud(i)).unwrap();
        right += usize::from(prediction.class == set.labels[i]);
        // Logits reach 45: f32 of other orders of summation differ by some 50 roundings of that, 50
        // * 45 / 2^24.
        for (found, expected) in prediction.logits.iter().zip(expected) {
            assert!((found - expected).abs() < 1.4e-4, "{i}: {found} for {expected}");
        }
    }
    assert_eq!((right, reference.nrows()), (1020, 1234));
}

#[test]
fn the_baseline_s_network_gives_its_reference_log_probabilities() {
    let (set, folder) = need!(imported("pointnet_cls_modelnet40"));
    let reference = need!(shared_data("reference/pointnet_cls/logp_1024.npy"));
    let reference: Array2<f32> = ndarray_npy::read_npy(reference).unwrap();
    let options = Options { normalization: Some(Normalization::None), ..Options::default() };
    let mut classifier = loaded(&folder, &options);
    for (i, expected) in reference.rows().into_iter().enumerate().step_by(12) {
        let prediction = classifier.classify(set.cloud(i)).unwrap();
        for (class, expected) in expected.iter().enumerate() {
            let found = prediction.log_probability(class);
            // Log-probabilities reach -60 and come from logits that reach 40.
            assert!((found - f64::from(*expected)).abs() < 1.4e-4, "{i}: {found} for {expected}");
        }
    }
}

/// fp16 and int8 cost a few clouds in a hundred at most: far more would be a fault, not rounding.
/// 95 % agreement of 300 clouds is six sigma from 90 %.
#[test]
fn cheaper_precisions_agree_with_fp32_on_trained_weights() {
    let (set, folder) = need!(imported("3dcertify_64p_natural"));
    let classes = |precision| {
        let options = Options { precision, ..Options::default() };
        let mut classifier = loaded(&folder, &options);
        let classes = (0..set.len()).step_by(4).map(|i| {
            let prediction = classifier.classify(set.cloud(i)).unwrap();
            assert_eq!(prediction.precision, precision);
            prediction.class
        });
        classes.collect::<Vec<_>>()
    };
    let reference = classes(Precision::F32);
    for precision in [Precision::F32Fc16, Precision::F16, Precision::I8] {
        let found = classes(precision);
        let same = found.iter().zip(&reference).filter(|(a, b)| a == b).count();
        eprintln!("{precision}: {same} of {} as f32", reference.len());
        assert!(same * 20 >= reference.len() * 19, "{precision}: {same}");
    }
}
