//! What is compiled for the Raspberry Pi: lints, tests under an emulator, the binary.

use super::{check, go_without, test_programs};
use crate::summary::{Counts, Summary};
use xtask::{build_pi, pi_target};

/// Runs the three checks; those that cannot run here fail where they are `required`.
pub fn run(summary: &mut Summary, required: bool) {
    summary.step("Raspberry Pi lints", |summary| lints(summary, required));
    summary.step("Raspberry Pi tests", |summary| tests(summary, required));
    summary.step("Raspberry Pi binary", |summary| binary(summary, required));
}

/// Lints the code that is compiled for the Raspberry Pi alone.
fn lints(summary: &mut Summary, required: bool) -> anyhow::Result<Counts> {
    let name = "Raspberry Pi lints";
    if !pi_target::has_standard_library()? {
        return go_without(summary, name, pi_target::NO_STANDARD_LIBRARY, required);
    }
    let mut lints = pi_target::cargo(&["clippy", "--package", "infer-cpu", "--all-targets"]);
    check(name, lints.args(["--", "--deny", "warnings"]))
}

/// Tests infer-cpu with the Raspberry Pi's instructions.
fn tests(summary: &mut Summary, required: bool) -> anyhow::Result<Counts> {
    let name = "Raspberry Pi tests";
    if cfg!(target_arch = "aarch64") {
        let reason = "this processor is of its kind, so the tests above were these";
        return go_without(summary, name, reason, false);
    }
    if !pi_target::has_standard_library()? {
        return go_without(summary, name, pi_target::NO_STANDARD_LIBRARY, required);
    }
    if pi_target::emulator().is_none() {
        // QEMU emulates single programs on Linux only.
        let required = required && cfg!(target_os = "linux");
        return go_without(summary, name, pi_target::NO_EMULATOR, required);
    }
    let tests = ["test", "--package", "infer-cpu", "--lib", "--bins", "--tests", "--no-fail-fast"];
    test_programs::run(summary, &mut pi_target::cargo(&tests))
}

/// That a binary for the Raspberry Pi can be made, and is as small as promised.
fn binary(summary: &mut Summary, required: bool) -> anyhow::Result<Counts> {
    let name = "Raspberry Pi binary";
    if !pi_target::has_standard_library()? {
        return go_without(summary, name, pi_target::NO_STANDARD_LIBRARY, required);
    }
    eprintln!("== {name}: cargo xtask build-pi");
    build_pi::run(&build_pi::Args::default()).map(|_| Counts::PASSED)
}
