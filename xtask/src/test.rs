//! `cargo xtask test`: everything a change must pass.

mod fuzz;
mod peers;
mod pi;
mod sanitize;
mod test_programs;

use crate::summary::{Counts, Summary};
use anyhow::bail;
use std::process::Command;
use xtask::workspace::{cargo, root, step};

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
    println!("{summary}");
    Ok(u8::from(summary.total().failed > 0))
}

fn run_all(args: &Args, summary: &mut Summary) {
    let install = !args.no_install;
    if install {
        summary.step("packages", |_| {
            check("packages", Command::new("sh").arg(PACKAGES).current_dir(root()))
        });
    }
    let packages = peers::Packages::fetch_meanwhile(args.peers, install);
    summary.step("format", |_| check("format", &mut cargo(&["fmt", "--all", "--check"])));
    summary.step("lints", |_| {
        let mut lints = cargo_on_all(&["clippy", "--all-targets"]);
        check("lints", lints.args(["--", "--deny", "warnings"]))
    });
    summary.step("tests", |summary| tests(summary, install));
    summary.step("documentation", |_| {
        let mut documentation = cargo_on_all(&["doc", "--no-deps"]);
        check("documentation", documentation.env("RUSTDOCFLAGS", "--deny warnings"))
    });
    summary.step("dependencies", |_| infer_cpu_is_light());
    pi::run(summary, install);
    peers::run(summary, packages);
    fuzz::run(summary, args.fuzz_seconds);
}

/// A command that is one check.
fn check(name: &str, command: &mut Command) -> anyhow::Result<Counts> {
    step(name, command).map(|()| Counts::PASSED)
}

/// A check that cannot run here, which fails where it is `required`.
fn go_without(
    summary: &mut Summary,
    name: &str,
    lack: &str,
    required: bool,
) -> anyhow::Result<Counts> {
    if required {
        bail!("it cannot run: {lack}");
    }
    summary.remark(format!("{name}: SKIPPED, {lack}"));
    Ok(Counts::SKIPPED)
}

/// A command of Cargo on every crate, with the features that all such commands
/// share, so that nothing is built twice.
fn cargo_on_all(words: &[&str]) -> Command {
    let mut command = cargo(words);
    command.args(["--workspace", "--features", "edgepuck/hdf5,train/hdf5"]);
    if has_cpp_compiler() {
        command.args(["--features", "edgepuck/simplify,edgepuck-lab/simplify,tests/simplify"]);
    }
    command
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

/// That the Raspberry Pi's crate drags in nothing of GPUs or training.
fn infer_cpu_is_light() -> anyhow::Result<Counts> {
    const TOO_HEAVY: [&str; 7] = ["wgpu", "naga", "tokio", "ndarray", "rayon", "sim-gpu", "train"];
    let tree = cargo(&["tree", "--package", "infer-cpu", "--edges", "normal", "--prefix", "none"])
        .output()?;
    if !tree.status.success() {
        bail!("cargo tree failed: {}", String::from_utf8_lossy(&tree.stderr));
    }
    let tree = String::from_utf8_lossy(&tree.stdout);
    let heavy = tree.lines().find(|line| TOO_HEAVY.iter().any(|name| line.starts_with(name)));
    match heavy {
        Some(line) => bail!("infer-cpu must stay light, but depends on {line}"),
        None => Ok(Counts::PASSED),
    }
}
