//! The Python package: its tests run in an environment that has nothing else of ours, with the extension
//! module of the other tests' build, or with the wheel as it is built for a release.

use super::meanwhile::{Meanwhile, nice};
use super::peers::interpreter;
use super::python_module;
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow, bail, ensure};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::JoinHandle;
use xtask::pi_target;
use xtask::venv::{self, Environment, cache_dir, succeeds};
use xtask::workspace::{library, need_standard_library, output, root};

/// The packages that build and check wheels.
const BUILD: Environment<'_> = Environment {
    name: "python-build-venv",
    requirements: "python/requirements-build.txt",
    size: "about 100 MB",
};

const TESTS_NEED: &str = "python/tests/requirements.txt";

/// The systems that a wheel for Linux runs on: all since glibc 2.28.
const PLATFORM: &str = "manylinux_2_28";

const AARCH64: &str = "aarch64-unknown-linux-gnu";

/// The target of the wheel for this processor.
pub const NATIVE: &str =
    if cfg!(target_arch = "aarch64") { AARCH64 } else { "x86_64-unknown-linux-gnu" };

pub struct Wheel {
    /// An interpreter, which has the packages of [`BUILD`] if the wheel is one for a release.
    pub tools: PathBuf,
    pub file: PathBuf,
}

/// A build in the background. The outer error is the reason why none can run here.
pub type Build = JoinHandle<Result<anyhow::Result<Wheel>, String>>;

/// Starts to build the wheel in the background. Other systems build theirs for a release.
pub fn build_meanwhile(install: bool) -> Build {
    std::thread::spawn(move || {
        if !cfg!(target_os = "linux") {
            return Err("wheels are tested on Linux".to_owned());
        }
        Ok(build(interpreter(&BUILD, install)?, NATIVE, "release"))
    })
}

/// Tests the package, with PyTorch of PyPI if `with_pytorch` is set: the wheel that is being built, or
/// else the module of the tests' build. Returns the wheel, or the reason for its absence.
pub fn run(
    summary: &mut Summary,
    building: Option<Build>,
    with_pytorch: bool,
) -> Result<Wheel, String> {
    let mut wheel = Err("its wheel was not built".to_owned());
    summary.step("python", |summary| {
        let (built, checks) = match building.map(Build::join) {
            None => (pack_module()?, Counts::default()),
            Some(Ok(Ok(built))) => {
                let built = built?;
                let checks = audit(&built)?;
                (built, checks)
            }
            Some(Ok(Err(cause))) => return Ok(summary.skip("python", 1, &cause)),
            Some(Err(_)) => bail!("the thread that builds the wheel panicked"),
        };
        let folder = cache_dir().join("python-test-venv");
        venv::make(&built.tools, &folder, &["--without-pip"]).map_err(|cause| anyhow!(cause))?;
        let mut requirements = vec![TESTS_NEED];
        if with_pytorch {
            requirements.push("python/tests/torch-requirements.txt");
        }
        let counts = test(&built, &folder, &requirements, "");
        wheel = Ok(built);
        Ok(checks.and(counts?))
    });
    wheel
}

/// Packs the module of the tests' build and the package's sources into a wheel for this machine.
fn pack_module() -> anyhow::Result<Wheel> {
    let mut cargo = python_module();
    let messages = output(cargo.args(["--message-format", "json-render-diagnostics"]))?;
    let module = library(&messages, "_edgepuck")?;
    let tools = PathBuf::from(venv::any_python().map_err(|cause| anyhow!(cause))?);
    let mut pack = Command::new(&tools);
    pack.arg(root().join("xtask/module-wheel.py"))
        .arg(module)
        .arg(cache_dir().join("module-wheel"));
    let file = PathBuf::from(output(&mut pack)?.trim());
    Ok(Wheel { tools, file })
}

