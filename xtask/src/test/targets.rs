//! Checks of other targets: the Raspberry Pi, and systems of Metal and of Direct3D 12.

use super::{go_without, meanwhile::Meanwhile, test_programs};
use crate::summary::{Counts, Summary, check};
use anyhow::ensure;
use std::{env::current_exe, process::Command};
use xtask::{build_pi, pi_target, workspace::cargo, workspace::standard_library};

/// A check: its name, and whether it fails where it cannot run.
type Check = fn(&mut Summary, &str, bool) -> anyhow::Result<Counts>;

const METAL: &str = "aarch64-apple-darwin";
const DX12: &str = "x86_64-pc-windows-msvc";

/// The target that each check needs the standard library of, its name, and the check.
const CHECKS: [(&str, &str, Check); 5] = [
    (METAL, "Metal lints", |_, name, _| lints(name, cargo(&SIM_GPU).args(["--target", METAL]))),
    (DX12, "Direct3D 12 lints", |_, name, _| lints(name, cargo(&SIM_GPU).args(["--target", DX12]))),
    (pi_target::TRIPLE, "Raspberry Pi lints", |_, name, _| {
        lints(name, pi_target::cargo(&["clippy"]).args(LIBRARY))
    }),
    (pi_target::TRIPLE, "Raspberry Pi tests", tests),
    (pi_target::TRIPLE, "Raspberry Pi binary", binary),
];

/// Lints the ray-casting library, for systems whose part of wgpu no other step compiles.
const SIM_GPU: [&str; 3] = ["clippy", "--package", "sim-gpu"];

/// What depends on the processor: the classifier as a library, and its tests. What reads command
/// lines and packets is tested natively; tests/peers/debian_package.py emulates the program.
const LIBRARY: [&str; 5] = ["--package", "infer-cpu", "--no-default-features", "--lib", "--tests"];

/// Starts to make the binary, which takes one core minutes; what checks it waits for Cargo's lock.
pub fn build_meanwhile() -> anyhow::Result<Meanwhile> {
    ensure!(standard_library(pi_target::TRIPLE)?.is_dir(), "there is no standard library for it");
    Meanwhile::start("build-pi", Command::new("nice").arg(current_exe()?).arg("build-pi"))
}

/// Runs the checks; those that cannot run here fail where they are `required`.
pub fn run(summary: &mut Summary, required: bool) {
    for (target, name, check) in CHECKS {
        let lack = format!("Rust's standard library for it is missing: rustup target add {target}");
        summary.step(name, |summary| match standard_library(target)?.is_dir() {
            true => check(summary, name, required),
            false => go_without(summary, name, &lack, required),
        });
    }
}

fn lints(name: &str, clippy: &mut Command) -> anyhow::Result<Counts> {
    check(name, clippy.args(["--", "--deny", "warnings"]))
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
    let mut tests = pi_target::cargo(&["test", "--no-fail-fast"]);
    test_programs::run(summary, tests.args(LIBRARY))
}

/// Checks that a binary for the Raspberry Pi can be made, and is as small as promised.
fn binary(_: &mut Summary, name: &str, _: bool) -> anyhow::Result<Counts> {
    eprintln!("== {name}: cargo xtask build-pi");
    build_pi::run(&build_pi::Args::default()).map(|()| Counts::PASSED)
}
