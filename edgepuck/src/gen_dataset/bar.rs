//! The progress bar, which is shown only if standard error is a terminal.

use edgepuck_dataset::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Does `work` while a bar shows the meshes that `progress` counts, until all are scanned.
pub fn beside<T>(progress: &Progress, work: impl FnOnce() -> T) -> T {
    let bar = ProgressBar::new(0).with_style(style());
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let show = || {
            let started = Instant::now();
            while !done.load(Relaxed) && !progress.is_scanned.load(Relaxed) {
                let rays = progress.rays_cast.load(Relaxed) + progress.rays_culled.load(Relaxed);
                let per_second = rays as f64 / started.elapsed().as_secs_f64().max(1e-3);
                bar.set_message(format!("{:.1} M rays/s", per_second / 1e6));
                bar.set_length(progress.expected_meshes.load(Relaxed));
                bar.set_position(progress.meshes.load(Relaxed));
                std::thread::park_timeout(Duration::from_millis(100));
            }
            bar.finish_and_clear();
        };
        // Without a thread for it, there is no bar.
        let _ = std::thread::Builder::new().spawn_scoped(scope, show);
        let result = work();
        done.store(true, Relaxed);
        result
    })
}

fn style() -> ProgressStyle {
    ProgressStyle::with_template("{bar:40} {pos}/{len} meshes, {per_sec}, {msg}, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar())
}
