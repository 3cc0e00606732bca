//! `cargo xtask test`: everything a change must pass.

mod docs;
mod fuzz;
mod lints;
mod meanwhile;
mod page;
mod peers;
pub mod python;
mod sanitize;
mod targets;
mod test_programs;
mod viewer;

use crate::summary::{Counts, Summary, check};
use anyhow::{bail, ensure};
use lints::by_clippy;
use meanwhile::{Meanwhile, nice};
use std::process::Command;
use xtask::venv::any_python;
use xtask::workspace::{self, cargo, output, root};

/// The script that lists and installs the packages that tests need.
const PACKAGES: &str = "xtask/packages.sh";

/// Flags of `test`.
#[derive(clap::Args)]
pub struct Args {
    /// Also run the checks that take long and seldom find a fault, as CI does: the wheel, builds for other
    /// systems, the documentation of the libraries, schedulers, fuzzing
    #[arg(long, conflicts_with_all = ["quick", "sanitize"])]
    all: bool,

    /// Check only the format, the structure, the lints and the unit tests, in a few minutes
    #[arg(long, conflicts_with = "sanitize")]
    quick: bool,

    /// Install nothing; skip the checks whose requirements are missing, and list them
    #[arg(long)]
    no_install: bool,

    /// How long to fuzz each parser, with --all
    #[arg(long, default_value_t = 15, value_name = "SECONDS", requires = "all")]
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
        run_steps(args, &mut summary);
    }
    Ok(summary.end())
}

fn run_steps(args: &Args, summary: &mut Summary) {
    let install = !args.no_install;
    if install {
        let mut script = Command::new("sh");
        script.arg(PACKAGES).args(args.all.then_some("all")).current_dir(root());
        summary.command("packages", &mut script);
    }
    let packages = peers::Packages::fetch_meanwhile(args.peers, install);
    let built = args.all.then(|| Built::start(args, install));
    check_source(summary);
    summary.step("tests", |summary| tests(summary, install));
    let programs = peers::programs();
    viewer::run(summary, install, &programs);
    let (wheel, fuzz_targets) = built.map(Built::without_pi_binary).unzip();
    // Peers wait for clocks and sockets, so what only needs the processor runs beside them.
    let others = std::thread::scope(|scope| {
        let others = scope.spawn(|| {
            let mut summary = Summary::default();
            if args.all {
                library_lints(&mut summary);
                documentation(&mut summary);
                smallest_lints(&mut summary);
            }
            summary.step("dependencies", |_| infer_cpu_is_light());
            targets::run(&mut summary, install, args.all);
            page::run(&mut summary, install, &programs);
            let with_pytorch = args.peers == peers::Which::All;
            let wheel = python::run(&mut summary, wheel, with_pytorch);
            docs::run_blocks(&mut summary, &wheel, &programs);
            summary
        });
        peers::run(summary, packages, &programs, args.all);
        others.join()
    });
    match others {
        Ok(others) => summary.append(others),
        Err(_) => summary.step("documentation and targets", |_| bail!("they panicked")),
    }
    if let Some(targets) = fuzz_targets {
        fuzz::run(summary, args.fuzz_seconds, targets);
    }
}

/// What `--all` builds in the background, in the time that other steps leave a core idle.
struct Built {
    wheel: python::Build,
    fuzz_targets: Option<anyhow::Result<Meanwhile>>,
    pi_binary: anyhow::Result<Meanwhile>,
}

impl Built {
    fn start(args: &Args, install: bool) -> Self {
        Self {
            wheel: python::build_meanwhile(install),
            fuzz_targets: fuzz::build_meanwhile(args.fuzz_seconds),
            pi_binary: targets::build_meanwhile(),
        }
    }

    /// Waits for the binary for the Raspberry Pi, which a peer takes.
    fn without_pi_binary(self) -> (python::Build, Option<anyhow::Result<Meanwhile>>) {
        let _ = self.pi_binary.and_then(Meanwhile::end);
        (self.wheel, self.fuzz_targets)
    }
}

/// Checks the format, the structure and the lints, which compiles all tests.
fn check_source(summary: &mut Summary) {
    summary.command("format", &mut cargo(&["fmt", "--all", "--check"]));
    summary.step("structure", |_| structure());
    summary.step("lints", |_| {
        let tests = lints::check("lints", compile_all(&["test"]).arg("--no-run"))?;
        Ok(tests.and(lints::check("lints of the Python module", &mut python_module())?))
    });
}

/// Checks what neither rustc nor Clippy does.
fn structure() -> anyhow::Result<Counts> {
    let python = any_python().map_err(anyhow::Error::msg)?;
    check("structure", Command::new(python).arg("xtask/structure.py").current_dir(root()))
}

/// Builds the extension module of the Python package with the features and the profile of the tests,
/// for which Cargo looks at examples, too.
fn python_module() -> Command {
    compile_all(&["build", "--profile", "test", "--lib", "--examples"])
}

/// Lints the libraries without the features that only tests need, the library of the Python package
/// among them, which has no tests.
fn library_lints(summary: &mut Summary) {
    let name = "lints of the libraries";
    summary.step(name, |_| lints::check(name, &mut nice(&compile_all(&["check", "--lib"]))));
}

fn documentation(summary: &mut Summary) {
    let mut documentation = compile_all(&["doc", "--no-deps"]);
    documentation.env("RUSTDOCFLAGS", "--deny warnings");
    summary.command("documentation", &mut nice(&documentation));
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

/// A command of Cargo on every crate.
fn cargo_on_all(words: &[&str]) -> Command {
    let mut command = cargo(words);
    command.arg("--workspace");
    command
}

/// A command of Cargo that compiles every crate, with Clippy.
fn compile_all(words: &[&str]) -> Command {
    by_clippy(cargo_on_all(words))
}

fn tests(summary: &mut Summary, required: bool) -> anyhow::Result<Counts> {
    let mut tests = compile_all(&["test", "--no-fail-fast"]);
    require_adapter(&mut tests, required);
    test_programs::run(summary, &mut tests)
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

/// Checks that the Raspberry Pi's crate and C library depend on nothing for GPUs or training.
fn infer_cpu_is_light() -> anyhow::Result<Counts> {
    const TOO_HEAVY: [&str; 7] =
        ["wgpu", "naga", "tokio", "ndarray", "rayon", "sim-gpu", "edgepuck-train"];
    const CLASSIFY: &[&str] = &["--no-default-features", "--features", "classify"];
    for (package, features) in [("infer-cpu", &[][..]), ("edgepuck-ffi", CLASSIFY)] {
        let tree = ["tree", "--package", package, "--edges", "normal", "--prefix", "none"];
        let tree = output(cargo(&tree).args(features))?;
        let heavy = tree.lines().find(|line| TOO_HEAVY.iter().any(|name| line.starts_with(name)));
        if let Some(line) = heavy {
            bail!("{package} must stay light, but depends on {line}");
        }
    }
    Ok(Counts::PASSED)
}
