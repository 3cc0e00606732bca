//! Logits are the same whether or not the caller's thread flushes subnormal numbers to 0, as
//! `edgepuck_kernels` states.

#![cfg(all(not(windows), any(target_arch = "x86_64", target_arch = "aarch64")))]
#![expect(unsafe_code, reason = "the processor's mode is changed in assembly")]

use crate::tiny_model;
use std::ffi::c_void;
use std::hint::black_box;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;

use formats::model_card::ModelCard;
use infer_cpu::kernel::{self, KernelName};
use infer_cpu::{Classifier, Options, Precision};
use test_support::IS_EMULATED;

/// Runs `work` on this thread while its arithmetic flushes subnormal operands and results to 0.
///
/// Rust does not model the processor's mode: the compiler may move arithmetic out of a region
/// between two `asm!` blocks that change it. It cannot move anything out of a function that
/// [`call_flushed`] calls through a pointer.
fn flushed<T>(work: impl FnOnce() -> T) -> T {
    let mut call = Call { work: Some(work), result: None };
    // SAFETY: `Call::entry` gives the `run` of the same `Call<F, T>`, which outlives the call and
    // is not used elsewhere meanwhile. `run` does not unwind.
    unsafe { call_flushed((&raw mut call).cast(), call.entry()) };
    match call.result.expect("the trampoline calls `run`") {
        Ok(result) => result,
        Err(panic) => resume_unwind(panic),
    }
}

/// A function to call, and its result.
struct Call<F, T> {
    work: Option<F>,
    result: Option<std::thread::Result<T>>,
}

/// A function with C's calling convention that works on a [`Call`].
type Entry = unsafe extern "C" fn(*mut c_void);

impl<F: FnOnce() -> T, T> Call<F, T> {
    fn entry(&self) -> Entry {
        Self::run
    }

    /// # Safety
    /// `call` points to a `Call` of these types that nothing else uses.
    unsafe extern "C" fn run(call: *mut c_void) {
        // SAFETY: `flushed` passes a pointer to a `Call` of these types that it owns.
        let call = unsafe { &mut *call.cast::<Self>() };
        let work = call.work.take().expect("the trampoline calls `run` once");
        // A panic must not pass the trampoline, which has no unwind tables.
        call.result = Some(catch_unwind(AssertUnwindSafe(work)));
    }
}

/// Calls `entry(data)` while bits 15 (flush to zero) and 6 (denormals are zeros) of MXCSR are set
/// (Intel's manual, volume 1, 10.2.3), and restores MXCSR.
///
/// # Safety
/// `entry` may be called with `data`, and does not unwind.
#[cfg(target_arch = "x86_64")]
#[unsafe(naked)]
unsafe extern "C" fn call_flushed(data: *mut c_void, entry: Entry) {
    std::arch::naked_asm!(
        "push rbp",
        "mov rbp, rsp",
        "sub rsp, 16",
        "stmxcsr [rsp]",
        "mov eax, [rsp]",
        "or eax, {flush}",
        "mov [rsp + 4], eax",
        "ldmxcsr [rsp + 4]",
        "call rsi",
        "ldmxcsr [rsp]",
        "leave",
        "ret",
        flush = const 1 << 15 | 1 << 6,
    )
}

/// Calls `entry(data)` while bit 24 (FZ) of FPCR is set (Arm's manual, C5.2.8), and restores FPCR.
///
/// # Safety
/// `entry` may be called with `data`, and does not unwind.
#[cfg(target_arch = "aarch64")]
#[unsafe(naked)]
unsafe extern "C" fn call_flushed(data: *mut c_void, entry: Entry) {
    std::arch::naked_asm!(
        "stp x29, x30, [sp, #-32]!",
        "mov x29, sp",
        "mrs x9, fpcr",
        "str x9, [sp, #16]",
        "orr x9, x9, #{fz}",
        "msr fpcr, x9",
        "blr x1",
        "ldr x9, [sp, #16]",
        "msr fpcr, x9",
        "ldp x29, x30, [sp], #32",
        "ret",
        fz = const 1 << 24,
    )
}

fn logits(model: &Path, precision: Precision, kernel: KernelName) -> Vec<f32> {
    let options = Options { precision, kernel: Some(kernel), ..Options::default() };
    let mut classifier = Classifier::load(model, &options).unwrap();
    let point = |i: u8| [f32::from(i % 7), f32::from(i % 5) * 0.3, f32::from(i) * 0.02];
    let cloud: Vec<[f32; 3]> = (0..60).map(point).collect();
    classifier.classify(&cloud).unwrap().logits.clone()
}

#[test]
fn flushing_is_flushing() {
    let half_of_least = || black_box(black_box(f32::MIN_POSITIVE) * black_box(0.5));
    assert!(half_of_least() > 0.0);
    assert_eq!(flushed(half_of_least), 0.0);
    assert!(half_of_least() > 0.0, "the mode is restored");
}

#[test]
fn a_panic_of_flushed_work_comes_through_and_restores_the_mode() {
    let panic = catch_unwind(|| flushed(|| panic!("of work"))).unwrap_err();
    assert_eq!(panic.downcast_ref(), Some(&"of work"));
    assert!(black_box(black_box(f32::MIN_POSITIVE) * black_box(0.5)) > 0.0);
}

/// With weights of up to 1e-37, many of whose products are subnormal, flushing changes a sum of
/// K = 64 products by at most 64 * 1.2e-38. Later layers have gains below 10^2, so that logits
/// change by less than 1e-33.
#[test]
fn subnormal_products_move_no_logit_whether_flushed_or_not() {
    let folder = tempfile::tempdir().unwrap();
    for (i, factor) in [1.0, 1e-37].into_iter().enumerate() {
        let mut tensors = tiny_model::tensors(4);
        for layer in ["feat.conv2", "feat.conv3", "fc1"] {
            tiny_model::scale(&mut tensors, &format!("{layer}.weight"), factor);
        }
        let path = folder.path().join(format!("{i}.safetensors"));
        let model = tiny_model::write(&path, &tensors, &ModelCard::default());
        for precision in Precision::ALL {
            for kernels in kernel::available().filter(|kernels| precision.runs_on(kernels)) {
                if IS_EMULATED && kernels.name == KernelName::Scalar {
                    continue;
                }
                let plain = logits(&model, precision, kernels.name);
                let other = flushed(|| logits(&model, precision, kernels.name));
                for (a, b) in plain.iter().zip(&other) {
                    assert!((a - b).abs() <= 1e-33, "{precision}, {}: {a}, {b}", kernels.name);
                }
            }
        }
    }
}
