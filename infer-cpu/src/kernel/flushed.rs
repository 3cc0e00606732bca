//! What a caller's thread does with subnormal numbers must not show in a class:
//! the promise of the module above, on a processor that flushes them to 0 and on
//! one that does not.

#![expect(clippy::unwrap_used, reason = "tests")]

use std::path::Path;

use formats::model_card::ModelCard;

use crate::kernel;
use crate::precision::Precision;
use crate::{Classifier, Options};

#[path = "../../tests/support/tiny_model.rs"]
mod tiny_model;

/// Runs `work` on this thread while its arithmetic flushes subnormal numbers, taken
/// and given, to 0.
fn flushed<T>(work: impl FnOnce() -> T) -> T {
    let before = mode();
    set_mode(before | FLUSH);
    let result = work();
    set_mode(before);
    result
}

/// Bits 15 (flush to zero) and 6 (denormals are zeros) of MXCSR: Intel's manual,
/// volume 1, 10.2.3.
#[cfg(target_arch = "x86_64")]
const FLUSH: u64 = 1 << 15 | 1 << 6;
/// Bits 24 (FZ) and 19 (FZ16) of FPCR: Arm's manual, C5.2.8.
#[cfg(target_arch = "aarch64")]
const FLUSH: u64 = 1 << 24 | 1 << 19;

#[cfg(target_arch = "x86_64")]
fn mode() -> u64 {
    let mut mode = 0u32;
    // SAFETY: stores MXCSR into a variable of its size, and nothing else.
    unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut mode, options(nostack)) };
    mode.into()
}

#[cfg(target_arch = "x86_64")]
fn set_mode(mode: u64) {
    let mode = mode as u32;
    // SAFETY: the value was read from MXCSR but for two bits that every x86-64 has.
    unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const mode, options(nostack)) };
}

#[cfg(target_arch = "aarch64")]
fn mode() -> u64 {
    let mode: u64;
    // SAFETY: reads a register.
    unsafe { std::arch::asm!("mrs {}, fpcr", out(reg) mode, options(nomem, nostack)) };
    mode
}

#[cfg(target_arch = "aarch64")]
fn set_mode(mode: u64) {
    // SAFETY: the value was read from FPCR but for two bits; one that a processor
    // lacks is ignored.
    unsafe { std::arch::asm!("msr fpcr, {}", in(reg) mode, options(nomem, nostack)) };
}

/// The logits of a small model, one layer of which is `factor` times as large.
fn logits(model: &Path, precision: Precision, kernel: kernel::KernelName) -> Vec<f32> {
    let options = Options { precision, kernel: Some(kernel), ..Options::default() };
    let mut classifier = Classifier::load(model, &options).unwrap();
    let point = |i: u8| [f32::from(i % 7), f32::from(i % 5) * 0.3, f32::from(i) * 0.02];
    let cloud: Vec<[f32; 3]> = (0..60).map(point).collect();
    classifier.classify(&cloud).unwrap().logits.clone()
}

#[test]
fn flushing_is_flushing() {
    let tiny = std::hint::black_box(f32::MIN_POSITIVE);
    assert!(tiny * std::hint::black_box(0.5) > 0.0);
    assert_eq!(flushed(|| std::hint::black_box(tiny) * std::hint::black_box(0.5)), 0.0);
}

/// Weights of 1e-42 and products of as much: each sum of K = 64 of them moves by
/// 64 * 1.2e-38 at most, and so does what later layers, of gains below 10^2, make of
/// it: below 1e-33, which no logit of 1 has room for.
#[test]
fn subnormal_weights_move_no_logit_whether_flushed_or_not() {
    let folder = tempfile::tempdir().unwrap();
    for (i, factor) in [1.0, 1e-42].into_iter().enumerate() {
        let mut tensors = tiny_model::tensors(4);
        for layer in ["feat.conv2", "feat.conv3", "fc1"] {
            tiny_model::scale(&mut tensors, &format!("{layer}.weight"), factor);
        }
        let path = folder.path().join(format!("{i}.safetensors"));
        let model = tiny_model::write(&path, &tensors, &ModelCard::default());
        for precision in Precision::ALL {
            for kernels in kernel::available().filter(|kernels| precision.runs_on(kernels)) {
                let plain = logits(&model, precision, kernels.name);
                let other = flushed(|| logits(&model, precision, kernels.name));
                for (a, b) in plain.iter().zip(&other) {
                    assert!((a - b).abs() <= 1e-33, "{precision}, {}: {a}, {b}", kernels.name);
                }
            }
        }
    }
}
