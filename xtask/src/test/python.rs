//! The Python package: a wheel is built and judged, and its tests run in an environment that has
//! nothing else of ours.

use super::docs;
use super::peers::interpreter;
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use xtask::venv::{Environment, cache_dir, succeeds};
use xtask::workspace::{output, root};

/// What builds wheels and judges them.
const BUILD: Environment<'_> = Environment {
    name: "python-build-venv",
    requirements: "python/requirements-build.txt",
    size: "some 100 MB",
};

/// The systems that a wheel of Linux runs on: all since glibc 2.28.
const PLATFORM: &str = "manylinux_2_28";

/// The target that the wheel is built for.
#[cfg(target_arch = "aarch64")]
const TARGET: &str = "aarch64-unknown-linux-gnu";
#[cfg(not(target_arch = "aarch64"))]
const TARGET: &str = "x86_64-unknown-linux-gnu";

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
        let built = build(&tools)?;
        let counts = judge(&built)?;
        let counts = counts.and(run_tests(&built, with_pytorch)?);
        wheel = Ok(built);
        Ok(counts)
    });
    summary.step("documentation's examples", |summary| match &wheel {
        Ok(wheel) => docs::run_blocks(wheel),
        Err(cause) => Ok(summary.skip("documentation's examples", 1, cause)),
    });
}

/// Checks that the wheel runs on the Pythons and the systems that its name promises.
fn judge(wheel: &Wheel) -> anyhow::Result<Counts> {
    let mut abi3audit = Command::new(&wheel.tools);
    abi3audit.args(["-m", "abi3audit", "--strict"]).arg(&wheel.file);
    succeeds(&mut abi3audit).map_err(|cause| anyhow!(cause))?;
    let mut auditwheel = Command::new(&wheel.tools);
    let shown = output(auditwheel.args(["-m", "auditwheel", "show"]).arg(&wheel.file))?;
    ensure!(
        shown.split_whitespace().collect::<Vec<_>>().join(" ").contains(PLATFORM),
        "auditwheel: expected a wheel for {PLATFORM}, found: {shown}"
    );
    Ok(Counts { passed: 2, ..Counts::default() })
}

/// The wheel, for Pythons from 3.10 on.
fn build(tools: &Path) -> anyhow::Result<Wheel> {
    let wheels = cache_dir().join("wheels");
    if wheels.exists() {
        fs::remove_dir_all(&wheels).with_context(|| wheels.display().to_string())?;
    }
    let mut maturin = Command::new(tools);
    maturin.args(["-m", "maturin", "build", "--release", "--zig", "--locked"]);
    maturin.args(["--compatibility", PLATFORM, "--target", TARGET, "--out"]).arg(&wheels);
    maturin.arg("--manifest-path").arg(root().join("python/Cargo.toml"));
    // maturin asks the first Python on the path for zig.
    let own = tools.parent().into_iter().map(Path::to_path_buf);
    let others = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(own.chain(std::env::split_paths(&others)))?;
    maturin.env("PATH", path);
    let status = maturin.status().context("cannot start maturin")?;
    ensure!(status.success(), "maturin: {status}");
    let built = fs::read_dir(&wheels).with_context(|| wheels.display().to_string())?;
    let mut built = built.filter_map(|entry| Some(entry.ok()?.path()));
    let file = built.next();
    let file = file.ok_or_else(|| anyhow!("{}: expected a wheel, found none", wheels.display()))?;
    Ok(Wheel { tools: tools.to_path_buf(), file })
}

/// The tests of the wheel in a new environment, away from the package's source.
fn run_tests(wheel: &Wheel, with_pytorch: bool) -> anyhow::Result<Counts> {
    let folder = cache_dir().join("python-test-venv");
    let made = Command::new(&wheel.tools).args(["-m", "venv", "--clear"]).arg(&folder).status()?;
    ensure!(made.success(), "{}: the environment cannot be made", folder.display());
    let python = folder.join("bin/python");
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    install.arg(&wheel.file).arg("-r").arg(root().join("python/tests/requirements.txt"));
    if with_pytorch {
        install.arg("-r").arg(root().join("tests/peers/pytorch-requirements.txt"));
    }
    succeeds(&mut install).map_err(|cause| anyhow!(cause))?;

    let mut tests = pytest(&python, &folder);
    tests.arg("--doctest-modules");
    // `edgepuck.torch` alone needs PyTorch.
    tests.arg("--doctest-ignore-import-errors");
    tests.arg(root().join("python/tests")).args(["--pyargs", "edgepuck"]);
    counts(&mut tests)
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
    let counts = Counts { passed, failed, skipped: count(&["skipped"]) };
    (counts != Counts::default()).then_some(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closing_line_tells_what_passed_failed_and_was_skipped() {
        let counts = |line| closing_line(&format!("one line in 2 parts\n{line}\n"));
        let told = Counts { passed: 73, failed: 2, skipped: 1 };
        let line =
            "=== 1 failed, 73 passed, 1 skipped, 3 warnings, 1 error in 15.23s (0:00:15) ===";
        assert_eq!(counts(line), Some(told));
        assert_eq!(counts("74 passed in 15.36s").map(|counts| counts.passed), Some(74));
        assert_eq!(counts("no tests ran in 0.01s"), None);
    }
}
