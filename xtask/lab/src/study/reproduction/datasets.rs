//! The datasets of the paper's experiments, which the program `edgepuck` makes.

use anyhow::{Context, bail};
use formats::atomic;
use std::path::Path;
use std::time::SystemTime;
use xtask::workspace;

/// Noise of the datasets besides gen-dataset's default, metres.
const SIGMAS: [&str; 3] = ["0.02", "0.05", "0.1"];

/// Makes the datasets of `meshes` in `scans` that are missing. A finished dataset
/// is kept.
///
/// # Errors
/// Meshes that cannot be used, datasets of other meshes, a command that fails.
pub fn make(meshes: &Path, scans: &Path) -> anyhow::Result<()> {
    keep_source(meshes, scans)?;
    let surfaces = scans.join("surfaces");
    let last = surfaces.join("seen-test.npz");
    if !last.is_file() {
        run_edgepuck(&["sample-surfaces"], &[("", meshes), ("--out", &surfaces)], &last)?;
    }
    let gen_dataset = ["gen-dataset", "--resume", "--min-points", "16"];
    let out = scans.join("lidar");
    run_edgepuck(&gen_dataset, &[("", meshes), ("--out", &out)], &out.join("manifest.json"))?;
    for sigma in SIGMAS {
        let more = ["--sensor", "vlp32c", "--noise", sigma];
        let out = scans.join(format!("noise-{sigma}"));
        let words = [&gen_dataset[..], &more[..]].concat();
        run_edgepuck(&words, &[("", meshes), ("--out", &out)], &out.join("manifest.json"))?;
    }
    Ok(())
}

/// Records which meshes the datasets in `scans` are of, and refuses others.
fn keep_source(meshes: &Path, scans: &Path) -> anyhow::Result<()> {
    let path = scans.join("meshes.txt");
    let source = meshes.canonicalize()?.display().to_string();
    match std::fs::read_to_string(&path) {
        Ok(earlier) if earlier == source => Ok(()),
        Ok(earlier) => bail!(
            "{}: expected datasets of {source}, found {earlier}; choose another --out",
            scans.display()
        ),
        Err(_) => Ok(atomic::write_bytes(&path, &source)?),
    }
}

/// Runs a command of the program `edgepuck`, which writes `last` at its end, even
/// if it had to leave out some inputs, which it names.
///
/// # Errors
/// A command that cannot be started or fails.
pub fn run_edgepuck(words: &[&str], paths: &[(&str, &Path)], last: &Path) -> anyhow::Result<()> {
    let mut command = workspace::cargo_command();
    command.args(["run", "--release", "--package", "edgepuck", "--manifest-path"]);
    command.arg(workspace::root().join("Cargo.toml")).arg("--").args(words);
    for (flag, path) in paths {
        if !flag.is_empty() {
            command.arg(flag);
        }
        command.arg(path);
    }
    eprintln!("== {}", workspace::words(&command));
    let begun = SystemTime::now();
    let status = command.status().with_context(|| format!("cannot run {}", words[0]))?;
    let some_left_out = status.code() == Some(1) && is_new(last, begun);
    if !(status.success() || some_left_out) {
        bail!("{} failed ({status})", words[0]);
    }
    Ok(())
}

/// Whether `path` was written since `begun`.
fn is_new(path: &Path, begun: SystemTime) -> bool {
    path.metadata().and_then(|data| data.modified()).is_ok_and(|written| written >= begun)
}
