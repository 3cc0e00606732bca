//! Scans many meshes: all cores read, build and write, while one thread keeps the adapter busy.
//! Queues are bounded, and a budget bounds the memory of the meshes in progress, so that memory
//! does not grow with the number of meshes.

use crate::budget::{Budget, Share};
use crate::error::DatasetError;
use crate::folder::DatasetFolder;
use crate::mesh::{Prepared, Run, finish, prepare};
use crate::plan::Plan;
use crate::progress::{Progress, Stage};
use crate::record::{Entry, MeshFailure, MeshRecord};
use crate::view::{Rig, patterns};
use crossbeam_channel::{Receiver, Sender, bounded};
use edgepuck_mesh::tree::MeshEntry;
use formats::hash::Hashing;
use sim_gpu::Caster;
use sim_gpu::errors::CastError;
use sim_gpu::internals::caster::{Casting, OpenCaster};
use sim_gpu::internals::job::{Cast, CastJob};
use std::collections::VecDeque;
use std::sync::atomic::Ordering::{Relaxed, SeqCst};
use std::sync::atomic::{AtomicBool, AtomicUsize};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::Builder;

/// Bytes that the meshes in progress may hold together.
const MEMORY_BUDGET: u64 = 1 << 30;

/// Bytes of memory for each byte of a mesh file: binary PLY, the densest format, takes 10 with
/// its tree.
const BYTES_PER_FILE_BYTE: u64 = 12;

/// Bytes of memory for each ray: its record, beam, code and words.
const BYTES_PER_RAY: u64 = 44;

/// Rays of a batch. A smaller batch is submitted if no mesh is waiting.
const RAYS_PER_BATCH: usize = 1 << 20;

/// Batches that the adapter has at once: while it traces one, the next is uploaded.
const BATCHES_IN_FLIGHT: usize = 2;

type Scanned = (Vec<MeshRecord>, Vec<MeshFailure>);

struct Shared<'a> {
    run: Run<'a>,
    folder: DatasetFolder<'a>,
    /// The index of the next mesh to prepare.
    next: AtomicUsize,
    /// Whether an error ended the run.
    stopped: AtomicBool,
    scanned: Mutex<Scanned>,
    error: Mutex<Option<DatasetError>>,
}

/// Scans the meshes of `plan`, except those whose scans the journal records. Returns the records
/// and the failures.
pub(crate) fn scan_all(
    plan: &Plan,
    caster: &Caster,
    progress: &Progress,
) -> Result<Scanned, DatasetError> {
    let caster = caster.for_effects(&plan.config.cast_effects())?;
    let (patterns, cast_effects) = (&patterns(plan.config)?, caster.effects());
    let rig = Rig { config: plan.config, patterns, cast_effects };
    let shared = Shared {
        run: Run { plan, rig, progress, kept: AtomicUsize::new(0) },
        folder: DatasetFolder(plan.out),
        next: AtomicUsize::new(0),
        stopped: AtomicBool::new(false),
        scanned: Mutex::default(),
        error: Mutex::default(),
    };
    let budget = Budget::new(MEMORY_BUDGET);
    let threads = rayon::current_num_threads();
    let (to_caster, prepared) = bounded(2 * threads);
    let (to_writers, cast) = bounded(2 * threads);
    std::thread::scope(|scope| {
        let started = (0..threads).try_for_each(|_| {
            let (to_caster, cast) = (to_caster.clone(), cast.clone());
            let (shared, budget) = (&shared, &budget);
            let prepare = move || shared.prepare_all(budget, &to_caster);
            Builder::new().spawn_scoped(scope, prepare)?;
            Builder::new().spawn_scoped(scope, move || shared.write_all(&cast)).map(drop)
        });
        // Those that have started then end.
        if let Err(cause) = started {
            shared.stop(DatasetError::Threads(2 * threads, cause));
        }
        drop(to_caster);
        drop(cast);
        if let Err(error) = shared.cast_all(&caster, &prepared, &to_writers) {
            shared.stop(error.into());
        }
        // Threads that wait for the caster end when its queues are gone.
        drop((prepared, to_writers));
    });
    if let Some(error) = lock(&shared.error).take() {
        return Err(error);
    }
    let scanned = std::mem::take(&mut *lock(&shared.scanned));
    let (done, of) = (scanned.0.len() + scanned.1.len(), plan.meshes.len());
    if done < of {
        return Err(DatasetError::Interrupted { done, of, what: "meshes" });
    }
    Ok(scanned)
}

