//! The scripts in `tests/peers`, which compare our programs with other software.
//!
//! Python runs each in an environment of pinned packages from PyPI. `EDGEPUCK_PROGRAM`,
//! `EDGEPUCK_LAB`, `EDGEPUCK_INFER` and `EDGEPUCK_ROS2` are our programs, `EDGEPUCK_OUT` is an empty
//! folder, and [`SUPPORT`] is on `PYTHONPATH`. It ends with 0 if all is well and with [`SKIPPED`]
//! if it cannot run here. A script `x.py` uses the packages of `requirements.txt`, unless there is
//! an `x-requirements.txt`: of packages that others do not go with, or that are very large.

use super::{cargo_on_all, cargo_on_lab, meanwhile::Meanwhile};
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::thread::JoinHandle;
use xtask::venv::{Environment, cache_dir};
use xtask::workspace::{LAB, executable, output, root};

/// The folder of the scripts.
const SCRIPTS: &str = "tests/peers";

/// The folder of the module that they share.
const SUPPORT: &str = "tests/peers/support";

/// What a script ends with that cannot run, having said why.
const SKIPPED: i32 = 77;

/// The packages of most scripts.
const SHARED: Environment<'_> = Environment {
    name: "tests-venv",
    requirements: "tests/peers/requirements.txt",
    size: "some 1.5 GB",
};

/// Which scripts are run.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Which {
    /// No comparison.
    None,
    /// All comparisons except that with PyTorch.
    Light,
    /// All comparisons, including that with PyTorch.
    All,
}

/// The interpreter that has a script's packages, or why there is none.
pub type Python = Result<PathBuf, String>;

/// The environments of packages by which scripts are run.
pub struct Packages {
    which: Which,
    /// Whether packages may be fetched.
    install: bool,
    /// Fetches the packages that most scripts share.
    shared: JoinHandle<Python>,
}

impl Packages {
    /// Begins to fetch what most scripts share, which takes minutes, while other steps compile.
    pub fn fetch_meanwhile(which: Which, install: bool) -> Self {
        let fetch = move || match which {
            Which::None => Err("--peers none asks for none".to_owned()),
            Which::Light | Which::All => interpreter(&SHARED, install),
        };
        Self { which, install, shared: std::thread::spawn(fetch) }
    }
}

/// The interpreter of script `name`; `None` if it needs only what most scripts share.
fn python_of(name: &str, which: Which, install: bool) -> Option<Python> {
    let requirements = format!("{SCRIPTS}/{name}-requirements.txt");
    if !root().join(&requirements).exists() {
        return None;
    }
    let is_large = name == "pytorch";
    if is_large && which != Which::All {
        return Some(Err("its packages are large; --peers all runs it".to_owned()));
    }
    let size = if is_large { "some 5 GB" } else { "some 400 MB" };
    let folder = format!("tests-{name}-venv");
    Some(interpreter(&Environment { name: &folder, requirements: &requirements, size }, install))
}

/// The interpreter of `environment`, which is made if it may be.
pub fn interpreter(environment: &Environment<'_>, install: bool) -> Python {
    match install {
        true => environment.interpreter(),
        false => environment.made()?.ok_or_else(|| "its packages are missing".to_owned()),
    }
}

/// Runs the scripts, two at a time: each waits for files, sockets and other programs.
/// A script whose packages are missing is skipped, and named.
pub fn run(summary: &mut Summary, packages: Packages) {
    summary.step("peers", |summary| {
        let scripts = scripts()?;
        let Packages { which, install, shared } = packages;
        if which == Which::None {
            return Ok(summary.skip("peers", scripts.len(), "--peers none asks for none"));
        }
        let programs = programs()?;
        let shared = shared.join().unwrap_or_else(|_| Err("fetching them panicked".to_owned()));
        let (scripts, summary) = (Mutex::new(scripts.into_iter()), Mutex::new(summary));
        let next = || scripts.lock().ok()?.next();
        let work = || {
            std::iter::from_fn(next).try_fold(Counts::default(), |counts, script| {
                let name = script.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let python = python_of(&name, which, install).unwrap_or_else(|| shared.clone());
                Ok(counts.and(check(&summary, &name, &script, python, &programs)?))
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
    // -B keeps compiled files from lying beside the scripts.
    let mut command = Command::new(python);
    command.arg("-B").arg(script).current_dir(&out);
    command.env("PYTHONPATH", root().join(SUPPORT)).env("EDGEPUCK_OUT", &out);
    command.envs(programs.iter().map(|(variable, program)| (variable, program)));
    let (status, said) = Meanwhile::start(&format!("peer-{name}"), &mut command)?.end()?;
    eprintln!("== {peer}: {SCRIPTS}/{name}.py\n{said}");
    Ok(match status.code() {
        Some(0) => Counts::PASSED,
        Some(SKIPPED) => summary().skip(&peer, 1, "it said why"),
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

/// The variables that tell scripts of our programs, and the programs.
pub type Programs = [(&'static str, PathBuf); 4];

/// Our programs as the tests have built them: nothing is built for the peers alone.
pub fn programs() -> anyhow::Result<Programs> {
    let built = |cargo: fn(&[&str]) -> Command| {
        let mut cargo = cargo(&["test", "--no-run", "--message-format", "json-render-diagnostics"]);
        output(cargo.stderr(Stdio::inherit()))
    };
    let messages = built(cargo_on_all)?;
    Ok([
        ("EDGEPUCK_PROGRAM", executable(&messages, "edgepuck")?),
        ("EDGEPUCK_LAB", executable(&built(cargo_on_lab)?, LAB)?),
        ("EDGEPUCK_INFER", executable(&messages, "infer-cpu")?),
        ("EDGEPUCK_ROS2", executable(&messages, "edgepuck-ros2")?),
    ])
}
