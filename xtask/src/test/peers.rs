//! The scripts in `tests/peers`, which compare our programs with other software.
//!
//! Python runs each script in an environment of pinned packages from PyPI. `EDGEPUCK_PROGRAM`,
//! `EDGEPUCK_INFER` and `EDGEPUCK_ROS2` are our programs, `EDGEPUCK_OUT` is an empty
//! folder, and [`SUPPORT`] is on `PYTHONPATH`. A script exits with 0 on success and with
//! [`SKIPPED`] if it cannot run here. A script `x.py` uses the packages of `requirements.txt`, or
//! those of `x-requirements.txt` if it exists: they conflict with the others.

use super::{compile_all, meanwhile::Meanwhile};
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::thread::JoinHandle;
use xtask::venv::{Environment, cache_dir};
use xtask::workspace::{executable, output, root};

const SCRIPTS: &str = "tests/peers";

/// The folder of the module that all scripts share.
const SUPPORT: &str = "tests/peers/support";

/// The exit code of a script that cannot run, after it has printed the reason.
const SKIPPED: i32 = 77;

/// The packages of most scripts.
const SHARED: Environment<'_> = Environment {
    name: "tests-venv",
    requirements: "tests/peers/requirements.txt",
    size: "about 1.5 GB",
};

/// The scripts that `--all` runs: what brings datasets and programs to other systems, on which no
/// arithmetic depends.
const SELDOM: [&str; 6] =
    ["croissant", "debian_package", "hyperqueue", "kubernetes", "s3", "slurm"];

/// Which scripts are run.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Which {
    /// No comparison.
    None,
    /// Most comparisons.
    Light,
    /// All comparisons, and the tests of the Python package with PyTorch of PyPI.
    All,
}

/// The interpreter that has a script's packages, or the reason why it cannot be had.
pub type Python = Result<PathBuf, String>;

/// The environments that scripts run in.
pub struct Packages {
    which: Which,
    /// Whether packages may be downloaded.
    install: bool,
    /// Downloads the packages that most scripts share.
    shared: JoinHandle<Python>,
}

impl Packages {
    /// Starts to download the packages that most scripts share, while other steps compile.
    pub fn fetch_meanwhile(which: Which, install: bool) -> Self {
        let fetch = move || match which {
            Which::None => Err("--peers none was given".to_owned()),
            Which::Light | Which::All => interpreter(&SHARED, install),
        };
        Self { which, install, shared: std::thread::spawn(fetch) }
    }
}

/// The interpreter of script `name`; `None` if it uses the shared packages.
fn python_of(name: &str, install: bool) -> Option<Python> {
    let requirements = format!("{SCRIPTS}/{name}-requirements.txt");
    if !root().join(&requirements).exists() {
        return None;
    }
    let (folder, size) = (format!("tests-{name}-venv"), "about 400 MB");
    Some(interpreter(&Environment { name: &folder, requirements: &requirements, size }, install))
}

/// The interpreter of `environment`, which is made first if `install` allows it.
pub fn interpreter(environment: &Environment<'_>, install: bool) -> Python {
    match install {
        true => environment.interpreter(),
        false => environment.made()?.ok_or_else(|| "its packages are missing".to_owned()),
    }
}

