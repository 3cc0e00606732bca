//! The Python package: a wheel is built and judged, and its tests run in an environment that has
//! nothing else of ours.

use super::docs;
use super::peers::interpreter;
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow, ensure};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use xtask::pi_target;
use xtask::venv::{Environment, cache_dir, succeeds};
use xtask::workspace::{need_standard_library, output, root};

/// What builds wheels and judges them.
const BUILD: Environment<'_> = Environment {
    name: "python-build-venv",
    requirements: "python/requirements-build.txt",
    size: "some 100 MB",
};

/// What lists the packages that all tests need.
const TESTS_NEED: &str = "python/tests/requirements.txt";

/// The systems that a wheel of Linux runs on: all since glibc 2.28.
const PLATFORM: &str = "manylinux_2_28";

const AARCH64: &str = "aarch64-unknown-linux-gnu";

/// The target of the wheel for this processor.
const NATIVE: &str =
    if cfg!(target_arch = "aarch64") { AARCH64 } else { "x86_64-unknown-linux-gnu" };

/// How a wheel is built and tested.
struct Plan<'a> {
    target: &'a str,
    /// Cargo's profile that it is built by.
    profile: &'a str,
    /// A new environment to test it in.
    folder: PathBuf,
    /// Lists of packages that tests need.
    requirements: &'a [&'a str],
    /// Which tests are run, an expression of pytest's `-k`; if empty, all.
    tests: &'a str,
}

/// A wheel of the package.
pub struct Wheel {
    /// The interpreter that has the tools of [`BUILD`].
    pub tools: PathBuf,
    /// Where it is.
    pub file: PathBuf,
}

/// Builds the wheel and tests it, with PyTorch of PyPI if asked for, and runs the documentation with
/// it. Other systems build theirs as they are released.
pub fn run(summary: &mut Summary, install: bool, with_pytorch: bool) {
    let mut wheel = Err("there is no wheel to run it with".to_owned());
    summary.step("python", |summary| {
        if !cfg!(target_os = "linux") {
            return Ok(summary.skip("python", 1, "wheels are tested on Linux"));
        }
        let tools = match interpreter(&BUILD, install) {
            Ok(tools) => tools,
            Err(cause) => return Ok(summary.skip("python", 1, &cause)),
        };
        let plan = native(&tools, with_pytorch)?;
        let built = build(tools, &plan)?;
        let counts = test(&built, &plan)?;
        wheel = Ok(built);
        Ok(counts)
    });
    summary.step("documentation's examples", |summary| match &wheel {
        Ok(wheel) => docs::run_blocks(wheel),
        Err(cause) => Ok(summary.skip("documentation's examples", 1, cause)),
    });
}

fn native(tools: &Path, with_pytorch: bool) -> anyhow::Result<Plan<'static>> {
    let folder = environment(tools, "python-test-venv", &[])?;
    let requirements: &[&str] = match with_pytorch {
        true => &[TESTS_NEED, "tests/peers/pytorch-requirements.txt"],
        false => &[TESTS_NEED],
    };
    Ok(Plan { target: NATIVE, profile: "release", folder, requirements, tests: "" })
}

/// Builds the wheel of aarch64 as releases hold it, and tests it under an emulator if there is one.
pub fn run_emulated(summary: &mut Summary) {
    let name = "wheel of aarch64";
    summary.step(name, |summary| {
        if NATIVE == AARCH64 {
            let reason = "this processor is of its kind, so `cargo xtask test` tests it";
            return Ok(summary.skip(name, 1, reason));
        }
        let Some(emulator) = pi_target::emulator() else {
            return Ok(summary.skip(name, 1, pi_target::NO_EMULATOR));
        };
        let folder = cache_dir().join("aarch64-python");
        let tools = prepare_emulated(&emulator, &folder)?;
        summary.remark(format!(
            "{name}: SKIPPED, test_memory.py, which would measure the emulator's memory, and tests \
             that fork: QEMU aborts once a child of a process with threads starts one"
        ));
        let tests = "not (test_memory.py or fork- or [fork])";
        let requirements = &[TESTS_NEED];
        let plan = Plan { target: AARCH64, profile: "dist", folder, requirements, tests };
        test(&build(tools, &plan)?, &plan)
    });
}

/// Makes `folder` an environment of an emulated Python, and gives the interpreter that builds.
fn prepare_emulated(emulator: &Command, folder: &Path) -> anyhow::Result<PathBuf> {
    need_standard_library(AARCH64)?;
    let mut make = Command::new("sh");
    make.arg(root().join("xtask/emulated-python.sh")).arg(folder);
    succeeds(make.arg(emulator.get_program()).args(emulator.get_args()))
        .and_then(|()| interpreter(&BUILD, true))
        .map_err(|cause| anyhow!(cause))
}

/// The wheel, for Pythons from 3.10 on.
fn build(tools: PathBuf, plan: &Plan<'_>) -> anyhow::Result<Wheel> {
    let wheels = cache_dir().join("wheels");
    if wheels.exists() {
        fs::remove_dir_all(&wheels).with_context(|| wheels.display().to_string())?;
    }
    let mut maturin = Command::new(&tools);
    maturin.args(["-m", "maturin", "build", "--profile", plan.profile, "--zig", "--locked"]);
    maturin.args(["--compatibility", PLATFORM, "--target", plan.target, "--out"]).arg(&wheels);
    maturin.arg("--manifest-path").arg(root().join("python/Cargo.toml"));
    // maturin asks the first Python on the path for zig.
    maturin.env("PATH", path_behind(tools.parent())?);
    let status = maturin.status().context("cannot start maturin")?;
    ensure!(status.success(), "maturin: {status}");
    let built = fs::read_dir(&wheels).with_context(|| wheels.display().to_string())?;
    let file = built.filter_map(|entry| Some(entry.ok()?.path())).next();
    let file = file.ok_or_else(|| anyhow!("{}: expected a wheel, found none", wheels.display()))?;
    Ok(Wheel { tools, file })
}

