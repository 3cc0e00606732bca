//! Casts jobs in batches on an adapter.

use super::adapter::{self, AdapterSummary};
use super::batch::{Batch, BatchLimits};
use super::compose::WORKGROUP_SIZE;
use super::pipeline::Pipeline;
use super::slot::{Answer, Slot};
use crate::cast_error::CastError;
use crate::effects::Effects;
use crate::job::{Cast, CastJob};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The most rays of a dispatch: enough to fill any adapter, and few enough that the watchdog of a
/// display driver does not stop it.
const RAYS_PER_DISPATCH: usize = 1 << 22;

/// Casts on one adapter, for one set of effects.
pub struct GpuCaster {
    core: Arc<Core>,
}

/// The state that a caster shares with its batches in flight.
struct Core {
    pipeline: Pipeline,
    summary: AdapterSummary,
    limits: BatchLimits,
    idle: Mutex<Vec<Slot>>,
    failure: Arc<Mutex<Option<String>>>,
}

struct Part {
    job: usize,
    rays: usize,
}

/// Jobs in flight.
pub struct Pending {
    core: Arc<Core>,
    dispatches: Vec<(Slot, Vec<Part>)>,
    jobs: usize,
    timed: bool,
}

impl GpuCaster {
    /// Opens `adapter` and compiles the shader variant that models `effects`.
    pub async fn open(adapter: &wgpu::Adapter, effects: &Effects) -> Result<Self, CastError> {
        let summary = adapter::summary(adapter);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("edgepuck"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = adapter.request_device(&descriptor).await.map_err(|cause| {
            CastError::Open { name: summary.name.clone(), cause: cause.to_string() }
        })?;
        let failure = Arc::new(Mutex::new(None));
        let first = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error| {
            lock(&first).get_or_insert_with(|| error.to_string());
        }));
        let limits = limits(&device.limits(), effects);
        let pipeline = Pipeline::new(device, queue, effects);
        let idle = Mutex::new(Vec::new());
        let core = Core { pipeline, summary, limits, idle, failure };
        core.check()?;
        Ok(Self { core: Arc::new(core) })
    }

    /// The description of the adapter.
    #[must_use]
    pub fn summary(&self) -> &AdapterSummary {
        &self.core.summary
    }

    /// The effects that this caster models.
    #[must_use]
    pub fn effects(&self) -> &Effects {
        &self.core.pipeline.effects
    }

    /// The limits of one dispatch.
    #[must_use]
    pub fn limits(&self) -> &BatchLimits {
        &self.core.limits
    }

    /// The bytes of device memory reserved for the caster's buffers, if the interface reports them.
    #[must_use]
    pub fn held_bytes(&self) -> Option<u64> {
        let report = self.core.pipeline.device.generate_allocator_report()?;
        Some(report.total_reserved_bytes)
    }

    /// Uploads and starts `jobs`, in as few dispatches as the limits allow.
    pub fn submit(&self, jobs: &[CastJob]) -> Result<Pending, CastError> {
        self.start(jobs, false)
    }

    /// Casts `jobs`, waits, and returns the seconds that tracing took by the adapter's own clock,
    /// without upload and read-back; `None` if the adapter has no timestamps.
    pub fn cast_timed(&self, jobs: &[CastJob]) -> Result<(Vec<Cast>, Option<f64>), CastError> {
        pollster::block_on(self.start(jobs, true)?.collect())
    }

    fn start(&self, jobs: &[CastJob], timed: bool) -> Result<Pending, CastError> {
        let core = &self.core;
        let mut pending =
            Pending { core: Arc::clone(core), dispatches: Vec::new(), jobs: jobs.len(), timed };
        let mut batch = Batch::default();
        let mut parts = Vec::new();
        for (at, job) in jobs.iter().enumerate() {
            if !core.limits.holds(&job.target) {
                return Err(self.too_large(job));
            }
            let mut start = 0;
            while start < job.beams.len() {
                let left = job.beams.len() - start;
                if !batch.has_room(job, left.min(WORKGROUP_SIZE), &core.limits) {
                    pending.dispatch(std::mem::take(&mut batch), std::mem::take(&mut parts));
                }
                let rays = left.min(core.limits.rays - batch.n_rays);
                batch.push(job, start..start + rays, &core.pipeline.effects);
                parts.push(Part { job: at, rays });
                start += rays;
            }
        }
        pending.dispatch(batch, parts);
        core.check()?;
        Ok(pending)
    }

    fn too_large(&self, job: &CastJob) -> CastError {
        CastError::TooLarge {
            name: self.core.summary.name.clone(),
            nodes: job.target.bvh.two_wide().nodes.len(),
            binding_bytes: self.core.limits.binding_bytes,
        }
    }
}

