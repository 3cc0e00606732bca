//! The tests of kernels and parsers under AddressSanitizer, which finds what a
//! wrong offset in `unsafe` code reads or writes.

use super::{go_without, test_programs};
use crate::summary::Summary;
use xtask::workspace::{cargo, standard_library};

/// Its runtime comes with Rust for this target.
const TRIPLE: &str = "x86_64-unknown-linux-gnu";

/// What is tested: a step's name and what `cargo test` is asked for.
const STEPS: [(&str, &[&str]); 3] = [
    ("kernels, sanitized", &["--package", "infer-cpu", "--lib"]),
    ("cloud parsers, sanitized", &["--package", "edgepuck-formats", "--lib", "--tests"]),
    (
        "mesh parsers, sanitized",
        &["--package", "sim-gpu", "--no-default-features", "--lib", "mesh::"],
    ),
];

/// Runs the steps, on x86-64 Linux.
pub fn run(summary: &mut Summary) {
    for (name, tests) in STEPS {
        summary.step(name, |summary| {
            if let Err(lack) = runtime() {
                return go_without(summary, name, &lack, false);
            }
            let mut cargo = cargo(&["test", "--target", TRIPLE, "--no-fail-fast"]);
            // The flag is not stable; the compiler and the runtime that it needs are.
            cargo.args(tests).env("RUSTC_BOOTSTRAP", "1").env("RUSTFLAGS", "-Zsanitizer=address");
            test_programs::run(summary, &mut cargo)
        });
    }
}

/// Whether Rust's standard library has the sanitizer's runtime here.
///
/// # Errors
/// If it has not, in words for the user.
fn runtime() -> Result<(), String> {
    let folder = standard_library(TRIPLE).map_err(|error| format!("{error:#}"))?;
    let files = std::fs::read_dir(folder).map_err(|error| format!("{TRIPLE}: {error}"))?;
    let is_runtime = |name: &str| name.ends_with("_rt.asan.a");
    let mut names = files.flatten().map(|file| file.file_name());
    match names.any(|name| name.to_str().is_some_and(is_runtime)) {
        true => Ok(()),
        false => Err("Rust's standard library comes without AddressSanitizer's runtime".to_owned()),
    }
}
