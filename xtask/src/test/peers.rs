//! Proof against software nobody here wrote: the scripts in `tests/peers`.
//!
//! Each runs alone, by Python, in an environment of pinned packages from PyPI,
//! and is told by `EDGEPUCK_XTASK` and `EDGEPUCK_INFER` where our programs are,
//! by `EDGEPUCK_ROOT` where the workspace is, and by `EDGEPUCK_OUT` an empty
//! folder. It ends with 0 if all is well and with [`SKIPPED`] if it cannot run
//! here. A script `x.py` shares the packages of `requirements.txt`, unless there
//! is an `x-requirements.txt`: packages too large for every run.

use crate::venv::{Environment, workshop};
use crate::workspace::{executable, output, root};
use anyhow::{Context, bail};
use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use std::{env, fs};

/// The folder of the scripts.
const SCRIPTS: &str = "tests/peers";

/// What a script ends with that cannot run, having said why.
const SKIPPED: i32 = 77;

/// The packages of most scripts.
const SHARED: Environment<'_> = Environment {
    name: "tests-venv",
    requirements: "tests/peers/requirements.txt",
    size: "some 750 MB",
};

/// Which scripts are run.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Which {
    /// None.
    None,
    /// Those that share one environment of packages.
    Light,
    /// All.
    All,
}

/// Runs the scripts; `install` lets packages be fetched.
///
/// # Errors
/// One that fails; one that cannot be run is named and passed over.
pub fn run(which: Which, install: bool) -> anyhow::Result<()> {
    if which == Which::None {
        eprintln!("== peers: SKIPPED, as --peers none asks for");
        return Ok(());
    }
    let infer = infer_cpu()?;
    let (start, mut failed) = (Instant::now(), Vec::new());
    let pythons = Pythons { which, install, shared: OnceCell::new() };
    for script in scripts()? {
        let name = script.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let ending = match pythons.of(&name) {
            Ok(python) => check(&name, &script, &python, &infer)?,
            Err(cause) => Ending::Skipped(cause),
        };
        match ending {
            Ending::Passed => {}
            Ending::Skipped(cause) => eprintln!("== peer {name}: SKIPPED, {cause}"),
            Ending::Failed => failed.push(name),
        }
    }
    eprintln!("== peers: {:.0} s", start.elapsed().as_secs_f64());
    match failed.is_empty() {
        true => Ok(()),
        false => bail!("we differ from these peers, or they failed: {}", failed.join(", ")),
    }
}

/// How a script ended.
enum Ending {
    Passed,
    Skipped(String),
    Failed,
}

/// Who runs scripts.
struct Pythons {
    which: Which,
    /// Whether packages may be fetched.
    install: bool,
    /// Tried once: without a network, giving up takes a while.
    shared: OnceCell<Result<PathBuf, String>>,
}

impl Pythons {
    /// The interpreter that has what script `name` imports, or why there is none.
    fn of(&self, name: &str) -> Result<PathBuf, String> {
        let requirements = format!("{SCRIPTS}/{name}-requirements.txt");
        if !root().join(&requirements).exists() {
            return self.shared.get_or_init(|| self.interpreter(&SHARED)).clone();
        }
        if self.which != Which::All {
            return Err("its packages are large; --peers all runs it".to_owned());
        }
        let folder = format!("tests-{name}-venv");
        let size = "some 5 GB";
        self.interpreter(&Environment { name: &folder, requirements: &requirements, size })
    }

    fn interpreter(&self, environment: &Environment<'_>) -> Result<PathBuf, String> {
        match self.install {
            true => environment.interpreter(),
            false => environment.made()?.ok_or_else(|| "its packages are missing".to_owned()),
        }
    }
}

fn check(name: &str, script: &Path, python: &Path, infer: &Path) -> anyhow::Result<Ending> {
    let out = workshop().join("tests").join(name);
    empty(&out)?;
    eprintln!("== peer {name}: {SCRIPTS}/{name}.py");
    // -B keeps compiled files from lying beside the scripts.
    let mut command = Command::new(python);
    command.arg("-B").arg(script).current_dir(&out);
    // Scripts are named after packages, which must not be taken for them.
    command.env("PYTHONSAFEPATH", "1");
    command.env("EDGEPUCK_XTASK", env::current_exe()?).env("EDGEPUCK_INFER", infer);
    command.env("EDGEPUCK_ROOT", root()).env("EDGEPUCK_OUT", &out);
    let status = command.status().with_context(|| format!("cannot run {}", script.display()))?;
    Ok(match status.code() {
        Some(0) => Ending::Passed,
        Some(SKIPPED) => Ending::Skipped("as it says above".to_owned()),
        _ => Ending::Failed,
    })
}

fn scripts() -> anyhow::Result<Vec<PathBuf>> {
    let folder = root().join(SCRIPTS);
    let entries = fs::read_dir(&folder).with_context(|| folder.display().to_string())?;
    let mut scripts = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<Vec<_>, _>>()
        .with_context(|| folder.display().to_string())?;
    scripts.retain(|path| path.extension().is_some_and(|extension| extension == "py"));
    scripts.sort();
    Ok(scripts)
}

fn empty(folder: &Path) -> anyhow::Result<()> {
    let here = || folder.display().to_string();
    if folder.exists() {
        fs::remove_dir_all(folder).with_context(here)?;
    }
    fs::create_dir_all(folder).with_context(here)
}

/// A release build of infer-cpu.
fn infer_cpu() -> anyhow::Result<PathBuf> {
    let words = ["build", "--release", "--package", "infer-cpu", "--bin", "infer-cpu"];
    let mut cargo = crate::workspace::cargo(&words);
    cargo.args(["--message-format", "json-render-diagnostics"]);
    executable(&output(cargo.stderr(Stdio::inherit()))?)
}
