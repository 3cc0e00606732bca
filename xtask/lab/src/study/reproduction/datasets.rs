//! The datasets of the paper's experiments, which the program `edgepuck` makes.

use crate::study::resume;
use anyhow::{Context, bail};
use std::path::Path;
use std::time::SystemTime;
use xtask::workspace;

/// Noise of the datasets besides gen-dataset's default, metres.
const SIGMAS: [&str; 3] = ["0.02", "0.05", "0.1"];

/// Makes the datasets of `meshes` in `scans` that are missing. A finished dataset
/// is kept.
pub fn make(meshes: &Path, scans: &Path) -> anyhow::Result<()> {
    let source = meshes.canonicalize()?.display().to_string();
    resume::keep_terms(&source, &scans.join("meshes.txt"))?;
    let surfaces = scans.join("surfaces");
    let last = surfaces.join("seen-test.npz");
    if !last.is_file() {
        run_edgepuck(&["sample-surfaces"], meshes, &surfaces, &last)?;
    }
    let gen_dataset = |folder: &str, more: &[&str]| {
        let words = [&["gen-dataset", "--resume", "--min-points", "16"], more].concat();
        let out = scans.join(folder);
        run_edgepuck(&words, meshes, &out, &out.join("manifest.json"))
    };
    gen_dataset("lidar", &[])?;
    SIGMAS.iter().try_for_each(|sigma| {
        gen_dataset(&format!("noise-{sigma}"), &["--sensor", "vlp32c", "--noise", sigma])
    })
}

/// Runs a command of the program `edgepuck` on `meshes`. It writes `last` at its
/// end, even if it had to leave out some meshes, which it names.
fn run_edgepuck(words: &[&str], meshes: &Path, out: &Path, last: &Path) -> anyhow::Result<()> {
    let mut command = workspace::cargo_run("edgepuck");
    command.arg("--").args(words).arg(meshes).arg("--out").arg(out);
    eprintln!("== {}", workspace::words(&command));
    let begun = SystemTime::now();
    let status = command.status().with_context(|| format!("cannot run {}", words[0]))?;
    let written = last.metadata().and_then(|data| data.modified());
    let some_left_out = status.code() == Some(1) && written.is_ok_and(|written| written >= begun);
    if !(status.success() || some_left_out) {
        bail!("{} failed ({status})", words[0]);
    }
    Ok(())
}