/// Checks that the wheel runs on the Pythons and the systems that its name promises, and tests it in
/// an environment of its own, away from the package's source.
fn test(wheel: &Wheel, plan: &Plan<'_>) -> anyhow::Result<Counts> {
    let mut abi3audit = Command::new(&wheel.tools);
    abi3audit.args(["-m", "abi3audit", "--strict"]).arg(&wheel.file);
    succeeds(&mut abi3audit).map_err(|cause| anyhow!(cause))?;
    let mut auditwheel = Command::new(&wheel.tools);
    let shown = output(auditwheel.args(["-m", "auditwheel", "show"]).arg(&wheel.file))?;
    ensure!(
        shown.split_whitespace().collect::<Vec<_>>().join(" ").contains(PLATFORM),
        "auditwheel: expected a wheel for {PLATFORM}, found: {shown}"
    );
    let python = plan.folder.join("bin/python");
    wheel.install(&python, plan.requirements)?;
    let mut tests = pytest(&python, &plan.folder);
    tests.arg("--doctest-modules");
    // `edgepuck.torch` alone needs PyTorch.
    tests.arg("--doctest-ignore-import-errors");
    tests.args(["-k", plan.tests]).arg(root().join("python/tests")).args(["--pyargs", "edgepuck"]);
    Ok(Counts { passed: 2, ..Counts::default() }.and(counts(&mut tests)?))
}

impl Wheel {
    /// Installs it, and the packages of these lists, for the interpreter `python`, which needs no pip.
    pub fn install(&self, python: &Path, requirements: &[&str]) -> anyhow::Result<()> {
        let mut install = Command::new(&self.tools);
        install.args(["-m", "pip", "--python"]).arg(python);
        install.args(["install", "--quiet", "--disable-pip-version-check"]).arg(&self.file);
        for list in requirements {
            install.arg("-r").arg(root().join(list));
        }
        succeeds(&mut install).map_err(|cause| anyhow!(cause))
    }
}

/// A new environment of this name and without pip, for Python `base`.
pub fn environment(base: &Path, name: &str, options: &[&str]) -> anyhow::Result<PathBuf> {
    let folder = cache_dir().join(name);
    let mut make = Command::new(base);
    make.args(["-m", "venv", "--clear", "--without-pip"]).args(options).arg(&folder);
    succeeds(&mut make).map_err(|cause| anyhow!("{}: {cause}", folder.display()))?;
    Ok(folder)
}

/// The path on which programs are looked for, with these `folders` before all others.
pub fn path_behind<'a>(folders: impl IntoIterator<Item = &'a Path>) -> anyhow::Result<OsString> {
    let others = std::env::var_os("PATH").unwrap_or_default();
    let folders = folders.into_iter().map(Path::to_path_buf);
    Ok(std::env::join_paths(folders.chain(std::env::split_paths(&others)))?)
}

/// pytest in `folder`, in which no package must lie that could be taken for the installed one.
pub fn pytest(python: &Path, folder: &Path) -> Command {
    let mut pytest = Command::new(python);
    pytest.args(["-B", "-m", "pytest", "-p", "no:cacheprovider"]);
    pytest.current_dir(folder).env("PYTHONSAFEPATH", "1");
    pytest
}

/// Runs `pytest` and counts its tests.
pub fn counts(pytest: &mut Command) -> anyhow::Result<Counts> {
    let done = pytest.output().context("cannot start pytest")?;
    let said = String::from_utf8_lossy(&done.stdout);
    eprintln!("{said}");
    let counts = closing_line(&said).ok_or_else(|| anyhow!("pytest ended with {}", done.status))?;
    ensure!(done.status.success() || counts.failed > 0, "pytest ended with {}", done.status);
    Ok(counts)
}

/// The counts in the last line: `==== 1 failed, 73 passed, 2 skipped in 15.23s ====`.
fn closing_line(said: &str) -> Option<Counts> {
    let line = said.lines().rfind(|line| line.contains(" in "))?;
    let (counts, _) = line.trim_matches(['=', ' ']).split_once(" in ")?;
    let count = |names: &[&str]| {
        let parts = counts.split(", ").filter_map(|part| part.split_once(' '));
        let found = parts.filter(|(_, name)| names.contains(name));
        found.filter_map(|(number, _)| number.parse::<u64>().ok()).sum()
    };
    let (passed, failed) = (count(&["passed"]), count(&["failed", "error", "errors"]));
    let counts = Counts { passed, failed, skipped: count(&["skipped", "deselected"]) };
    (counts != Counts::default()).then_some(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closing_line_tells_what_passed_failed_and_was_skipped() {
        let counts = |line| closing_line(&format!("one line in 2 parts\n{line}\n"));
        let told = Counts { passed: 73, failed: 2, skipped: 5 };
        let line = "=== 1 failed, 73 passed, 1 skipped, 4 deselected, 3 warnings, 1 error in \
                    15.23s (0:00:15) ===";
        assert_eq!(counts(line), Some(told));
        assert_eq!(counts("74 passed in 15.36s").map(|counts| counts.passed), Some(74));
        assert_eq!(counts("no tests ran in 0.01s"), None);
    }
}
