//! Batches of meshes on their way through the adapter.

use super::budget::Share;
use super::prepare::Prepared;
use super::progress::Progress;
use crossbeam_channel::Receiver;
use sim_gpu::cast_error::CastError;
use sim_gpu::caster::{Caster, Casting};
use sim_gpu::job::{Cast, CastJob};

/// Rays gathered before a batch is sent, unless no mesh is waiting.
const RAYS_PER_BATCH: usize = 1 << 20;

/// A mesh on its way, with its share of the memory budget.
pub struct Held<'b> {
    /// The mesh.
    pub prepared: Prepared,
    /// Given back once its scans are written.
    pub _share: Share<'b>,
}

/// Meshes that are being cast at.
pub struct InFlight<'b> {
    waiting: Vec<Waiting<'b>>,
    jobs: Vec<CastJob>,
    casting: Casting,
}

/// A mesh whose jobs are with the adapter, or were too large for it.
enum Waiting<'b> {
    AtAdapter { held: Held<'b>, n_jobs: usize },
    Done { held: Held<'b>, casts: Vec<Cast> },
}

/// The meshes that wait to be cast at, up to a batch; waits for the first if
/// `wait_for_one`. Empty if there are none, or will be none.
pub fn gather<'b>(prepared: &Receiver<Held<'b>>, wait_for_one: bool) -> Vec<Held<'b>> {
    let mut batch: Vec<Held> = Vec::new();
    if wait_for_one {
        batch.extend(prepared.recv());
    }
    let rays = |held: &Held| held.prepared.jobs.iter().map(|job| job.rays.len()).sum::<usize>();
    let mut gathered: usize = batch.iter().map(rays).sum();
    while gathered < RAYS_PER_BATCH {
        let Ok(held) = prepared.try_recv() else { break };
        gathered += rays(&held);
        batch.push(held);
    }
    batch
}

/// Starts casting at all meshes of `batch`. A mesh too large for the adapter
/// is cast at by the CPU twin at once, with a note that says so.
///
/// # Errors
/// If the adapter fails.
pub fn submit<'b>(
    batch: Vec<Held<'b>>,
    caster: &Caster,
    progress: &Progress,
) -> Result<InFlight<'b>, CastError> {
    let mut jobs = Vec::new();
    let mut waiting = Vec::with_capacity(batch.len());
    for mut held in batch {
        let of_mesh = &mut held.prepared.jobs;
        if of_mesh.iter().all(|job| caster.fits(&job.target)) {
            let n_jobs = of_mesh.len();
            jobs.append(of_mesh);
            waiting.push(Waiting::AtAdapter { held, n_jobs });
        } else {
            progress.note(format!(
                "{}: too large for one binding of {}: the CPU cast it",
                held.prepared.record.source,
                caster.name()
            ));
            let casts = caster.cast_on_cpu(of_mesh);
            waiting.push(Waiting::Done { held, casts });
        }
    }
    let casting = caster.submit(&jobs)?;
    Ok(InFlight { waiting, jobs, casting })
}

impl<'b> InFlight<'b> {
    /// The meshes and what was cast at each.
    ///
    /// # Errors
    /// If the adapter fails.
    pub fn wait(self) -> Result<Vec<(Held<'b>, Vec<Cast>)>, CastError> {
        let mut casts = self.casting.wait()?.into_iter();
        let mut jobs = self.jobs.into_iter();
        let finish = |waiting| match waiting {
            Waiting::Done { held, casts } => (held, casts),
            Waiting::AtAdapter { mut held, n_jobs } => {
                held.prepared.jobs = jobs.by_ref().take(n_jobs).collect();
                (held, casts.by_ref().take(n_jobs).collect())
            }
        };
        Ok(self.waiting.into_iter().map(finish).collect())
    }
}
