use edgepuck_dataset::internals::layout;
use edgepuck_dataset::{Manifest, Progress, Stage};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

pub fn print(out: &Path, manifest: &Manifest, progress: &Progress, total: Duration, verbose: bool) {
    print_notes(&progress.notes());
    let seconds = total.as_secs_f64();
    formats::say!(
        "{} meshes, {} failed; {} scans, {} points in {seconds:.1} s ({:.1} meshes/s)",
        manifest.meshes.len(),
        manifest.failures.len(),
        progress.scans.load(Relaxed),
        progress.points.load(Relaxed),
        progress.meshes.load(Relaxed) as f64 / seconds,
    );
    if verbose {
        print_costs(progress);
    }
    let simplified = manifest.meshes.iter().filter_map(|mesh| Some((mesh, mesh.simplified?)));
    let (before, after) = simplified.fold((0, 0), |(before, after), (mesh, simplified)| {
        (before + mesh.triangles, after + simplified.triangles)
    });
    if manifest.config.simplify.is_some() {
        formats::say!("simplified: {after} triangles cast at for {before} in the files");
    }
    for packed in &manifest.packed {
        let left_out = match packed.left_out.len() {
            0 => "0 left out".to_owned(),
            n => format!("{n} left out for fewer than {} points", manifest.config.min_points),
        };
        formats::say!("{}: {} clouds, {left_out}", packed.file, packed.clouds);
    }
    tell_failures(out, manifest);
    formats::say!("Dataset: {}", out.display());
}

/// Prints how many meshes failed, and the file that lists them.
pub fn tell_failures(out: &Path, manifest: &Manifest) {
    let n = manifest.failures.len();
    if n > 0 {
        formats::say!("Meshes that failed: {n}, listed in {}", layout::failures(out).display());
    }
}

/// Prints the first notes, and how many more there are.
pub fn print_notes(notes: &[String]) {
    const MOST: usize = 10;
    notes.iter().take(MOST).for_each(|note| formats::say!("{note}"));
    if notes.len() > MOST {
        formats::say!("... and {} more such notes", notes.len() - MOST);
    }
}

/// Prints the work of the casters, and the time of each stage.
fn print_costs(progress: &Progress) {
    let count = |counter: &AtomicU64| counter.load(Relaxed);
    let (cast, culled) = (count(&progress.rays_cast), count(&progress.rays_culled));
    formats::say!(
        "{cast} rays cast, {culled} left out because they cannot hit a mesh, {} decided in double \
         precision",
        count(&progress.rays_decided_in_f64)
    );
    let stages: Vec<String> = Stage::ALL
        .iter()
        .map(|&stage| format!("{} {:.1}", stage.name(), progress.spent(stage).as_secs_f64()))
        .collect();
    formats::say!("seconds over all threads: {}", stages.join(", "));
}
