//! Scans many meshes: reading, building and writing on all cores, beside one
//! thread that keeps the adapter busy. Queues are bounded and a budget bounds
//! the meshes under way, so memory does not grow with their number.

use super::budget::{Budget, Share};
use super::config::{DatasetConfig, SetConfig};
use super::error::DatasetError;
use super::journal::Journal;
use super::mesh::{Output, Prepared, prepare, write_mesh};
use super::progress::{Progress, Stage};
use super::record::{Entry, MeshFailure, MeshRecord};
use crossbeam_channel::{Receiver, Sender, bounded};
use formats::hash::Hashing;
use sim_gpu::internals::cast_error::CastError;
use sim_gpu::internals::caster::{Casting, OpenCaster};
use sim_gpu::internals::job::{Cast, CastJob, Culling};
use sim_gpu::internals::mesh::tree::MeshEntry;
use sim_gpu::internals::sensor::BeamPattern;
use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::Ordering::{Relaxed, SeqCst};
use std::sync::atomic::{AtomicBool, AtomicUsize};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Bytes that meshes under way may hold together.
const MEMORY_BUDGET: u64 = 1 << 30;

/// Bytes of memory per byte of a mesh file: binary PLY, the densest, takes 10
/// with its tree.
const BYTES_PER_FILE_BYTE: u64 = 12;

/// Bytes of a ray on its way: its record, beam, code and words.
const BYTES_PER_RAY: u64 = 44;

/// Rays gathered before a batch is sent, unless no mesh is waiting.
const RAYS_PER_BATCH: usize = 1 << 20;

/// Batches on their way through the adapter at once: while one is traced, the
/// next is uploaded.
const BATCHES_IN_FLIGHT: usize = 2;

/// One run over a list of meshes.
pub struct Run<'a> {
    /// The dataset's folder.
    pub out: &'a Path,
    /// What it is to hold.
    pub config: &'a DatasetConfig,
    /// Casts the rays; opened for the configuration's cast effects.
    pub caster: &'a OpenCaster,
    /// Whether beams that cannot hit are cast.
    pub culling: Culling,
    /// Counters.
    pub progress: &'a Progress,
    /// Set by whoever wants the run to end after the meshes under way.
    pub is_over: &'a AtomicBool,
}

/// What a run makes of its meshes, each list sorted by entry.
#[derive(Debug, Default)]
pub struct Scanned {
    /// Meshes that were scanned.
    pub records: Vec<MeshRecord>,
    /// Meshes that could not be.
    pub failures: Vec<MeshFailure>,
}

struct Shared<'a> {
    run: &'a Run<'a>,
    meshes: &'a [MeshEntry],
    journal: Journal,
    patterns: Vec<BeamPattern>,
    next: AtomicUsize,
    stopped: AtomicBool,
    /// Bytes of the clouds that are kept for packing.
    kept: AtomicUsize,
    scanned: Mutex<Scanned>,
    error: Mutex<Option<DatasetError>>,
}

/// Scans `meshes`, but for those whose scans the journal says are there.
///
/// # Errors
/// If a file cannot be written or the adapter fails, or if the run was told to end before all
/// meshes were scanned: the run stops. A mesh that cannot be read is no error; it is listed as a
/// failure.
pub fn scan_all(run: &Run, meshes: &[MeshEntry]) -> Result<Scanned, DatasetError> {
    let pattern = |set: &SetConfig| run.config.effects.widen(set.sensor.pattern(), &set.sensor);
    let patterns = run.config.sets.iter().map(pattern).collect::<Result<_, _>>()?;
    let shared = Shared {
        run,
        meshes,
        journal: Journal::of(run.out),
        patterns,
        next: AtomicUsize::new(0),
        stopped: AtomicBool::new(false),
        kept: AtomicUsize::new(0),
        scanned: Mutex::default(),
        error: Mutex::default(),
    };
    let budget = Budget::new(MEMORY_BUDGET);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (to_caster, prepared) = bounded(2 * threads);
    let (to_writers, cast) = bounded(2 * threads);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            let to_caster = to_caster.clone();
            let (shared, budget) = (&shared, &budget);
            scope.spawn(move || shared.prepare_all(budget, &to_caster));
            let cast = cast.clone();
            scope.spawn(move || shared.write_all(&cast));
        }
        drop(to_caster);
        drop(cast);
        shared.cast_all(prepared, to_writers);
    });
    if let Some(error) = lock(&shared.error).take() {
        return Err(error);
    }
    let mut scanned = std::mem::take(&mut *lock(&shared.scanned));
    let done = scanned.records.len() + scanned.failures.len();
    if done < meshes.len() {
        return Err(DatasetError::Interrupted { done, of: meshes.len(), what: "meshes" });
    }
    scanned.records.sort_unstable_by(|p, q| p.entry.cmp(&q.entry));
    scanned.failures.sort_unstable_by(|p, q| p.entry.cmp(&q.entry));
    Ok(scanned)
}

