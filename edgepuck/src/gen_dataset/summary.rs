use edgepuck_dataset::{DatasetFolder, Manifest, Progress};
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

pub fn print(out: &Path, manifest: &Manifest, progress: &Progress, total: Duration) {
    print_notes(&progress.notes());
    let seconds = total.as_secs_f64();
    program::say!(
        "{} meshes, {} failed; {} scans, {} points in {seconds:.1} s ({:.1} meshes/s)",
        manifest.meshes.len(),
        manifest.failures.len(),
        progress.scans.load(Relaxed),
        progress.points.load(Relaxed),
        progress.meshes.load(Relaxed) as f64 / seconds,
    );
    for packed in &manifest.packed {
        let left_out = match packed.left_out.len() {
            0 => "0 left out".to_owned(),
            n => format!("{n} left out for fewer than {} points", manifest.config.min_points),
        };
        program::say!("{}: {} clouds, {left_out}", packed.file, packed.clouds);
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
