//! Checks for other targets: the Raspberry Pi, systems with Metal and with Direct3D 12, and WebAssembly.

use super::meanwhile::{Meanwhile, nice};
use super::{go_without, lints, lints::by_clippy, page, test_programs};
use crate::summary::{Counts, Summary, check};
use anyhow::ensure;
use std::{env::current_exe, process::Command};
use xtask::workspace::{cargo, root, standard_library};
use xtask::{build_pi, pi_target};

/// A check: it is given its name, and whether it fails where it cannot run.
type Check = fn(&mut Summary, &str, bool) -> anyhow::Result<Counts>;

const METAL: &str = "aarch64-apple-darwin";
const DX12: &str = "x86_64-pc-windows-msvc";
/// A browser's page.
const PAGE: &str = "wasm32-unknown-unknown";
/// WebAssembly of which Node runs a test program.
const NODE: &str = "wasm32-wasip1";

/// The target whose standard library each check needs, the name of the check, and the check.
const CHECKS: [(&str, &str, Check); 4] = [
    (PAGE, "WebAssembly lints", |_, name, _| page::lint(name, PAGE)),
    (NODE, "WebAssembly tests", test_on_node),
    (pi_target::TRIPLE, "Raspberry Pi lints", |_, name, _| {
        lints::check(name, &mut nice(pi_tests(&KERNELS).arg("--no-run")))
    }),
    (pi_target::TRIPLE, "Raspberry Pi tests", |summary, name, required| {
        test_emulated(summary, name, required, &KERNELS)
    }),
];

/// Those of `--all`: no line of ours depends on Metal or Direct3D 12, and of the classifier only the
/// kernels depend on the processor.
const SELDOM: [(&str, &str, Check); 4] = [
    (METAL, "Metal lints", |_, name, _| lint_sim_gpu(name, METAL)),
    (DX12, "Direct3D 12 lints", |_, name, _| lint_sim_gpu(name, DX12)),
    (pi_target::TRIPLE, "Raspberry Pi tests of the classifier", |summary, name, required| {
        test_emulated(summary, name, required, &CLASSIFIER)
    }),
    (pi_target::TRIPLE, "Raspberry Pi binary", binary),
];

/// The code that depends on the processor, with its unit tests.
const KERNELS: [&str; 3] = ["--package", "edgepuck-kernels", "--lib"];

/// The classifier and the detector as a library, and the tests of logits: they are PyTorch's, whether or not
/// the processor flushes subnormal numbers. All other tests run natively only, but
/// tests/peers/debian_package.py emulates the program.
const CLASSIFIER: [&str; 8] = [
    "--package",
    "infer-cpu",
    "--no-default-features",
    "--features",
    "detect,bundled",
    "--lib",
    "--test",
    "suite",
];

pub fn build_meanwhile() -> anyhow::Result<Meanwhile> {
    ensure!(standard_library(pi_target::TRIPLE)?.is_dir(), "there is no standard library for it");
    Meanwhile::start("build-pi", &mut nice(Command::new(current_exe()?).arg("build-pi")))
}

/// Runs the checks, the seldom ones with `all`. Those that cannot run here fail where they are
/// `required`.
pub fn run(summary: &mut Summary, required: bool, all: bool) {
    let seldom = SELDOM.into_iter().filter(|_| all);
    for (target, name, check) in CHECKS.into_iter().chain(seldom) {
        let lack = format!("Rust's standard library for it is missing: rustup target add {target}");
        summary.step(name, |summary| match standard_library(target)?.is_dir() {
            true => check(summary, name, required),
            false => go_without(summary, name, &lack, required),
        });
    }
}

/// Lints the ray-casting library for a system whose part of wgpu no other step compiles.
fn lint_sim_gpu(name: &str, target: &str) -> anyhow::Result<Counts> {
    let lints = ["clippy", "--package", "sim-gpu", "--target", target, "--", "--deny", "warnings"];
    check(name, &mut nice(&cargo(&lints)))
}

/// Runs the tests of the kernels as WebAssembly in Node.
fn test_on_node(summary: &mut Summary, name: &str, required: bool) -> anyhow::Result<Counts> {
    if Command::new("node").arg("--version").output().is_err() {
        return go_without(summary, name, "there is no node", required);
    }
    let mut tests = cargo(&["test"]);
    tests.args(KERNELS);
    let runner = format!("node --no-warnings {}", root().join("web/test/wasi.mjs").display());
    tests.args(["--target", NODE]).env("CARGO_TARGET_WASM32_WASIP1_RUNNER", runner);
    test_programs::run(summary, &mut nice(&tests))
}

fn pi_tests(code: &[&str]) -> Command {
    let mut tests = by_clippy(pi_target::cargo(&["test", "--no-fail-fast"]));
    tests.args(code);
    tests
}

/// Tests `code` with the Raspberry Pi's instructions.
fn test_emulated(
    summary: &mut Summary,
    name: &str,
    required: bool,
    code: &[&str],
) -> anyhow::Result<Counts> {
    if cfg!(target_arch = "aarch64") {
        let reason = "this processor is of its kind, so the tests above were these";
        return Ok(summary.skip(name, 1, reason));
    }
    if pi_target::emulator().is_none() {
        // QEMU emulates single programs on Linux only.
        let required = required && cfg!(target_os = "linux");
        return go_without(summary, name, pi_target::NO_EMULATOR, required);
    }
    test_programs::run(summary, &mut nice(&pi_tests(code)))
}

/// Checks that a binary for the Raspberry Pi can be built, and is as small as promised.
fn binary(_: &mut Summary, name: &str, _: bool) -> anyhow::Result<Counts> {
    eprintln!("== {name}: cargo xtask build-pi");
    build_pi::run(&build_pi::Args::default()).map(|()| Counts::PASSED)
}
