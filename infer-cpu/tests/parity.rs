//! Compares logits with PyTorch's: they agree to 1e-5 for all numbers of points and threads and all
//! kernels. The reference data is `../shared/data/parity`, if present.

use crate::tiny_model;
use std::path::Path;

use formats::model_card::Normalization;
use formats::weights::{Tensor, WeightsFile};
use infer_cpu::kernel::{self, KernelName};
use infer_cpu::{Classifier, Options, Precision};
use test_support::{IS_EMULATED, need, shared_data};

/// The points of a tensor `[1, 3, n]`.
fn channels_first(tensor: &Tensor) -> Vec<[f32; 3]> {
    let n = tensor.shape[2];
    (0..n).map(|i| [0, 1, 2].map(|axis| tensor.values[axis * n + i])).collect()
}

const SIZES: [usize; 4] = [16, 64, 128, 1024];

/// The largest errors of log-probabilities against PyTorch's, for golden clouds of up to `largest`
/// points; an error if the shared data are missing.
fn errors(options: Options, largest: usize) -> Result<Vec<(usize, f64)>, String> {
    let folder = shared_data("parity")?;
    let mut golden = WeightsFile::open(&folder.join("golden.safetensors")).unwrap();
    let options = Options { normalization: Some(Normalization::None), ..options };
    let mut classifier = Classifier::load(&folder.join("pointnet.safetensors"), &options).unwrap();
    let error = |n: usize| {
        let cloud = channels_first(&golden.read(&format!("x{n}")).unwrap());
        let expected = golden.read(&format!("logp{n}")).unwrap().values;
        let prediction = classifier.classify(&cloud).unwrap();
        let errors = expected.iter().enumerate().map(|(class, &expected)| {
            (prediction.log_probability(class) - f64::from(expected)).abs()
        });
        (n, errors.fold(0.0, f64::max))
    };
    Ok(SIZES.into_iter().filter(|&n| n <= largest).map(error).collect())
}

#[test]
fn the_baseline_gives_pytorch_s_log_probabilities() {
    for kernel in kernel::available().map(|kernels| kernels.name) {
        if IS_EMULATED && kernel == KernelName::Scalar {
            continue;
        }
        for threads in [1, 3] {
            let options = Options { kernel: Some(kernel), threads, ..Options::default() };
            // An emulator gets the largest cloud once for each kernel.
            let largest = if IS_EMULATED && threads == 1 { 128 } else { 1024 };
            for (n, error) in need!(errors(options, largest)) {
                assert!(error < 1e-5, "{kernel} {threads} {n}: {error}");
            }
        }
    }
}

#[test]
fn int8_stays_near() {
    let largest = if IS_EMULATED { 128 } else { 1024 };
    let options = Options { precision: Precision::I8, ..Options::default() };
    for (n, error) in need!(errors(options, largest)) {
        assert!(error < 0.1, "{n}: {error}");
    }
}

/// Point `i` of the golden clouds, exact in f32.
fn golden_point(i: usize) -> [f32; 3] {
    let axis = |a: usize, b: usize, m: usize| ((i * a + b) % m) as f32 / (m as f32 / 2.0) - 1.0;
    [axis(73, 11, 1024), axis(149, 5, 2048), axis(331, 77, 512)]
}