/// Whether `record` is of the file that `mesh` names, as it is now. Where no hash is asked
/// for, its name must do.
fn is_of(record: &MeshRecord, mesh: &MeshEntry, hashing: Hashing) -> bool {
    hashing.of_file(&mesh.path).is_ok_and(|now| now == record.hash)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared<'_> {
    /// Takes meshes from the list until none is left.
    fn prepare_all<'b>(&self, budget: &'b Budget, to_caster: &Sender<Held<'b>>) {
        let sets = self.run.config.sets.iter().zip(&self.patterns);
        let rays: u64 =
            sets.map(|(set, pattern)| set.viewpoints.count() as u64 * pattern.len() as u64).sum();
        while let Some(mesh) = self.meshes.get(self.next.fetch_add(1, SeqCst)) {
            if self.stopped.load(SeqCst) || self.run.is_over.load(SeqCst) {
                return;
            }
            match self.journal.find(&Entry::from(mesh)) {
                Err(error) => return self.stop(error),
                Ok(Some(record)) if is_of(&record, mesh, self.run.config.hash) => {
                    self.run.progress.meshes.fetch_add(1, Relaxed);
                    lock(&self.scanned).records.push(record);
                    continue;
                }
                // A mesh that changed since is scanned anew.
                Ok(Some(_) | None) => {}
            }
            let file_bytes = std::fs::metadata(&mesh.path).map_or(0, |file| file.len());
            let share = budget.take(
                file_bytes.saturating_mul(BYTES_PER_FILE_BYTE).saturating_add(rays * BYTES_PER_RAY),
            );
            let Run { config, culling, progress, .. } = self.run;
            match prepare(mesh, config, &self.patterns, *culling, progress) {
                Ok(prepared) => {
                    if to_caster.send(Held { prepared, _share: share }).is_err() {
                        return;
                    }
                }
                Err(failure) => {
                    progress.failures.fetch_add(1, Relaxed);
                    progress.meshes.fetch_add(1, Relaxed);
                    lock(&self.scanned).failures.push(failure);
                }
            }
        }
    }

    /// Gathers meshes into batches and keeps some of them under way.
    fn cast_all<'b>(
        &self,
        prepared: Receiver<Held<'b>>,
        to_writers: Sender<(Held<'b>, Vec<Cast>)>,
    ) {
        let mut in_flight = VecDeque::new();
        loop {
            let batch = gather(&prepared, in_flight.is_empty());
            let nothing_waits = batch.is_empty();
            if nothing_waits && in_flight.is_empty() {
                return;
            }
            if !nothing_waits {
                let run = self.run;
                match run
                    .progress
                    .time(Stage::Cast, || Batch::submit(batch, run.caster, run.progress))
                {
                    Ok(batch) => in_flight.push_back(batch),
                    Err(error) => return self.stop(error.into()),
                }
            }
            if nothing_waits || in_flight.len() >= BATCHES_IN_FLIGHT {
                let Some(oldest) = in_flight.pop_front() else { continue };
                match self.run.progress.time(Stage::Cast, || oldest.wait()) {
                    Ok(meshes) => {
                        for mesh in meshes {
                            if to_writers.send(mesh).is_err() {
                                return;
                            }
                        }
                    }
                    Err(error) => return self.stop(error.into()),
                }
            }
        }
    }

    /// Writes the scans of meshes that were cast.
    fn write_all(&self, cast: &Receiver<(Held, Vec<Cast>)>) {
        let cast_effects = self.run.config.cast_effects();
        let output = Output {
            out: self.run.out,
            config: self.run.config,
            patterns: &self.patterns,
            cast_effects: &cast_effects,
            progress: self.run.progress,
            kept: &self.kept,
        };
        for (held, casts) in cast {
            if self.stopped.load(SeqCst) {
                continue;
            }
            let record = write_mesh(&output, held.prepared, &casts);
            match record.and_then(|record| self.journal.note(&record).map(|()| record)) {
                Ok(record) => {
                    self.run.progress.meshes.fetch_add(1, Relaxed);
                    lock(&self.scanned).records.push(record);
                }
                Err(error) => self.stop(error),
            }
        }
    }

    /// Ends the run; the first error is the one that is told.
    fn stop(&self, error: DatasetError) {
        self.stopped.store(true, SeqCst);
        lock(&self.error).get_or_insert(error);
    }
}

