//! Checks for other targets: the Raspberry Pi, systems with Metal and with Direct3D 12, and WebAssembly.

use super::meanwhile::{Meanwhile, nice};
use super::{go_without, lints, lints::by_clippy, test_programs};
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
const CHECKS: [(&str, &str, Check); 7] = [
    (METAL, "Metal lints", |_, name, _| lint_sim_gpu(name, METAL)),
    (DX12, "Direct3D 12 lints", |_, name, _| lint_sim_gpu(name, DX12)),
    (PAGE, "WebAssembly lints", |_, name, _| lint("edgepuck-web", name, PAGE)),
    (NODE, "WebAssembly tests", test_on_node),
    (pi_target::TRIPLE, "Raspberry Pi lints", |_, name, _| {
        lints::check(name, &mut nice(pi_tests().arg("--no-run")))
    }),
    (pi_target::TRIPLE, "Raspberry Pi tests", tests),
    (pi_target::TRIPLE, "Raspberry Pi binary", binary),
];

/// The code that depends on the processor: the classifier as a library, its unit tests, which
/// include those of every kernel, and the comparison of its logits with PyTorch's. All other tests
/// run natively only, but tests/peers/debian_package.py emulates the program.
const LIBRARY: [&str; 6] =
    ["--package", "infer-cpu", "--no-default-features", "--lib", "--test", "parity"];

pub fn build_meanwhile() -> anyhow::Result<Meanwhile> {
    ensure!(standard_library(pi_target::TRIPLE)?.is_dir(), "there is no standard library for it");
    Meanwhile::start("build-pi", &mut nice(Command::new(current_exe()?).arg("build-pi")))
}

/// Runs the checks. Those that cannot run here fail where they are `required`.
pub fn run(summary: &mut Summary, required: bool) {
    for (target, name, check) in CHECKS {
        let lack = format!("Rust's standard library for it is missing: rustup target add {target}");
        summary.step(name, |summary| match standard_library(target)?.is_dir() {
            true => check(summary, name, required),
            false => go_without(summary, name, &lack, required),
        });
    }
}

/// Lints the ray-casting library for a system whose part of wgpu no other step compiles.
fn lint_sim_gpu(name: &str, target: &str) -> anyhow::Result<Counts> {
    lint("sim-gpu", name, target)
}

fn lint(package: &str, name: &str, target: &str) -> anyhow::Result<Counts> {
    let lints = ["clippy", "--package", package, "--target", target, "--", "--deny", "warnings"];
    check(name, &mut nice(&cargo(&lints)))
}

/// Runs the classifier's unit tests, which include those of every kernel, as WebAssembly in Node.
fn test_on_node(summary: &mut Summary, name: &str, required: bool) -> anyhow::Result<Counts> {
    if Command::new("node").arg("--version").output().is_err() {
        return go_without(summary, name, "there is no node", required);
    }
    let mut tests = cargo(&["test", "--package", "infer-cpu", "--no-default-features", "--lib"]);
    let runner = format!("node --no-warnings {}", root().join("web/test/wasi.mjs").display());
    tests.args(["--target", NODE, "kernel::"]).env("CARGO_TARGET_WASM32_WASIP1_RUNNER", runner);
    test_programs::run(summary, &mut nice(&tests))
}

fn pi_tests() -> Command {
    let mut tests = by_clippy(pi_target::cargo(&["test", "--no-fail-fast"]));
    tests.args(LIBRARY);
    tests
}

/// Tests the library with the Raspberry Pi's instructions.
fn tests(summary: &mut Summary, name: &str, required: bool) -> anyhow::Result<Counts> {
    if cfg!(target_arch = "aarch64") {
        let reason = "this processor is of its kind, so the tests above were these";
        return Ok(summary.skip(name, 1, reason));
    }
    if pi_target::emulator().is_none() {
        // QEMU emulates single programs on Linux only.
        let required = required && cfg!(target_os = "linux");
        return go_without(summary, name, pi_target::NO_EMULATOR, required);
    }
    test_programs::run(summary, &mut nice(&pi_tests()))
}

/// Checks that a binary for the Raspberry Pi can be built, and is as small as promised.
fn binary(_: &mut Summary, name: &str, _: bool) -> anyhow::Result<Counts> {
    eprintln!("== {name}: cargo xtask build-pi");
    build_pi::run(&build_pi::Args::default()).map(|()| Counts::PASSED)
}