impl Drop for Core {
    /// A browser would keep the device until it collects garbage.
    fn drop(&mut self) {
        self.pipeline.device.destroy();
    }
}

impl Core {
    fn check(&self) -> Result<(), CastError> {
        match &*lock(&self.failure) {
            None => Ok(()),
            Some(cause) => Err(self.lost(cause.clone())),
        }
    }

    fn lost(&self, cause: String) -> CastError {
        CastError::Lost { name: self.summary.name.clone(), cause }
    }
}

impl Pending {
    fn dispatch(&mut self, batch: Batch, parts: Vec<Part>) {
        if batch.n_rays == 0 {
            return;
        }
        let core = &self.core;
        let idle = if self.timed { None } else { lock(&core.idle).pop() };
        let mut slot = idle.unwrap_or_else(|| Slot::new(&core.pipeline, self.timed));
        slot.start(&core.pipeline, &batch);
        self.dispatches.push((slot, parts));
    }

    /// The answers, one per job, in order.
    pub async fn answers(self) -> Result<Vec<Cast>, CastError> {
        Ok(self.collect().await?.0)
    }

    /// The answers, and the seconds of all dispatches if each has them.
    async fn collect(self) -> Result<(Vec<Cast>, Option<f64>), CastError> {
        let per_ray = self.core.pipeline.effects.outputs_per_ray();
        let mut casts = vec![Cast::default(); self.jobs];
        let mut total = Some(0.0);
        for (mut slot, parts) in self.dispatches {
            let answer = slot.answer(&self.core.pipeline).await;
            // The error that the device reported is more specific than a failed wait.
            self.core.check()?;
            let Answer { codes, outputs, seconds } =
                answer.map_err(|cause| self.core.lost(cause))?;
            let (mut codes, mut outputs) = (&codes[..], &outputs[..]);
            for Part { job, rays } in parts {
                casts[job].codes.extend_from_slice(&codes[..rays]);
                casts[job].effect_outputs.extend_from_slice(&outputs[..rays * per_ray]);
                (codes, outputs) = (&codes[rays..], &outputs[rays * per_ray..]);
            }
            total = total.zip(seconds).map(|(total, seconds)| total + seconds);
            if !self.timed {
                lock(&self.core.idle).push(slot);
            }
        }
        Ok((casts, total))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn limits(limits: &wgpu::Limits, effects: &Effects) -> BatchLimits {
    let binding = usize::try_from(limits.max_storage_buffer_binding_size).unwrap_or(usize::MAX);
    let buffer = usize::try_from(limits.max_buffer_size).unwrap_or(usize::MAX);
    let binding_bytes = binding.min(buffer);
    // The ray itself is the largest record per ray, unless effects have many outputs.
    let per_ray =
        (size_of::<f32>() * effects.outputs_per_ray()).max(size_of::<crate::ray::TraceRay>());
    let per_axis = limits.max_compute_workgroups_per_dimension as usize;
    let dispatchable = WORKGROUP_SIZE.saturating_mul(per_axis).saturating_mul(per_axis);
    let rays = RAYS_PER_DISPATCH.min(binding_bytes / per_ray).min(dispatchable);
    BatchLimits { binding_bytes, rays }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Builder;
    use crate::cpu;
    use crate::effects::{Dropout, Intensity, Noise, NoiseModel};
    use crate::job::{Aim, Culling};
    use crate::pose::Pose;
    use crate::ray::{AMBIGUOUS, RayFrame};
    use crate::sensor::SensorProfile;
    use crate::target::{Surface, Target};
    use edgepuck_mesh::TriangleMesh;
    use formats::rng::StreamKey;
    use glam::{DAffine3, DVec3};
    use test_support::need;

    fn caster() -> Result<GpuCaster, String> {
        let effects = Effects {
            noise: Some(Noise { mean_m: 0.0, sigma_m: 1.0, model: NoiseModel::Xyz }),
            dropout: Some(Dropout { probability: 0.5 }),
            intensity: Some(Intensity),
            ..Effects::default()
        };
        let adapters = pollster::block_on(adapter::adapters());
        let best = test_support::adapter(adapters.into_iter().next())?;
        Ok(pollster::block_on(GpuCaster::open(&best, &effects)).unwrap())
    }

    fn wait(pending: Pending) -> Vec<Cast> {
        pollster::block_on(pending.answers()).unwrap()
    }

    /// Pyramids of different sizes, each from its own side. The rays of every other one are
    /// sent, the others are made on the adapter.
    fn jobs() -> Vec<CastJob> {
        let pattern = SensorProfile::builtin("generic-static").unwrap().pattern();
        (1..6u32)
            .map(|i| {
                let vertices = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::ONE * f64::from(i)];
                let triangles = vec![[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]];
                let surface = Surface::new(TriangleMesh { vertices, triangles }, vec![0, 1, 2, 3]);
                let position_m = DVec3::new(4.0, f64::from(i) - 3.0, 1.0) * f64::from(i);
                let pose = Pose::look_at(position_m, DVec3::ZERO).unwrap();
                let frame = RayFrame::new(&surface, &DAffine3::IDENTITY, &pose);
                let target = Target::new(surface, Builder::Sah);
                let stream = StreamKey::new(0, "pyramid", i);
                let job =
                    CastJob::aim(target, frame, &pattern, Culling::Off, stream, 0.1 * i as f32);
                let sent = i.is_multiple_of(2).then(|| Aim::Rays(job.rays().to_vec()));
                CastJob { aim: sent.unwrap_or(job.aim), ..job }
            })
            .collect()
    }

    #[test]
    fn rays_cut_into_many_dispatches_answer_as_in_one() {
        let mut caster = need!(caster());
        let jobs = jobs();
        let whole = wait(caster.submit(&jobs).unwrap());
        assert_eq!(whole.iter().map(|cast| cast.codes.len()).sum::<usize>(), 50_000);
        for (job, cast) in jobs.iter().zip(&whole) {
            let by_cpu = cpu::trace::trace(&job.target.bvh.wide, job.rays());
            let codes = by_cpu.iter().zip(&cast.codes);
            let differ = codes.filter(|(a, b)| (*a ^ *b) & !AMBIGUOUS != 0).count();
            // Only where a beam meets an edge within rounding.
            assert!(differ <= 2, "{differ} rays of {}", by_cpu.len());
        }
        // Less than a workgroup, not a multiple of one, less than a job, more.
        for rays in [40, 1000, 6400, 25_001] {
            Arc::get_mut(&mut caster.core).unwrap().limits.rays = rays;
            let pending = caster.submit(&jobs).unwrap();
            assert!(pending.dispatches.len() >= 50_000 / rays);
            assert_eq!(wait(pending), whole, "{rays} rays a dispatch");
        }
    }

    #[test]
    fn targets_that_fill_a_binding_are_parted() {
        let mut caster = need!(caster());
        let jobs = jobs();
        let whole = wait(caster.submit(&jobs).unwrap());
        // Four triangles of 48 bytes each: room for two targets.
        Arc::get_mut(&mut caster.core).unwrap().limits.binding_bytes = 2 * 4 * 48;
        let pending = caster.submit(&jobs).unwrap();
        assert_eq!(pending.dispatches.len(), 3);
        assert_eq!(wait(pending), whole);
    }

    #[test]
    fn a_target_beyond_a_binding_is_refused_by_name() {
        let mut caster = need!(caster());
        Arc::get_mut(&mut caster.core).unwrap().limits.binding_bytes = 100;
        let Err(error) = caster.submit(&jobs()) else { panic!("it was accepted") };
        assert!(matches!(error, CastError::TooLarge { binding_bytes: 100, .. }), "{error}");
        assert!(error.to_string().contains(&caster.summary().name));
    }
}
