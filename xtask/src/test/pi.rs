//! What is compiled for the Raspberry Pi: lints, tests under an emulator, the binary.

use super::{go_without, test_programs};
use crate::summary::{Counts, Summary, check};
use xtask::{build_pi, pi_target};

/// A check: its name, and whether it fails where it cannot run.
type Check = fn(&mut Summary, &str, bool) -> anyhow::Result<Counts>;

const CHECKS: [(&str, Check); 3] =
    [("Raspberry Pi lints", lints), ("Raspberry Pi tests", tests), ("Raspberry Pi binary", binary)];

/// What runs on a Raspberry Pi.
const PACKAGES: [&str; 4] = ["--package", "infer-cpu", "--package", "edgepuck-segment"];

/// Runs the three checks; those that cannot run here fail where they are `required`.
pub fn run(summary: &mut Summary, required: bool) {
    for (name, check) in CHECKS {
        summary.step(name, |summary| match pi_target::has_standard_library()? {
            true => check(summary, name, required),
            false => go_without(summary, name, pi_target::NO_STANDARD_LIBRARY, required),
        });
    }
}

/// Lints the code that is compiled for the Raspberry Pi alone.
fn lints(_: &mut Summary, name: &str, _: bool) -> anyhow::Result<Counts> {
    let mut lints = pi_target::cargo(&["clippy", "--all-targets"]);
    check(name, lints.args(PACKAGES).args(["--", "--deny", "warnings"]))
}

/// Tests the packages with the Raspberry Pi's instructions.
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
    let mut tests = pi_target::cargo(&["test", "--lib", "--bins", "--tests", "--no-fail-fast"]);
    test_programs::run(summary, tests.args(PACKAGES))
}

/// Checks that a binary for the Raspberry Pi can be made, and is as small as promised.
fn binary(_: &mut Summary, name: &str, _: bool) -> anyhow::Result<Counts> {
    eprintln!("== {name}: cargo xtask build-pi");
    build_pi::run(&build_pi::Args::default()).map(|()| Counts::PASSED)
}
