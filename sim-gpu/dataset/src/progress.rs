use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

formats::named! {
    /// A stage of the work, in order.
    pub enum Stage: "stage" {
        /// Reading and parsing the file, hashing it, scaling it, validating it.
        Read = "read",
        /// Building the hierarchy.
        Build = "build",
        /// Aiming beams.
        Aim = "aim",
        /// Casting: upload, trace, read back.
        Cast = "cast",
        /// Ranges in f64, effects, points.
        Resolve = "resolve",
        /// Writing files and records.
        Write = "write",
        /// Packing clouds and writing layouts and the manifest, after all meshes.
        Pack = "pack",
    }
}

/// The progress of a run: counters that its threads add to, and the flag that stops it.
#[derive(Debug, Default)]
pub struct Progress {
    /// Set it to stop the run after the meshes, or before the end of the tar, in progress.
    pub stop: Arc<AtomicBool>,
    /// Set by the run when all meshes are scanned, after which it cannot be stopped.
    pub is_scanned: Arc<AtomicBool>,
    /// Meshes that the run has to scan or to find in its journal.
    pub expected_meshes: AtomicU64,
    /// Meshes finished, including failed ones.
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
    /// Rays for which the caster left the choice between surfaces to f64.
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

    /// Notes a fact about one mesh for the user.
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
