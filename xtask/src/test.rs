//! `cargo xtask test`: everything a change must pass.

mod peers;

use crate::workspace::{cargo, root, step};
use crate::{Outcome, build_pi, pi_target};
use anyhow::bail;
use std::process::Command;

/// The script that lists and installs the packages that tests need.
const PACKAGES: &str = "xtask/packages.sh";

/// Flags of `test`.
#[derive(clap::Args)]
pub struct Args {
    /// Install nothing; checks whose needs are missing are skipped, and named
    #[arg(long)]
    no_install: bool,

    /// Seconds to fuzz each hand-written parser
    #[arg(long, default_value_t = 30, value_name = "SECONDS")]
    fuzz_seconds: u32,

    /// Which of tests/peers to run: none, light, or all, PyTorch too (5 GB from PyPI)
    #[arg(long, value_enum, default_value_t = peers::Which::Light, value_name = "WHICH")]
    peers: peers::Which,
}

/// Installs what is missing and runs every check.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if !args.no_install {
        step("packages", Command::new("sh").arg(PACKAGES).current_dir(root()))?;
    }
    step("format", &mut cargo(&["fmt", "--all", "--check"]))?;
    let lints = ["clippy", "--workspace", "--all-targets", "--", "--deny", "warnings"];
    step("lints", &mut cargo(&lints))?;
    let mut tests = cargo(&["test", "--workspace", "--no-fail-fast"]);
    tests.args(["--features", "edgepuck-formats/hdf5,train/hdf5"]);
    if has_cpp_compiler() {
        tests.args(["--features", "tests/simplify,xtask/simplify"]);
    } else {
        go_without("tests of simplified meshes", "there is no C++ compiler", !args.no_install)?;
    }
    // A machine without any Vulkan adapter tests the CPU alone, and says so.
    if !args.no_install {
        tests.env("EDGEPUCK_REQUIRE_ADAPTER", "1");
    }
    step("tests", &mut tests)?;
    let mut documentation = cargo(&["doc", "--workspace", "--no-deps"]);
    step("documentation", documentation.env("RUSTDOCFLAGS", "--deny warnings"))?;
    check_that_infer_cpu_is_light()?;
    lint_for_the_pi(!args.no_install)?;
    test_on_the_pi(!args.no_install)?;
    build_for_the_pi(!args.no_install)?;
    peers::run(args.peers, !args.no_install)?;
    if args.fuzz_seconds > 0 {
        fuzz(args.fuzz_seconds)?;
    }
    eprintln!("All checks passed.");
    Ok(Outcome::Success)
}

/// Lints the code that is compiled for the Raspberry Pi alone.
fn lint_for_the_pi(required: bool) -> anyhow::Result<()> {
    let name = "Raspberry Pi lints";
    if !pi_target::has_standard_library()? {
        return go_without(name, pi_target::NO_STANDARD_LIBRARY, required);
    }
    let mut lints = pi_target::cargo(&["clippy", "--package", "infer-cpu", "--all-targets"]);
    step(name, lints.args(["--", "--deny", "warnings"]))
}

/// Tests infer-cpu with the Raspberry Pi's instructions.
fn test_on_the_pi(required: bool) -> anyhow::Result<()> {
    let name = "Raspberry Pi tests";
    if cfg!(target_arch = "aarch64") {
        eprintln!("== {name}: the tests above were, on a processor of its kind");
        return Ok(());
    }
    if !pi_target::has_standard_library()? {
        return go_without(name, pi_target::NO_STANDARD_LIBRARY, required);
    }
    if pi_target::emulator().is_none() {
        // QEMU emulates single programs on Linux only.
        return go_without(name, pi_target::NO_EMULATOR, required && cfg!(target_os = "linux"));
    }
    let tests = ["test", "--package", "infer-cpu", "--lib", "--bins", "--tests"];
    step(name, &mut pi_target::cargo(&tests))
}

/// That a binary for the Raspberry Pi can be made, and is as small as promised.
fn build_for_the_pi(required: bool) -> anyhow::Result<()> {
    let name = "Raspberry Pi binary";
    if !pi_target::has_standard_library()? {
        return go_without(name, pi_target::NO_STANDARD_LIBRARY, required);
    }
    eprintln!("== {name}: cargo xtask build-pi");
    build_pi::run(&build_pi::Args::default()).map(|_| ())
}

/// Whether meshoptimizer, which `--simplify` uses, can be built.
fn has_cpp_compiler() -> bool {
    let answers = |name: &str| Command::new(name).arg("--version").output().is_ok();
    cfg!(windows) || std::env::var_os("CXX").is_some() || answers("c++")
}

fn go_without(step: &str, lack: &str, required: bool) -> anyhow::Result<()> {
    if required {
        bail!("{step} cannot run: {lack}");
    }
    eprintln!("== {step}: SKIPPED, {lack}");
    Ok(())
}

/// That the Raspberry Pi's crate drags in nothing of GPUs or training.
fn check_that_infer_cpu_is_light() -> anyhow::Result<()> {
    const TOO_HEAVY: [&str; 7] = ["wgpu", "naga", "tokio", "ndarray", "rayon", "sim-gpu", "train"];
    let tree = cargo(&["tree", "--package", "infer-cpu", "--prefix", "none"]).output()?;
    if !tree.status.success() {
        bail!("cargo tree failed: {}", String::from_utf8_lossy(&tree.stderr));
    }
    let tree = String::from_utf8_lossy(&tree.stdout);
    let heavy = tree.lines().find(|line| TOO_HEAVY.iter().any(|name| line.starts_with(name)));
    match heavy {
        Some(line) => bail!("infer-cpu must stay light, but depends on {line}"),
        None => Ok(()),
    }
}

/// Feeds each hand-written parser with mutated input for a while. libFuzzer's
/// coverage flags are for the target alone, not for build scripts.
fn fuzz(seconds: u32) -> anyhow::Result<()> {
    const COVERAGE: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
         -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
         -Cllvm-args=-sanitizer-coverage-pc-table \
         -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1";
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        eprintln!("== fuzzing: skipped, its flags are known for x86-64 Linux only");
        return Ok(());
    }
    let limit = format!("-max_total_time={seconds}");
    for target in ["off", "mesh", "clouds", "model"] {
        let build = ["run", "--release", "--target", "x86_64-unknown-linux-gnu", "--bin", target];
        let mut command = cargo(&build);
        let folder = root().join("tests/fuzz");
        command.args(["--", &limit]).current_dir(&folder);
        // What is found goes to the first folder; the second is where it starts.
        if folder.join("seeds").join(target).is_dir() {
            std::fs::create_dir_all(folder.join("corpus").join(target))?;
            command.args([format!("corpus/{target}"), format!("seeds/{target}")]);
        }
        step(&format!("fuzzing {target}"), command.env("RUSTFLAGS", COVERAGE))?;
    }
    Ok(())
}
