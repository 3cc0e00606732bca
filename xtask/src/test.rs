//! `cargo xtask test`: everything a change must pass.

mod docs;
mod fuzz;
mod lints;
mod meanwhile;
mod page;
mod peers;
pub mod python;
mod sanitize;
mod structure;
mod targets;
mod test_programs;
mod viewer;

use crate::summary::{Counts, Summary};
use anyhow::{bail, ensure};
use lints::by_clippy;
use meanwhile::nice;
use std::process::Command;
use xtask::workspace::{self, cargo, cargo_in_lab, output, root};

/// The script that lists and installs the packages that tests need.
const PACKAGES: &str = "xtask/packages.sh";

/// Flags of `test`.
#[derive(clap::Args)]
pub struct Args {
    /// Check only the format, the structure, the lints and the unit tests, in a few minutes
    #[arg(long, conflicts_with = "sanitize")]
    quick: bool,

    /// Install nothing; skip the checks whose requirements are missing, and list them
    #[arg(long)]
    no_install: bool,

    /// How long to fuzz each parser
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

/// Installs what is missing, runs every step even if one fails, and prints a table of the results.
pub fn run(args: &Args) -> anyhow::Result<u8> {
    let mut summary = Summary::default();
    if args.sanitize {
        sanitize::run(&mut summary);
    } else if args.quick {
        check_source(&mut summary);
        summary.step("unit tests", unit_tests);
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
    let wheel = python::build_meanwhile(install);
    let fuzz_targets = fuzz::build_meanwhile(args.fuzz_seconds);
    let pi_binary = targets::build_meanwhile();
    check_source(summary);
    summary.step("tests", |summary| tests(summary, install));
    laboratory(summary, install);
    let programs = peers::programs();
    viewer::run(summary, install, &programs);
    // A peer takes the binary for the Raspberry Pi.
    let _ = pi_binary.and_then(meanwhile::Meanwhile::end);
    // Peers wait for clocks and sockets, so what only needs the processor runs beside them.
    let others = std::thread::scope(|scope| {
        let others = scope.spawn(|| {
            let mut summary = Summary::default();
            library_lints(&mut summary);
            let mut documentation = compile_all(&["doc", "--no-deps"]);
            documentation.env("RUSTDOCFLAGS", "--deny warnings");
            summary.command("documentation", &mut nice(&documentation));
            smallest_lints(&mut summary);
            summary.step("dependencies", |_| infer_cpu_is_light());
            targets::run(&mut summary, install);
            page::run(&mut summary, install);
            let with_pytorch = args.peers == peers::Which::All;
            let wheel = python::run(&mut summary, wheel, with_pytorch);
            docs::run_blocks(&mut summary, &wheel);
            summary
        });
        peers::run(summary, packages, &programs);
        others.join()
    });
    match others {
        Ok(others) => summary.append(others),
        Err(_) => summary.step("documentation and targets", |_| bail!("they panicked")),
    }
    fuzz::run(summary, args.fuzz_seconds, fuzz_targets);
}

/// Checks the format, the structure and the lints, which compiles all tests.
fn check_source(summary: &mut Summary) {
    summary.command("format", &mut cargo(&["fmt", "--all", "--check"]));
    summary.step("structure", structure::check);
    summary.step("lints", |_| lints::check("lints", compile_all(&["test"]).arg("--no-run")));
}

/// Lints the libraries without the features that only tests need, the library of the Python package
/// among them, which has no tests.
fn library_lints(summary: &mut Summary) {
    let name = "lints of the libraries";
    summary.step(name, |_| lints::check(name, &mut nice(&compile_all(&["check", "--lib"]))));
}

/// Lints the smallest builds: of a first command, and of a machine without a GPU.
fn smallest_lints(summary: &mut Summary) {
    for package in ["edgepuck", "sim-gpu"] {
        let mut lints = cargo(&["clippy", "--package", package, "--no-default-features"]);
        let name = format!("lints of the smallest {package}");
        summary.command(&name, &mut nice(lints.args(["--", "--deny", "warnings"])));
    }
}

/// Skips a check that cannot run here. It fails if it is `required`.
fn go_without(
    summary: &mut Summary,
    name: &str,
    lack: &str,
    required: bool,
) -> anyhow::Result<Counts> {
    ensure!(!required, "it cannot run: {lack}");
    Ok(summary.skip(name, 1, lack))
}

/// A command of Cargo on every crate, with the features that all such commands share, so that
/// nothing is built twice.
fn cargo_on_all(words: &[&str]) -> Command {
    let mut command = cargo(words);
    command.args(["--workspace", "--features", "edgepuck/hdf5,edgepuck/textures,train/hdf5"]);
    if has_cpp_compiler() {
        command.args(["--features", "edgepuck/simplify,tests/simplify"]);
    }
    command
}

/// A command of Cargo that compiles every crate, with Clippy.
fn compile_all(words: &[&str]) -> Command {
    by_clippy(cargo_on_all(words))
}

fn compile_lab(words: &[&str]) -> Command {
    let mut command = by_clippy(cargo_in_lab(words));
    command.args(["--features", "hdf5"]);
    command
}

/// Checks the format and the lints of the laboratory, and runs its tests.
fn laboratory(summary: &mut Summary, required: bool) {
    let manifest = root().join("xtask/lab/Cargo.toml");
    let mut format = cargo(&["fmt", "--check", "--manifest-path"]);
    summary.command("format of the laboratory", format.arg(manifest));
    let name = "lints of the laboratory";
    summary.step(name, |_| lints::check(name, compile_lab(&["test"]).arg("--no-run")));
    summary.step("laboratory", |summary| {
        let mut tests = compile_lab(&["test", "--no-fail-fast"]);
        require_adapter(&mut tests, required);
        test_programs::run(summary, &mut tests)
    });
}

fn tests(summary: &mut Summary, required: bool) -> anyhow::Result<Counts> {
    let mut tests = compile_all(&["test", "--no-fail-fast"]);
    require_adapter(&mut tests, required);
    let counts = test_programs::run(summary, &mut tests)?;
    if has_cpp_compiler() {
        return Ok(counts);
    }
    let lack = "there is no C++ compiler";
    Ok(counts.and(go_without(summary, "tests of simplified meshes", lack, required)?))
}

/// The tests in the same files as the code.
fn unit_tests(summary: &mut Summary) -> anyhow::Result<Counts> {
    let mut cargo = compile_all(&["test", "--no-run"]);
    cargo.args(["--message-format", "json-render-diagnostics"]);
    let programs = workspace::unit_tests(&output(&mut cargo)?);
    programs.into_iter().try_fold(Counts::default(), |counts, mut program| {
        Ok(counts.and(test_programs::run(summary, &mut program)?))
    })
}

/// Lets tests fail without a Vulkan adapter if it is `required`. Otherwise they test the CPU only,
/// and report it.
fn require_adapter(tests: &mut Command, required: bool) {
    if required {
        tests.env(test_support::REQUIRE_ADAPTER, "1");
    }
}

/// Whether meshoptimizer, which `--simplify` uses, can be built.
fn has_cpp_compiler() -> bool {
    let answers = |name: &str| Command::new(name).arg("--version").output().is_ok();
    cfg!(windows) || std::env::var_os("CXX").is_some() || answers("c++")
}

/// Checks that the Raspberry Pi's crate depends on nothing for GPUs or training.
fn infer_cpu_is_light() -> anyhow::Result<Counts> {
    const TOO_HEAVY: [&str; 7] =
        ["wgpu", "naga", "tokio", "ndarray", "rayon", "sim-gpu", "edgepuck-train"];
    let tree = ["tree", "--package", "infer-cpu", "--edges", "normal", "--prefix", "none"];
    let tree = output(&mut cargo(&tree))?;
    let heavy = tree.lines().find(|line| TOO_HEAVY.iter().any(|name| line.starts_with(name)));
    match heavy {
        Some(line) => bail!("infer-cpu must stay light, but depends on {line}"),
        None => Ok(Counts::PASSED),
    }
}
