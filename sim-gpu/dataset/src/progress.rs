//! What a run has done so far, for bars and closing summaries.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

formats::named! {
    /// A part of the work on one mesh, in the order of the work.
    pub enum Stage: "stage" {
        /// Reading and parsing the file, hashing it, scaling it, validating it.
        Read = "read",
        /// Simplifying, where that is asked for, and building the hierarchy.
        Build = "build",
        /// Aiming beams.
        Aim = "aim",
        /// Casting: upload, trace, read back.
        Cast = "cast",
        /// Ranges in f64, effects, points.
        Resolve = "resolve",
        /// Writing files and records.
        Write = "write",
    }
}

/// Counters that all threads of a run add to.
#[derive(Debug, Default)]
pub struct Progress {
    /// Meshes finished, failed ones among them.
    pub meshes: AtomicU64,
    /// Meshes that could not be scanned.
    pub failures: AtomicU64,
    /// Scans written.
    pub scans: AtomicU64,
    /// Points written.
    pub points: AtomicU64,
    /// Rays cast.
    pub rays_cast: AtomicU64,
    /// Rays that could not hit and were not cast.
    pub rays_culled: AtomicU64,
    /// Rays for which f64 had to choose between surfaces.
    pub rays_decided_in_f64: AtomicU64,
    stages: [AtomicU64; Stage::ALL.len()],
    notes: Mutex<Vec<String>>,
}

impl Progress {
    /// Does `work` and adds its time to `stage`.
    pub fn time<T>(&self, stage: Stage, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let nanoseconds = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.stages[stage as usize].fetch_add(nanoseconds, Relaxed);
        result
    }

    /// Time that all threads together spent in `stage`.
    #[must_use]
    pub fn spent(&self, stage: Stage) -> Duration {
        Duration::from_nanos(self.stages[stage as usize].load(Relaxed))
    }

    /// Something the user should know of one mesh.
    pub fn note(&self, note: String) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(note);
    }

    /// The notes, sorted, so that they are the same on every run.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner).clone();
        notes.sort();
        notes
    }
}
