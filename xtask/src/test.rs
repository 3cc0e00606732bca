//! `cargo xtask test`: everything a change must pass.

mod docs;
mod fuzz;
mod meanwhile;
mod peers;
pub mod python;
mod sanitize;
mod targets;
mod test_programs;

use crate::summary::{Counts, Summary, check};
use anyhow::{bail, ensure};
use std::process::Command;
use xtask::workspace::{cargo, cargo_in_lab, output, root};

/// The script that lists and installs the packages that tests need.
const PACKAGES: &str = "xtask/packages.sh";

/// Flags of `test`.
#[derive(clap::Args)]
pub struct Args {
    /// Install nothing; skip the checks whose requirements are missing, and list them
    #[arg(long)]
    no_install: bool,

    /// Seconds to fuzz each hand-written parser
    #[arg(long, default_value_t = 15, value_name = "SECONDS")]
    fuzz_seconds: u32,

    /// Which comparisons with other software (tests/peers) to run; `all` downloads about 5 GB from
    /// PyPI
    #[arg(long, value_enum, default_value_t = peers::Which::Light, value_name = "WHICH")]
    peers: peers::Which,

    /// Run only the tests of kernels and parsers, under AddressSanitizer
    #[arg(long)]
    sanitize: bool,
}

/// Installs what is missing, runs every step whether or not one before it
/// failed, and ends with a table of them.
pub fn run(args: &Args) -> anyhow::Result<u8> {
    let mut summary = Summary::default();
    if args.sanitize {
        sanitize::run(&mut summary);
    } else {
        run_all(args, &mut summary);
    }
    Ok(summary.end())
}

fn run_all(args: &Args, summary: &mut Summary) {
    let install = !args.no_install;
    if install {
        summary.command("packages", Command::new("sh").arg(PACKAGES).current_dir(root()));
    }
    let packages = peers::Packages::fetch_meanwhile(args.peers, install);
    let fuzz_targets = fuzz::build_meanwhile(args.fuzz_seconds);
    let _pi_binary = targets::build_meanwhile();
    let mdbook = docs::build_meanwhile(install);
    summary.command("format", &mut cargo(&["fmt", "--all", "--check"]));
    let mut lints = cargo_on_all(&["clippy", "--all-targets"]);
    summary.command("lints", lints.args(["--", "--deny", "warnings"]));
    // What a first build leaves out, and what a machine without a GPU can.
    for package in ["edgepuck", "sim-gpu"] {
        let mut lints = cargo(&["clippy", "--package", package, "--no-default-features"]);
        let name = format!("lints of the smallest {package}");
        summary.command(&name, lints.args(["--", "--deny", "warnings"]));
    }
    summary.step("tests", |summary| tests(summary, install));
    summary.step("laboratory", |summary| laboratory(summary, install));
    let mut documentation = cargo_on_all(&["doc", "--no-deps"]);
    summary.command("documentation", documentation.env("RUSTDOCFLAGS", "--deny warnings"));
    summary.step("dependencies", |_| infer_cpu_is_light());
    targets::run(summary, install);
    docs::build_site(summary, mdbook);
    python::run(summary, install, args.peers == peers::Which::All);
    peers::run(summary, packages);
    fuzz::run(summary, args.fuzz_seconds, fuzz_targets);
}

/// A check that cannot run here, which fails where it is `required`.
fn go_without(
    summary: &mut Summary,
    name: &str,
    lack: &str,
    required: bool,
) -> anyhow::Result<Counts> {
    ensure!(!required, "it cannot run: {lack}");
    Ok(summary.skip(name, 1, lack))
}

/// A command of Cargo on every crate, with the features that all such commands
/// share, so that nothing is built twice.
fn cargo_on_all(words: &[&str]) -> Command {
    let mut command = cargo(words);
    command.args(["--workspace", "--features", "edgepuck/hdf5,edgepuck/textures,train/hdf5"]);
    if has_cpp_compiler() {
        command.args(["--features", "edgepuck/simplify,tests/simplify"]);
    }
    command
}

/// A command of Cargo on the laboratory's workspace.
fn cargo_on_lab(words: &[&str]) -> Command {
    let mut command = cargo_in_lab(words);
    command.args(["--features", "hdf5"]);
    command
}

/// The format, lints and tests of the laboratory.
fn laboratory(summary: &mut Summary, required: bool) -> anyhow::Result<Counts> {
    let manifest = root().join("xtask/lab/Cargo.toml");
    check("format", cargo(&["fmt", "--check", "--manifest-path"]).arg(manifest))?;
    let mut lints = cargo_on_lab(&["clippy", "--all-targets"]);
    check("lints", lints.args(["--", "--deny", "warnings"]))?;
    let mut tests = cargo_on_lab(&["test", "--no-fail-fast"]);
    if required {
        tests.env(test_support::REQUIRE_ADAPTER, "1");
    }
    test_programs::run(summary, &mut tests)
}

/// The tests of all crates.
fn tests(summary: &mut Summary, required: bool) -> anyhow::Result<Counts> {
    let mut tests = cargo_on_all(&["test", "--no-fail-fast"]);
    // A machine without any Vulkan adapter tests the CPU alone, and says so.
    if required {
        tests.env(test_support::REQUIRE_ADAPTER, "1");
    }
    let counts = test_programs::run(summary, &mut tests)?;
    if has_cpp_compiler() {
        return Ok(counts);
    }
    let lack = "there is no C++ compiler";
    Ok(counts.and(go_without(summary, "tests of simplified meshes", lack, required)?))
}

/// Whether meshoptimizer, which `--simplify` uses, can be built.
fn has_cpp_compiler() -> bool {
    let answers = |name: &str| Command::new(name).arg("--version").output().is_ok();
    cfg!(windows) || std::env::var_os("CXX").is_some() || answers("c++")
}

/// Checks that the Raspberry Pi's crate depends on nothing for GPUs or training.
fn infer_cpu_is_light() -> anyhow::Result<Counts> {
    const TOO_HEAVY: [&str; 7] = ["wgpu", "naga", "tokio", "ndarray", "rayon", "sim-gpu", "train"];
    let tree = ["tree", "--package", "infer-cpu", "--edges", "normal", "--prefix", "none"];
    let tree = output(&mut cargo(&tree))?;
    let heavy = tree.lines().find(|line| TOO_HEAVY.iter().any(|name| line.starts_with(name)));
    match heavy {
        Some(line) => bail!("infer-cpu must stay light, but depends on {line}"),
        None => Ok(Counts::PASSED),
    }
}
