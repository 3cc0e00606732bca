//! Proof against software nobody here wrote: the scripts in `tests/peers`.
//!
//! Each runs alone, by Python, in an environment of pinned packages from PyPI,
//! and is told by `EDGEPUCK_PROGRAM`, `EDGEPUCK_LAB` and `EDGEPUCK_INFER` where our programs are,
//! by `EDGEPUCK_ROOT` where the workspace is, and by `EDGEPUCK_OUT` an empty
//! folder. It ends with 0 if all is well and with [`SKIPPED`] if it cannot run
//! here. A script `x.py` shares the packages of `requirements.txt`, unless there
//! is an `x-requirements.txt`: packages too large for every run.

use super::cargo_on_all;
use crate::summary::{Counts, Summary};
use anyhow::Context;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::JoinHandle;
use xtask::venv::{Environment, cache_dir};
use xtask::workspace::{output, root};

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

/// The environments of packages: what scripts are run by.
pub struct Packages {
    which: Which,
    /// Whether packages may be fetched.
    install: bool,
    /// Fetches those that most scripts share.
    shared: JoinHandle<Result<PathBuf, String>>,
}

impl Packages {
    /// Begins to fetch the packages that most scripts share, which takes
    /// minutes, while other steps compile.
    pub fn fetch_meanwhile(which: Which, install: bool) -> Self {
        let fetch = move || match which {
            Which::None => Err("--peers none asks for none".to_owned()),
            Which::Light | Which::All => interpreter(&SHARED, install),
        };
        Self { which, install, shared: std::thread::spawn(fetch) }
    }

    /// The interpreter that has the packages of most scripts, or why there is none.
    fn shared(self) -> (Result<PathBuf, String>, Large) {
        let large = Large { which: self.which, install: self.install };
        (self.shared.join().unwrap_or_else(|_| Err("fetching them panicked".to_owned())), large)
    }
}

/// The packages that single scripts need.
struct Large {
    which: Which,
    install: bool,
}

impl Large {
    /// The interpreter that has what script `name` imports; `None` if it needs
    /// what most scripts do.
    fn of(&self, name: &str) -> Option<Result<PathBuf, String>> {
        let requirements = format!("{SCRIPTS}/{name}-requirements.txt");
        if !root().join(&requirements).exists() {
            return None;
        }
        if self.which != Which::All {
            return Some(Err("its packages are large; --peers all runs it".to_owned()));
        }
        let folder = format!("tests-{name}-venv");
        let size = "some 5 GB";
        let environment = Environment { name: &folder, requirements: &requirements, size };
        Some(interpreter(&environment, self.install))
    }
}

fn interpreter(environment: &Environment<'_>, install: bool) -> Result<PathBuf, String> {
    match install {
        true => environment.interpreter(),
        false => environment.made()?.ok_or_else(|| "its packages are missing".to_owned()),
    }
}

/// Runs the scripts. A script whose packages are missing is skipped, and named.
pub fn run(summary: &mut Summary, packages: Packages) {
    summary.step("peers", |summary| {
        let scripts = scripts()?;
        if packages.which == Which::None {
            let n = scripts.len() as u64;
            summary.remark(format!("peers: {n} SKIPPED, as --peers none asks for"));
            return Ok(Counts { skipped: n, ..Counts::default() });
        }
        let programs = programs()?;
        let (shared, large) = packages.shared();
        let mut counts = Counts::default();
        for script in scripts {
            let name = script.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let python = large.of(&name).unwrap_or_else(|| shared.clone());
            counts = counts.and(match python {
                Ok(python) => check(summary, &name, &script, &python, &programs)?,
                Err(cause) => {
                    summary.remark(format!("peer {name}: SKIPPED, {cause}"));
                    Counts::SKIPPED
                }
            });
        }
        Ok(counts)
    });
}

fn check(
    summary: &mut Summary,
    name: &str,
    script: &Path,
    python: &Path,
    programs: &Programs,
) -> anyhow::Result<Counts> {
    let out = cache_dir().join("tests").join(name);
    empty(&out)?;
    eprintln!("== peer {name}: {SCRIPTS}/{name}.py");
    // -B keeps compiled files from lying beside the scripts.
    let mut command = Command::new(python);
    command.arg("-B").arg(script).current_dir(&out);
    // Scripts are named after packages, which must not be taken for them.
    command.env("PYTHONSAFEPATH", "1");
    for (variable, program) in programs {
        command.env(variable, program);
    }
    command.env("EDGEPUCK_ROOT", root()).env("EDGEPUCK_OUT", &out);
    let status = command.status().with_context(|| format!("cannot run {}", script.display()))?;
    Ok(match status.code() {
        Some(0) => Counts::PASSED,
        Some(SKIPPED) => {
            summary.remark(format!("peer {name}: SKIPPED, it said why"));
            Counts::SKIPPED
        }
        _ => {
            summary.remark(format!("peer {name}: FAILED, {status}"));
            Counts::FAILED
        }
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

/// The variables that tell scripts of our programs, and the programs.
type Programs = [(&'static str, PathBuf); 3];

/// Our programs as the tests have built them: nothing is built for the peers alone.
fn programs() -> anyhow::Result<Programs> {
    let mut cargo = cargo_on_all(&["test", "--no-run"]);
    cargo.args(["--message-format", "json-render-diagnostics"]);
    let messages = output(cargo.stderr(Stdio::inherit()))?;
    let built =
        |name: &str| program(&messages, name).with_context(|| format!("no test has built {name}"));
    Ok([
        ("EDGEPUCK_PROGRAM", built("edgepuck")?),
        ("EDGEPUCK_LAB", built("edgepuck-lab")?),
        ("EDGEPUCK_INFER", built("infer-cpu")?),
    ])
}

/// The program `name` among Cargo's `messages`, one JSON object a line.
fn program(messages: &str, name: &str) -> Option<PathBuf> {
    let messages = messages.lines().filter_map(|m| serde_json::from_str::<Value>(m).ok());
    let mut programs = messages.filter(|message| {
        let target = &message["target"];
        let is_test = message["profile"]["test"].as_bool().unwrap_or(false);
        target["name"] == name && target["kind"][0] == "bin" && !is_test
    });
    programs.find_map(|message| Some(message["executable"].as_str()?.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_found_among_tests_and_libraries_of_its_name() {
        let messages = r#"{"reason":"build-script-executed"}
{"target":{"kind":["lib"],"name":"a"},"profile":{"test":false},"executable":null}
{"target":{"kind":["bin"],"name":"a"},"profile":{"test":true},"executable":"/t/deps/a-1"}
{"target":{"kind":["bin"],"name":"a"},"profile":{"test":false},"executable":"/t/a"}
not JSON"#;
        assert_eq!(program(messages, "a"), Some(PathBuf::from("/t/a")));
        assert_eq!(program(messages, "b"), None);
    }
}
