//! The same logits as PyTorch, to 1e-5, at every number of points, threads and
//! kernel. The reference data is `../shared/data/parity`, where it is present.

#![expect(clippy::unwrap_used, reason = "tests")]

mod support;

use formats::model_card::Normalization;
use formats::weights::WeightsFile;
use infer_cpu::kernel;
use infer_cpu::{Classifier, Options, Precision};
use support::shared_data;

#[test]
fn the_baseline_gives_pytorch_s_log_probabilities() {
    let Some(folder) = shared_data("parity") else { return };
    let mut golden = WeightsFile::open(&folder.join("golden.safetensors")).unwrap();
    for kernel in kernel::available().map(|kernels| kernels.name) {
        for threads in [1, 2, 3] {
            let options = Options {
                kernel: Some(kernel),
                threads,
                normalization: Some(Normalization::None),
                ..Options::default()
            };
            let model = folder.join("pointnet.safetensors");
            let mut classifier = Classifier::load(&model, &options).unwrap();
            for n in [16, 64, 128, 1024] {
                let cloud = support::channels_first(&golden.read(&format!("x{n}")).unwrap());
                let expected = golden.read(&format!("logp{n}")).unwrap().values;
                let prediction = classifier.classify(&cloud).unwrap();
                for (class, expected) in expected.iter().enumerate() {
                    let found = prediction.log_probability(class);
                    let error = (found - f64::from(*expected)).abs();
                    assert!(error < 1e-5, "{kernel} {threads} {n}: {found} for {expected}");
                }
            }
        }
    }
}

#[test]
fn cheaper_precisions_stay_near() {
    let Some(folder) = shared_data("parity") else { return };
    let mut golden = WeightsFile::open(&folder.join("golden.safetensors")).unwrap();
    for precision in [Precision::F32Fc16, Precision::F16, Precision::I8] {
        let options =
            Options { precision, normalization: Some(Normalization::None), ..Options::default() };
        let model = folder.join("pointnet.safetensors");
        let mut classifier = Classifier::load(&model, &options).unwrap();
        for n in [16, 64, 128, 1024] {
            let cloud = support::channels_first(&golden.read(&format!("x{n}")).unwrap());
            let expected = golden.read(&format!("logp{n}")).unwrap().values;
            let prediction = classifier.classify(&cloud).unwrap();
            let error = expected.iter().enumerate().map(|(class, &expected)| {
                (prediction.log_probability(class) - f64::from(expected)).abs()
            });
            let error = error.fold(0.0, f64::max);
            eprintln!("{precision} {n}: {error:.2e}, clipped {}", prediction.n_clipped);
            assert!(error < 0.1, "{precision} {n}: {error}");
        }
    }
}
