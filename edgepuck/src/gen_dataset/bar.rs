//! The progress bar; quiet where standard error is no terminal.

use edgepuck_dataset::progress::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Does `work` while a bar shows how `progress` nears `meshes`.
pub fn beside<T>(progress: &Progress, meshes: usize, work: impl FnOnce() -> T) -> T {
    let bar = ProgressBar::new(meshes as u64).with_style(style());
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let started = Instant::now();
            while !done.load(Relaxed) {
                let rays = progress.rays_cast.load(Relaxed) + progress.rays_culled.load(Relaxed);
                let per_second = rays as f64 / started.elapsed().as_secs_f64().max(1e-3);
                bar.set_message(format!("{:.1} M rays/s", per_second / 1e6));
                bar.set_position(progress.meshes.load(Relaxed));
                std::thread::park_timeout(Duration::from_millis(100));
            }
        });
        let result = work();
        done.store(true, Relaxed);
        bar.finish_and_clear();
        result
    })
}

fn style() -> ProgressStyle {
    ProgressStyle::with_template("{bar:40} {pos}/{len} meshes, {per_sec}, {msg}, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar())
}
