//! The build from which the effects' code was deleted.

use super::super::companion::Companion;
use crate::venv::workshop;
use crate::workspace;
use anyhow::{Context, Result, bail};
use formats::atomic;
use serde::Deserialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What is deleted from which file.
const DELETED: &str = "xtask/peers/plain/deleted.toml";

/// What the copy is made of.
const SOURCES: [&str; 8] = [
    "Cargo.toml",
    "Cargo.lock",
    "formats/Cargo.toml",
    "formats/src",
    "sim-gpu/Cargo.toml",
    "sim-gpu/src",
    "assets/sensors",
    "xtask/peers/plain",
];

/// Files of which nothing is left.
const EFFECTS: &str = "sim-gpu/src/cpu/effects";

#[derive(Deserialize)]
struct Deletions {
    delete: Vec<Deletion>,
}

/// A text of a file, or all of it, and what stands there instead.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Deletion {
    file: String,
    text: Option<String>,
    #[serde(default)]
    instead: String,
}

/// The program, running.
pub struct Twin {
    process: Companion,
    /// Of its scan.
    pub fingerprint: u64,
}

/// Copies the sources, deletes the effects' code and builds what is left.
///
/// # Errors
/// If a text to delete is not there, or what is left does not build.
pub fn build() -> Result<PathBuf> {
    let folder = workshop().join("plain");
    let deletions = deletions()?;
    for source in SOURCES {
        copy(&workspace::root().join(source), &folder.join(source), &mut |path, text| {
            let relative = path.strip_prefix(workspace::root()).unwrap_or(path);
            deletions.applied(relative, text)
        })?;
    }
    eprintln!("building {} without the effects' code", folder.display());
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--quiet", "--release", "--package", "plain"]).current_dir(&folder);
    // Its warnings are not shown: what is left imports names that nothing uses.
    workspace::output(&mut cargo)?;
    Ok(folder.join("target/release").join(format!("plain{}", std::env::consts::EXE_SUFFIX)))
}

fn deletions() -> Result<Deletions> {
    let path = workspace::root().join(DELETED);
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    toml::from_str(&text).with_context(|| path.display().to_string())
}

impl Deletions {
    /// What is left of `text`, which stands in `file`.
    fn applied(&self, file: &Path, mut text: String) -> Result<String> {
        for deletion in self.delete.iter().filter(|deletion| Path::new(&deletion.file) == file) {
            let Some(deleted) = &deletion.text else {
                text.clone_from(&deletion.instead);
                continue;
            };
            let found = text.matches(deleted.as_str()).count();
            if found != 1 {
                let (file, start) = (file.display(), deleted.trim().lines().next().unwrap_or(""));
                bail!(
                    "{DELETED}: what begins with {start:?} stands {found} times in {file}, not once"
                );
            }
            text = text.replacen(deleted.as_str(), &deletion.instead, 1);
        }
        Ok(text)
    }
}

/// Copies a file or a folder, all text; files that are the same already keep
/// their time, so that cargo builds no more than it must.
fn copy(
    from: &Path,
    to: &Path,
    change: &mut impl FnMut(&Path, String) -> Result<String>,
) -> Result<()> {
    if from.ends_with(EFFECTS) {
        return Ok(());
    }
    if from.is_dir() {
        for entry in fs::read_dir(from).with_context(|| from.display().to_string())? {
            let name = entry?.file_name();
            copy(&from.join(&name), &to.join(&name), change)?;
        }
        return Ok(());
    }
    let text = fs::read_to_string(from).with_context(|| from.display().to_string())?;
    let text = change(from, text)?;
    if fs::read_to_string(to).is_ok_and(|there| there == text) {
        return Ok(());
    }
    fs::create_dir_all(to.parent().unwrap_or(to))?;
    Ok(atomic::write_bytes(to, &text)?)
}

impl Twin {
    /// Starts `program` on the mesh at `path`.
    ///
    /// # Errors
    /// If it does not start.
    pub fn start(program: &Path, path: &Path) -> Result<Self> {
        let mut process = Companion::start(Command::new(program).arg(std::path::absolute(path)?))?;
        let fingerprint = process.hear().context("the twin")?.parse()?;
        Ok(Self { process, fingerprint })
    }

    /// Seconds of CPU time that one turn takes.
    ///
    /// # Errors
    /// If it has ended.
    pub fn turn(&mut self) -> Result<f64> {
        self.process.tell("").context("the twin")?;
        Ok(self.process.hear().context("the twin")?.parse()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_text_to_delete_stands_where_it_should_and_no_effect_is_left() {
        let deletions = deletions().unwrap();
        for Deletion { file, .. } in &deletions.delete {
            let text = fs::read_to_string(workspace::root().join(file)).unwrap();
            let left = deletions.applied(Path::new(file), text).unwrap();
            for word in
                ["NoiseModel", "Dropout", "append_words", "Words", "words.", "quantum.and_then"]
            {
                assert!(!left.contains(word), "{file} has {word} left");
            }
        }
    }

    #[test]
    fn a_text_that_is_not_there_is_named() {
        let deletion = Deletion {
            file: "a.rs".to_owned(),
            text: Some("\nfn gone() {\n".to_owned()),
            instead: String::new(),
        };
        let deletions = Deletions { delete: vec![deletion] };
        let left = |text: &str| deletions.applied(Path::new("a.rs"), text.to_owned());
        assert_eq!(left("x\nfn gone() {\n}").unwrap(), "x}");
        let error = left("x").unwrap_err().to_string();
        assert!(error.contains("\"fn gone() {\" stands 0 times in a.rs"), "{error}");
        let other = deletions.applied(Path::new("b.rs"), "x".to_owned());
        assert_eq!(other.unwrap(), "x");
    }
}