/// Builds the wheel for aarch64 as for a release, and tests it in an emulator if there is one.
pub fn run_emulated(summary: &mut Summary) {
    let name = "wheel for aarch64";
    summary.step(name, |summary| {
        if NATIVE == AARCH64 {
            let reason = "this processor is an aarch64, so `cargo xtask test` tests it";
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
        let wheel = build(tools, AARCH64, "dist")?;
        Ok(audit(&wheel)?.and(test(&wheel, &folder, &[TESTS_NEED], tests)?))
    });
}

/// Makes `folder` an environment of an emulated Python. Returns the interpreter that builds wheels.
fn prepare_emulated(emulator: &Command, folder: &Path) -> anyhow::Result<PathBuf> {
    need_standard_library(AARCH64)?;
    let mut make = Command::new("sh");
    make.arg(root().join("xtask/emulated-python.sh")).arg(folder);
    succeeds(make.arg(emulator.get_program()).args(emulator.get_args()))
        .and_then(|()| interpreter(&BUILD, true))
        .map_err(|cause| anyhow!(cause))
}

/// Builds the wheel for `target`, for Python 3.10 and later, with a `profile` of Cargo.
fn build(tools: PathBuf, target: &str, profile: &str) -> anyhow::Result<Wheel> {
    let wheels = cache_dir().join("wheels");
    if wheels.exists() {
        fs::remove_dir_all(&wheels).with_context(|| wheels.display().to_string())?;
    }
    let mut maturin = Command::new(&tools);
    maturin.args(["-m", "maturin", "build", "--profile", profile, "--zig", "--locked"]);
    maturin.args(["--compatibility", PLATFORM, "--target", target, "--out"]).arg(&wheels);
    maturin.arg("--manifest-path").arg(root().join("python/Cargo.toml"));
    // maturin asks the first Python on the path for zig.
    maturin.env("PATH", path_behind(tools.parent())?);
    let (status, log) = Meanwhile::start("wheel-build", &mut nice(&maturin))?.end()?;
    ensure!(status.success(), "maturin: {status}\n{log}");
    let built = fs::read_dir(&wheels).with_context(|| wheels.display().to_string())?;
    let file = built.filter_map(|entry| Some(entry.ok()?.path())).next();
    let file = file.ok_or_else(|| anyhow!("{}: expected a wheel, found none", wheels.display()))?;
    Ok(Wheel { tools, file })
}

/// Checks that the wheel runs on the versions of Python and the systems that its name states.
fn audit(wheel: &Wheel) -> anyhow::Result<Counts> {
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

/// Tests the wheel in the environment `folder`, away from the package's source. `tests` selects tests as
/// pytest's option `-k` does; if it is empty, all run.
fn test(
    wheel: &Wheel,
    folder: &Path,
    requirements: &[&str],
    tests: &str,
) -> anyhow::Result<Counts> {
    let python = folder.join("bin/python");
    wheel.install(&python, requirements)?;
    let mut pytest = pytest(&python, folder);
    // `edgepuck.torch` alone needs PyTorch.
    pytest.args(["--doctest-modules", "--doctest-ignore-import-errors", "-k", tests]);
    pytest.arg(root().join("python/tests")).args(["--pyargs", "edgepuck"]);
    counts(&mut pytest)
}

impl Wheel {
    /// Installs it, and the packages of these lists, for the interpreter `python`.
    pub fn install(&self, python: &Path, requirements: &[&str]) -> anyhow::Result<()> {
        let lists = requirements.iter().flat_map(|list| ["-r".into(), root().join(list).into()]);
        let words = std::iter::once(self.file.clone().into()).chain(lists);
        venv::install(python, words).map_err(|cause| anyhow!(cause))
    }
}

/// The variable `PATH` with `folders` before all others.
pub fn path_behind<'a>(folders: impl IntoIterator<Item = &'a Path>) -> anyhow::Result<OsString> {
    let others = std::env::var_os("PATH").unwrap_or_default();
    let folders = folders.into_iter().map(Path::to_path_buf);
    Ok(std::env::join_paths(folders.chain(std::env::split_paths(&others)))?)
}

/// pytest in `folder`, which must not contain a package with the name of an installed one.
pub fn pytest(python: &Path, folder: &Path) -> Command {
    let mut pytest = Command::new(python);
    pytest.args(["-m", "pytest", "-p", "no:cacheprovider"]);
    pytest.current_dir(folder).env("PYTHONSAFEPATH", "1");
    pytest.env("PYTHONPYCACHEPREFIX", cache_dir().join("pycache"));
    pytest
}

pub fn counts(pytest: &mut Command) -> anyhow::Result<Counts> {
    let done = pytest.output().context("cannot start pytest")?;
    let printed = String::from_utf8_lossy(&done.stdout);
    eprintln!("{printed}");
    let counts =
        closing_line(&printed).ok_or_else(|| anyhow!("pytest ended with {}", done.status))?;
    ensure!(done.status.success() || counts.failed > 0, "pytest ended with {}", done.status);
    Ok(counts)
}

/// The counts in the last line: `==== 1 failed, 73 passed, 2 skipped in 15.23s ====`.
fn closing_line(printed: &str) -> Option<Counts> {
    let line = printed.lines().rfind(|line| line.contains(" in "))?;
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
    fn the_closing_line_has_the_counts() {
        let counts = |line| closing_line(&format!("one line in 2 parts\n{line}\n"));
        let expected = Counts { passed: 73, failed: 2, skipped: 5 };
        let line = "=== 1 failed, 73 passed, 1 skipped, 4 deselected, 3 warnings, 1 error in \
                    15.23s (0:00:15) ===";
        assert_eq!(counts(line), Some(expected));
        assert_eq!(counts("74 passed in 15.36s").map(|counts| counts.passed), Some(74));
        assert_eq!(counts("no tests ran in 0.01s"), None);
    }
}
