//! Runs the tests of kernels and parsers under AddressSanitizer, which finds reads and writes of
//! `unsafe` code outside its memory.

use super::{go_without, test_programs};
use crate::summary::Summary;
use anyhow::{Context, ensure};
use xtask::workspace::{cargo, standard_library, words};

/// Its runtime comes with Rust for this target.
const TRIPLE: &str = "x86_64-unknown-linux-gnu";

/// The name of each step, and the arguments of `cargo test`.
const STEPS: [(&str, &[&str]); 3] = [
    ("kernels, sanitized", &["--package", "edgepuck-kernels", "--lib"]),
    ("cloud parsers, sanitized", &["--package", "edgepuck-formats", "--lib", "--tests"]),
    ("mesh parsers, sanitized", &["--package", "edgepuck-mesh", "--lib"]),
];

/// Runs the steps, on x86-64 Linux.
pub fn run(summary: &mut Summary) {
    for (name, tests) in STEPS {
        summary.step(name, |summary| {
            if let Err(lack) = need_runtime() {
                return go_without(summary, name, &format!("{lack:#}"), false);
            }
            let mut cargo = cargo(&["test", "--target", TRIPLE, "--no-fail-fast"]);
            // The flag is not stable; the compiler and the runtime that it needs are.
            cargo.args(tests).env("RUSTC_BOOTSTRAP", "1").env("RUSTFLAGS", "-Zsanitizer=address");
            let counts = test_programs::run(summary, &mut cargo)?;
            let ran = counts.passed + counts.failed + counts.skipped;
            ensure!(ran > 0, "expected tests, found none: {}", words(&cargo));
            Ok(counts)
        });
    }
}

/// Checks that Rust's standard library has the sanitizer's runtime here.
fn need_runtime() -> anyhow::Result<()> {
    let folder = standard_library(TRIPLE)?;
    let files = std::fs::read_dir(&folder).with_context(|| folder.display().to_string())?;
    let mut names = files.flatten().map(|file| file.file_name());
    let is_here = names.any(|name| name.to_string_lossy().ends_with("_rt.asan.a"));
    ensure!(is_here, "Rust's standard library comes without AddressSanitizer's runtime");
    Ok(())
}