/// Whether `record` is of the file of `mesh` as it is now. Without a hash, the name has to do.
pub fn is_current(record: &MeshRecord, mesh: &MeshEntry, hashing: Hashing) -> bool {
    hashing.of_file(&mesh.path).is_ok_and(|now| now == record.hash)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<'a> Shared<'a> {
    /// Prepares meshes until none is left.
    fn prepare_all<'b>(&self, budget: &'b Budget, to_caster: &Sender<Held<'a, 'b>>) {
        let Run { plan: Plan { config, meshes, .. }, rig, progress, .. } = &self.run;
        let sets = config.sets.iter().zip(rig.patterns);
        let rays: u64 =
            sets.map(|(set, pattern)| set.viewpoints.count() as u64 * pattern.len() as u64).sum();
        while let Some(mesh) = meshes.get(self.next.fetch_add(1, SeqCst)) {
            if self.stopped.load(SeqCst) || progress.stop.load(SeqCst) {
                return;
            }
            match self.folder.find(&Entry::from(mesh)) {
                Err(error) => return self.stop(error),
                Ok(Some(record)) if is_current(&record, mesh, config.hash) => {
                    progress.meshes.fetch_add(1, Relaxed);
                    lock(&self.scanned).0.push(record);
                    continue;
                }
                // A mesh that has changed since is scanned again.
                Ok(Some(_) | None) => {}
            }
            let file_bytes = std::fs::metadata(&mesh.path).map_or(0, |file| file.len());
            let share = budget.take(
                file_bytes.saturating_mul(BYTES_PER_FILE_BYTE).saturating_add(rays * BYTES_PER_RAY),
            );
            match prepare(&self.run, mesh) {
                Ok(prepared) => {
                    if to_caster.send(Held { prepared, _share: share }).is_err() {
                        return;
                    }
                }
                Err(failure) => {
                    progress.failures.fetch_add(1, Relaxed);
                    progress.meshes.fetch_add(1, Relaxed);
                    lock(&self.scanned).1.push(failure);
                }
            }
        }
    }

    /// Gathers meshes into batches and keeps some of these in flight.
    fn cast_all<'b>(
        &self,
        caster: &OpenCaster,
        prepared: &Receiver<Held<'a, 'b>>,
        to_writers: &Sender<(Held<'a, 'b>, Vec<Cast>)>,
    ) -> Result<(), CastError> {
        let progress = self.run.progress;
        let mut in_flight = VecDeque::new();
        loop {
            let batch = gather(prepared, in_flight.is_empty());
            let nothing_waits = batch.is_empty();
            if !nothing_waits {
                let submit = || Batch::submit(batch, caster, progress);
                in_flight.push_back(progress.time(Stage::Cast, submit)?);
            }
            if nothing_waits || in_flight.len() >= BATCHES_IN_FLIGHT {
                let Some(oldest) = in_flight.pop_front() else { return Ok(()) };
                for mesh in progress.time(Stage::Cast, || oldest.wait())? {
                    if to_writers.send(mesh).is_err() {
                        return Ok(());
                    }
                }
            }
        }
    }

    fn write_all(&self, cast: &Receiver<(Held, Vec<Cast>)>) {
        for (held, casts) in cast {
            if self.stopped.load(SeqCst) {
                continue;
            }
            let record = finish(&self.run, held.prepared, &casts);
            match record.and_then(|record| self.folder.note(&record).map(|()| record)) {
                Ok(record) => {
                    self.run.progress.meshes.fetch_add(1, Relaxed);
                    lock(&self.scanned).0.push(record);
                }
                Err(error) => self.stop(error),
            }
        }
    }

    /// Ends the run, which returns the first error.
    fn stop(&self, error: DatasetError) {
        self.stopped.store(true, SeqCst);
        lock(&self.error).get_or_insert(error);
    }
}

/// A mesh in progress, with its share of the memory budget.
struct Held<'a, 'b> {
    prepared: Prepared<'a>,
    /// Returned to the budget when the scans are written.
    _share: Share<'b>,
}

/// Meshes at which the caster casts together.
struct Batch<'a, 'b> {
    /// The meshes. Those that are too large for the adapter have their answers already.
    meshes: Vec<(Held<'a, 'b>, Option<Vec<Cast>>)>,
    /// The jobs of the others, mesh by mesh.
    jobs: Vec<CastJob>,
    casting: Casting,
}

impl<'a, 'b> Batch<'a, 'b> {
    /// Starts casting at `meshes`. If a mesh is too large for the adapter, the CPU casts at it
    /// immediately, and a note says so.
    fn submit(
        meshes: Vec<Held<'a, 'b>>,
        caster: &OpenCaster,
        progress: &Progress,
    ) -> Result<Self, CastError> {
        let mut jobs = Vec::new();
        let submitted = meshes.into_iter().map(|mut held| {
            let mesh_jobs = &mut held.prepared.jobs;
            if mesh_jobs.iter().all(|job| caster.fits(&job.target)) {
                jobs.append(mesh_jobs);
                return (held, None);
            }
            progress.note(format!(
                "{}: too large for one binding of {}: the CPU cast it",
                held.prepared.record.source,
                caster.name()
            ));
            let casts = caster.cast_on_cpu(mesh_jobs);
            (held, Some(casts))
        });
        let meshes = submitted.collect();
        let casting = caster.submit(&jobs)?;
        Ok(Self { meshes, jobs, casting })
    }

    fn wait(self) -> Result<Vec<(Held<'a, 'b>, Vec<Cast>)>, CastError> {
        let mut casts = self.casting.wait()?.into_iter();
        let mut jobs = self.jobs.into_iter();
        let finish = |(mut held, done): (Held<'a, 'b>, Option<Vec<Cast>>)| {
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

/// The meshes that are waiting, up to a batch. If `wait_for_one`, waits for the first; the batch
/// is then empty only if no mesh will follow.
fn gather<'a, 'b>(prepared: &Receiver<Held<'a, 'b>>, wait_for_one: bool) -> Vec<Held<'a, 'b>> {
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
