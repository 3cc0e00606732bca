//! The Python environments that peers live in, made from PyPI on first use.

use crate::workspace::root;
use std::path::PathBuf;
use std::process::Command;

/// Tried in this order.
const PYTHONS: [&str; 3] = ["python3", "python", "py"];

/// The folder of the programs that `bench` runs, and their pinned packages.
pub fn programs() -> PathBuf {
    root().join("xtask/lab/peers")
}

/// The folder of what is made for the peers.
pub fn cache_dir() -> PathBuf {
    root().join("target/peers")
}

/// A Python environment.
pub struct Environment<'a> {
    /// Its folder's name.
    pub name: &'a str,
    /// The pinned packages, a file of the workspace.
    pub requirements: &'a str,
    /// What comes from PyPI, in words for the user.
    pub size: &'a str,
}

impl Environment<'_> {
    /// The interpreter of the environment, made under [`cache_dir`] unless it
    /// is there.
    ///
    /// # Errors
    /// Why there can be none, in words for the user.
    pub fn interpreter(&self) -> Result<PathBuf, String> {
        if let Some(interpreter) = self.made()? {
            return Ok(interpreter);
        }
        let folder = self.folder();
        let python = PYTHONS
            .into_iter()
            .find(|python| succeeds(Command::new(python).arg("--version")).is_ok())
            .ok_or("there is no Python here")?;
        eprintln!("making {} ({} from PyPI)", folder.display(), self.size);
        succeeds(Command::new(python).args(["-m", "venv"]).arg(&folder))?;
        let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        let interpreter = self.python();
        let requirements = root().join(self.requirements);
        succeeds(Command::new(&interpreter).args(install).arg(&requirements))?;
        std::fs::write(self.done(), self.pinned()?).map_err(|e| e.to_string())?;
        Ok(interpreter)
    }

    /// The interpreter, if the environment is there with these packages.
    ///
    /// # Errors
    /// The list of packages cannot be read.
    pub fn made(&self) -> Result<Option<PathBuf>, String> {
        let pinned = self.pinned()?;
        let is_made = std::fs::read_to_string(self.done()).is_ok_and(|found| found == pinned);
        Ok(is_made.then(|| self.python()))
    }

    fn folder(&self) -> PathBuf {
        cache_dir().join(self.name)
    }

    fn python(&self) -> PathBuf {
        self.folder().join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
    }

    /// What is written last, once all packages are there.
    fn done(&self) -> PathBuf {
        self.folder().join("edgepuck-requirements.txt")
    }

    fn pinned(&self) -> Result<String, String> {
        let file = root().join(self.requirements);
        std::fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))
    }
}

/// Runs `command` to its end.
///
/// # Errors
/// The last line that it said, if it fails.
pub fn succeeds(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|error| error.to_string())?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no reason given");
    Err(last.trim().to_owned())
}
