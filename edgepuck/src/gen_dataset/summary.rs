use edgepuck_dataset::{DatasetFolder, Manifest, Progress};
use formats::counted;
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

pub fn print(out: &Path, manifest: &Manifest, progress: &Progress, total: Duration) {
    print_notes(&progress.notes());
    let seconds = total.as_secs_f64();
    program::say!(
        "{}, {} failed; {}, {} in {seconds:.1} s ({:.1} meshes/s)",
        counted(manifest.meshes.len(), "mesh"),
        manifest.failures.len(),
        counted(progress.scans.load(Relaxed), "scan"),
        counted(progress.points.load(Relaxed), "point"),
        progress.meshes.load(Relaxed) as f64 / seconds,
    );
    for packed in &manifest.packed {
        let left_out = match packed.left_out.len() {
            0 => "0 left out".to_owned(),
            n => format!("{n} left out below --min-points {}", manifest.config.min_points),
        };
        program::say!("{}: {}, {left_out}", packed.file, counted(packed.clouds, "cloud"));
    }
    tell_failures(out, manifest);
    program::say!("Dataset: {}", out.display());
}

/// Prints how many meshes failed, and the file that lists them.
pub fn tell_failures(out: &Path, manifest: &Manifest) {
    let n = manifest.failures.len();
    if n > 0 {
        program::say!(
            "Meshes that failed: {n}, listed in {}",
            DatasetFolder(out).failures_file().display()
        );
    }
}

/// Prints the first notes, and how many more there are.
pub fn print_notes(notes: &[String]) {
    const MOST: usize = 10;
    notes.iter().take(MOST).for_each(|note| program::say!("{note}"));
    if notes.len() > MOST {
        program::say!("... and {} more such notes", notes.len() - MOST);
    }
}