/// Runs the scripts, two at a time, because each waits for files, sockets and other programs. A
/// script whose packages are missing is skipped and reported. Those that seldom find a fault run with `all`.
pub fn run(
    summary: &mut Summary,
    packages: Packages,
    programs: &anyhow::Result<Programs>,
    all: bool,
) {
    summary.step("peers", |summary| {
        let mut scripts = scripts()?;
        let is_seldom =
            |script: &Path| SELDOM.iter().any(|name| script.ends_with(format!("{name}.py")));
        scripts.retain(|script| all || !is_seldom(script));
        let Packages { which, install, shared } = packages;
        if which == Which::None {
            return Ok(summary.skip("peers", scripts.len(), "--peers none was given"));
        }
        let programs = programs.as_ref().map_err(|cause| anyhow!("{cause:#}"))?;
        let shared = shared.join().unwrap_or_else(|_| Err("fetching them panicked".to_owned()));
        let (scripts, summary) = (Mutex::new(scripts.into_iter()), Mutex::new(summary));
        let next = || scripts.lock().ok()?.next();
        let work = || {
            std::iter::from_fn(next).try_fold(Counts::default(), |counts, script| {
                let name = script.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let python = python_of(&name, install).unwrap_or_else(|| shared.clone());
                Ok(counts.and(check(&summary, &name, &script, python, programs)?))
            })
        };
        std::thread::scope(|scope| {
            let other = scope.spawn(work);
            let counts: anyhow::Result<Counts> = work();
            Ok(counts?.and(other.join().map_err(|_| anyhow!("a thread panicked"))??))
        })
    });
}

fn check(
    summary: &Mutex<&mut Summary>,
    name: &str,
    script: &Path,
    python: Python,
    programs: &Programs,
) -> anyhow::Result<Counts> {
    let peer = format!("peer {name}");
    let summary = || summary.lock().expect("invariant: nothing panics with the lock");
    let python = match python {
        Ok(python) => python,
        Err(cause) => return Ok(summary().skip(&peer, 1, &cause)),
    };
    let out = cache_dir().join("tests").join(name);
    if out.exists() {
        fs::remove_dir_all(&out).with_context(|| out.display().to_string())?;
    }
    fs::create_dir_all(&out).with_context(|| out.display().to_string())?;
    let mut command = Command::new(python);
    command.arg(script).current_dir(&out);
    // Compiled files must not lie beside the scripts.
    command.env("PYTHONPYCACHEPREFIX", cache_dir().join("pycache"));
    command.env("PYTHONPATH", root().join(SUPPORT)).env("EDGEPUCK_OUT", &out);
    command.env("EDGEPUCK_PROGRAM", &programs.edgepuck);
    command.env("EDGEPUCK_INFER", &programs.infer_cpu).env("EDGEPUCK_ROS2", &programs.ros2);
    let (status, said) = Meanwhile::start(&format!("peer-{name}"), &mut command)?.end()?;
    eprintln!("== {peer}: {SCRIPTS}/{name}.py\n{said}");
    Ok(match status.code() {
        Some(0) => Counts::PASSED,
        Some(SKIPPED) => summary().skip(&peer, 1, "it printed the reason"),
        _ => {
            summary().remark(format!("{peer}: FAILED, {status}"));
            Counts::FAILED
        }
    })
}

fn scripts() -> anyhow::Result<Vec<PathBuf>> {
    let folder = root().join(SCRIPTS);
    let entries = fs::read_dir(&folder).with_context(|| folder.display().to_string())?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let mut scripts = paths.collect::<Result<Vec<_>, _>>()?;
    scripts.retain(|path| path.extension().is_some_and(|extension| extension == "py"));
    scripts.sort();
    Ok(scripts)
}

/// Our programs as the tests have built them: nothing is built for the peers alone.
pub struct Programs {
    pub edgepuck: PathBuf,
    pub infer_cpu: PathBuf,
    pub ros2: PathBuf,
    /// The example of `web` that writes what a page must find.
    pub traced: PathBuf,
}

pub fn programs() -> anyhow::Result<Programs> {
    let mut cargo = compile_all(&["test", "--no-run"]);
    cargo.args(["--message-format", "json-render-diagnostics"]).stderr(Stdio::inherit());
    let messages = output(&mut cargo)?;
    Ok(Programs {
        edgepuck: executable(&messages, "bin", "edgepuck")?,
        infer_cpu: executable(&messages, "bin", "infer-cpu")?,
        ros2: executable(&messages, "bin", "edgepuck-ros2")?,
        traced: executable(&messages, "example", "traced")?,
    })
}