/// A mesh on its way, with its share of the memory budget.
struct Held<'b> {
    /// The mesh.
    prepared: Prepared,
    /// Given back once its scans are written.
    _share: Share<'b>,
}

/// Meshes that are being cast at together.
struct Batch<'b> {
    /// Each mesh; with what was cast at it already, if it was too large for the
    /// adapter.
    meshes: Vec<(Held<'b>, Option<Vec<Cast>>)>,
    /// The jobs of the others, mesh by mesh.
    jobs: Vec<CastJob>,
    casting: Casting,
}

impl<'b> Batch<'b> {
    /// Starts casting at all of `meshes`. The CPU casts at once at a mesh that is too
    /// large for the adapter, and a note says so.
    fn submit(
        meshes: Vec<Held<'b>>,
        caster: &OpenCaster,
        progress: &Progress,
    ) -> Result<Self, CastError> {
        let mut jobs = Vec::new();
        let submitted = meshes.into_iter().map(|mut held| {
            let of_mesh = &mut held.prepared.jobs;
            if of_mesh.iter().all(|job| caster.fits(&job.target)) {
                jobs.append(of_mesh);
                return (held, None);
            }
            progress.note(format!(
                "{}: too large for one binding of {}: the CPU cast it",
                held.prepared.record.source,
                caster.name()
            ));
            let casts = caster.cast_on_cpu(of_mesh);
            (held, Some(casts))
        });
        let meshes = submitted.collect();
        let casting = caster.submit(&jobs)?;
        Ok(Self { meshes, jobs, casting })
    }

    /// The meshes and what was cast at each.
    fn wait(self) -> Result<Vec<(Held<'b>, Vec<Cast>)>, CastError> {
        let mut casts = self.casting.wait()?.into_iter();
        let mut jobs = self.jobs.into_iter();
        let finish = |(mut held, done): (Held<'b>, Option<Vec<Cast>>)| {
            let casts = done.unwrap_or_else(|| {
                let n_jobs = held.prepared.views.len();
                held.prepared.jobs = jobs.by_ref().take(n_jobs).collect();
                casts.by_ref().take(n_jobs).collect()
            });
            (held, casts)
        };
        Ok(self.meshes.into_iter().map(finish).collect())
    }
}

/// The meshes that wait to be cast at, up to a batch; waits for the first if
/// `wait_for_one`. Empty if there are none, or will be none.
fn gather<'b>(prepared: &Receiver<Held<'b>>, wait_for_one: bool) -> Vec<Held<'b>> {
    let mut batch: Vec<Held> = Vec::new();
    if wait_for_one {
        batch.extend(prepared.recv());
    }
    let rays = |held: &Held| held.prepared.jobs.iter().map(|job| job.beams.len()).sum::<usize>();
    let mut gathered: usize = batch.iter().map(rays).sum();
    while gathered < RAYS_PER_BATCH {
        let Ok(held) = prepared.try_recv() else { break };
        gathered += rays(&held);
        batch.push(held);
    }
    batch
}
