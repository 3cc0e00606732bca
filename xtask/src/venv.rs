//! Python environments with pinned packages of PyPI, which are made on first use.

use crate::workspace::root;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The names of Python, the preferred one first.
const PYTHONS: [&str; 3] = ["python3", "python", "py"];

/// The installer, which takes a sixth of pip's time.
const UV: &str = "uv==0.13.9";

/// The folder of the programs that `bench` runs, and of the lists of their packages.
pub fn programs() -> PathBuf {
    root().join("xtask/lab/peers")
}

/// The folder of the environments.
pub fn cache_dir() -> PathBuf {
    root().join("target/peers")
}

/// A Python environment.
pub struct Environment<'a> {
    /// Its folder's name.
    pub name: &'a str,
    /// The list of packages, a file of the workspace.
    pub requirements: &'a str,
    /// How much is downloaded, in words for the user.
    pub size: &'a str,
}

impl Environment<'_> {
    /// The interpreter of the environment, which is made under [`cache_dir`] unless it exists.
    pub fn interpreter(&self) -> Result<PathBuf, String> {
        if let Some(interpreter) = self.made()? {
            return Ok(interpreter);
        }
        let folder = self.folder();
        eprintln!("making {} ({} from PyPI)", folder.display(), self.size);
        make(Path::new(any_python()?), &folder, &["--without-pip"])?;
        install(&self.python(), ["-r".into(), root().join(self.requirements).into()])?;
        std::fs::write(self.done(), self.pinned()?).map_err(|e| e.to_string())?;
        Ok(self.python())
    }

    /// The interpreter, if the environment exists and has these packages.
    pub fn made(&self) -> Result<Option<PathBuf>, String> {
        let pinned = self.pinned()?;
        let is_made = std::fs::read_to_string(self.done()).is_ok_and(|found| found == pinned);
        Ok(is_made.then(|| self.python()))
    }

    fn folder(&self) -> PathBuf {
        cache_dir().join(self.name)
    }

    fn python(&self) -> PathBuf {
        python_in(&self.folder())
    }

    /// The file that is written last, once all packages are installed.
    fn done(&self) -> PathBuf {
        self.folder().join("edgepuck-requirements.txt")
    }

    fn pinned(&self) -> Result<String, String> {
        let file = root().join(self.requirements);
        std::fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))
    }
}

/// Makes the environment `folder` for the interpreter `base`; an older one there is removed.
pub fn make(base: &Path, folder: &Path, options: &[&str]) -> Result<(), String> {
    let mut make = Command::new(base);
    succeeds(make.args(["-m", "venv", "--clear"]).args(options).arg(folder))
        .map_err(|cause| format!("{}: {cause}", folder.display()))
}

/// Installs packages, which `words` name as for pip, in the environment of `python`. uv installs
/// them, or else pip: uv reads no settings of pip, and does not see packages of the system.
pub fn install(
    python: &Path,
    words: impl IntoIterator<Item = OsString> + Clone,
) -> Result<(), String> {
    static INSTALLER: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let installer = INSTALLER.get_or_init(installer).clone()?;
    let mut uv = Command::new(installer.with_file_name("uv"));
    uv.args(["pip", "install", "--quiet", "--python"]).arg(python).args(words.clone());
    let mut pip = Command::new(&installer);
    pip.args(["-m", "pip", "--python"]).arg(python);
    pip.args(["install", "--quiet", "--disable-pip-version-check"]).args(words);
    let settings = python.ancestors().nth(2).map(|folder| folder.join("pyvenv.cfg"));
    let settings = settings.and_then(|file| std::fs::read_to_string(file).ok());
    if settings.is_some_and(|text| text.contains("include-system-site-packages = true")) {
        return succeeds(&mut pip);
    }
    succeeds(&mut uv).or_else(|_| succeeds(&mut pip))
}

/// The interpreter of an environment with pip and, where it can be had, uv.
fn installer() -> Result<PathBuf, String> {
    let folder = cache_dir().join("installer-venv");
    let python = python_in(&folder);
    if !python.with_file_name("uv").exists() {
        make(Path::new(any_python()?), &folder, &[])?;
        // Without uv, pip installs.
        let _ = succeeds(Command::new(&python).args(["-m", "pip", "install", "--quiet", UV]));
    }
    Ok(python)
}

/// The name of an interpreter that the machine has.
pub fn any_python() -> Result<&'static str, String> {
    let answers = |python: &&str| succeeds(Command::new(python).arg("--version")).is_ok();
    PYTHONS.into_iter().find(answers).ok_or_else(|| "expected Python, found none".to_owned())
}

fn python_in(folder: &Path) -> PathBuf {
    folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
}

/// Runs `command` to its end.
pub fn succeeds(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|error| error.to_string())?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no reason given");
    Err(last.trim().to_owned())
}