/// `golden/make.py` creates the golden files with PyTorch. Logits are near 1, where an error of
/// 1e-5 is about 80 roundings of f32.
#[test]
fn narrow_networks_give_pytorch_s_logits_with_and_without_t_nets() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    for name in ["tiny", "plain"] {
        let mut golden =
            WeightsFile::open(&folder.join(format!("{name}_logits.safetensors"))).unwrap();
        let expected = golden.read("logits").unwrap();
        let sizes = golden.read("sizes").unwrap().values;
        for kernel in kernel::available().map(|kernels| kernels.name) {
            if IS_EMULATED && kernel == KernelName::Scalar {
                continue;
            }
            let teams: &[usize] = if IS_EMULATED { &[4] } else { &[1, 2, 4] };
            for &threads in teams {
                let options = Options { kernel: Some(kernel), threads, ..Options::default() };
                let model = folder.join(format!("{name}.safetensors"));
                let mut classifier = Classifier::load(&model, &options).unwrap();
                let width = expected.shape[1];
                for (&n, expected) in sizes.iter().zip(expected.values.chunks_exact(width)) {
                    let cloud: Vec<_> = (0..n as usize).map(golden_point).collect();
                    let prediction = classifier.classify(&cloud).unwrap();
                    for (found, expected) in prediction.logits.iter().zip(expected) {
                        let error = (found - expected).abs();
                        assert!(error < 1e-5, "{name} {kernel} {threads} {n}: {error}");
                    }
                }
            }
        }
    }
}

/// Logits are equal to the bit for any number of threads.
#[test]
fn threads_change_nothing() {
    let tiny = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/tiny.safetensors");
    let folder = tempfile::tempdir().unwrap();
    let (card, tensors) = tiny_model::sets(4);
    let sets = tiny_model::write(&folder.path().join("sets.safetensors"), &tensors, &card);
    threads_change_nothing_of(&tiny);
    threads_change_nothing_of(&sets);
}

fn threads_change_nothing_of(model: &Path) {
    // The division of work does not depend on the processor, so that an emulator tests fewer teams.
    let teams: &[usize] = if IS_EMULATED { &[1, 3] } else { &[1, 2, 3, 8] };
    for precision in Precision::ALL {
        for n in [1, 49, 1057, 3000] {
            let cloud: Vec<_> = (0..n).map(golden_point).collect();
            let logits = teams.iter().map(|&threads| {
                let options = Options { precision, threads, ..Options::default() };
                let mut classifier = Classifier::load(model, &options).unwrap();
                classifier.classify(&cloud).unwrap().logits.clone()
            });
            let logits: Vec<_> = logits.collect();
            assert!(logits.iter().all(|other| *other == logits[0]), "{precision} {n}");
        }
    }
}

/// Set abstractions in each precision and by each kernel, against those of the reference in fp32,
/// for clouds in either order.
#[test]
fn set_abstractions_agree_in_all_precisions() {
    let folder = tempfile::tempdir().unwrap();
    let (card, tensors) = tiny_model::sets(4);
    let model = tiny_model::write(&folder.path().join("sets.safetensors"), &tensors, &card);
    let logits = |kernel, precision, cloud: &[[f32; 3]]| {
        let options = Options { kernel: Some(kernel), precision, ..Options::default() };
        let mut classifier = Classifier::load(&model, &options).unwrap();
        classifier.classify(cloud).unwrap().logits.clone()
    };
    for n in [1, 70, 1024] {
        let mut cloud: Vec<_> = (0..n).map(golden_point).collect();
        let expected = logits(KernelName::Scalar, Precision::F32, &cloud);
        let largest = expected.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        cloud.reverse();
        for kernels in kernel::available() {
            for (precision, tolerance) in [
                // Eight layers of sums of up to 180 products, whose roundings to 6e-8 add at random:
                // five times sqrt(8 * 180) * 6e-8.
                (Precision::F32, 1e-5),
                // Weights and activations of eight layers, rounded by up to 1/254: 16 / 254 and what is
                // clipped. Ranges were calibrated on clouds of many points, which clips those of one.
                (Precision::I8, if n > 1 { 0.1 } else { 0.25 }),
            ] {
                if !precision.runs_on(kernels) {
                    continue;
                }
                let (kernel, found) = (kernels.name, logits(kernels.name, precision, &cloud));
                for (found, expected) in found.iter().zip(&expected) {
                    let error = (found - expected).abs() / largest;
                    assert!(error < tolerance, "{kernel} {precision} {n}: {error}");
                }
            }
        }
    }
}
