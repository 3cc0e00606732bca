//! `cargo xtask test`: everything a change must pass.

use crate::Outcome;
use anyhow::{Context, bail};
use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

/// The script that lists and installs the packages that tests need.
const PACKAGES: &str = "xtask/packages.sh";

/// Flags of `test`.
#[derive(clap::Args)]
pub struct Args {
    /// Install nothing
    #[arg(long)]
    no_install: bool,

    /// Seconds to fuzz each hand-written parser
    #[arg(long, default_value_t = 10, value_name = "SECONDS")]
    fuzz_seconds: u32,
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
    // A machine without any Vulkan adapter tests the CPU alone, and says so.
    if !args.no_install {
        tests.env("EDGEPUCK_REQUIRE_ADAPTER", "1");
    }
    step("tests", &mut tests)?;
    let hdf5 = ["test", "--package", "formats", "--features", "hdf5", "--test", "modelnet_h5"];
    step("HDF5 layout", &mut cargo(&hdf5))?;
    let mut documentation = cargo(&["doc", "--workspace", "--no-deps"]);
    step("documentation", documentation.env("RUSTDOCFLAGS", "--deny warnings"))?;
    check_that_infer_cpu_is_light()?;
    if args.fuzz_seconds > 0 {
        fuzz(args.fuzz_seconds)?;
    }
    eprintln!("All checks passed.");
    Ok(Outcome::Success)
}

/// Runs one check; its output goes to the terminal.
fn step(name: &str, command: &mut Command) -> anyhow::Result<()> {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    let shown = words.map(OsStr::to_string_lossy).collect::<Vec<_>>().join(" ");
    eprintln!("== {name}: {shown}");
    let status = command.status().with_context(|| format!("cannot run {shown}"))?;
    if !status.success() {
        bail!("{name} failed ({status}): {shown}");
    }
    Ok(())
}

/// That the Raspberry Pi's crate drags in nothing of GPUs or training.
fn check_that_infer_cpu_is_light() -> anyhow::Result<()> {
    const TOO_HEAVY: [&str; 5] = ["wgpu", "naga", "tokio", "burn", "sim-gpu"];
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
    for target in ["off", "mesh", "clouds"] {
        let build = ["run", "--release", "--target", "x86_64-unknown-linux-gnu", "--bin", target];
        let mut command = cargo(&build);
        command.args(["--", &limit]).current_dir(root().join("tests/fuzz"));
        step(&format!("fuzzing {target}"), command.env("RUSTFLAGS", COVERAGE))?;
    }
    Ok(())
}

fn cargo(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO"));
    command.args(args).current_dir(root());
    command
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."))
}
