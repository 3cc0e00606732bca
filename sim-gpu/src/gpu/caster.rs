//! Sends batches through an adapter.

use super::adapter::{self, AdapterError, AdapterSummary};
use super::batch::{Batch, BatchLimits};
use super::compose::{Input, Module, WORKGROUP_SIZE, compose, modules, reads, words_per_ray};
use super::slot::Slot;
use crate::effects::Effects;
use crate::job::{Cast, CastJob};
use std::sync::{Arc, Mutex};

/// Rays in one dispatch: enough to fill any adapter, few enough that a display
/// driver's watchdog does not stop it.
const RAYS_PER_DISPATCH: usize = 1 << 22;

/// Casting on an adapter failed.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// The adapter asked for is not there.
    #[error(transparent)]
    Adapter(#[from] AdapterError),
    /// The adapter would not open.
    #[error("adapter {name}: {cause}; try --adapter cpu")]
    Open {
        /// The adapter.
        name: String,
        /// Why.
        cause: wgpu::RequestDeviceError,
    },
    /// A mesh is too large for the adapter's bindings.
    #[error("adapter {name}: a mesh of {nodes} nodes exceeds a binding of {binding_bytes} bytes")]
    TooLarge {
        /// The adapter.
        name: String,
        /// The mesh's nodes.
        nodes: usize,
        /// The limit.
        binding_bytes: usize,
    },
    /// The device stopped answering.
    #[error("adapter {name}: {cause}; try --adapter cpu")]
    Lost {
        /// The adapter.
        name: String,
        /// What it said.
        cause: String,
    },
}

/// Casts on one adapter, for one set of effects.
pub struct GpuCaster {
    core: Arc<Core>,
}

/// What batches under way share with their caster.
pub(super) struct Core {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) modules: Vec<Module>,
    effects: Effects,
    summary: AdapterSummary,
    limits: BatchLimits,
    idle: Mutex<Vec<Slot>>,
    failure: Arc<Mutex<Option<String>>>,
}

/// A job's rays, as cut into dispatches.
struct Part {
    job: usize,
    rays: usize,
}

/// Jobs on their way through the adapter.
pub struct Pending {
    core: Arc<Core>,
    dispatches: Vec<(Slot, Vec<Part>)>,
    jobs: usize,
}

impl GpuCaster {
    /// Opens `adapter` and compiles the shader variant that models `effects`.
    ///
    /// # Errors
    /// If the adapter gives no device.
    pub fn open(adapter: &wgpu::Adapter, effects: &Effects) -> Result<Self, GpuError> {
        let summary = adapter::summary(adapter);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("edgepuck"),
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|cause| GpuError::Open { name: summary.name.clone(), cause })?;
        let failure = Arc::new(Mutex::new(None));
        let seen = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error| {
            let mut seen = seen.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            seen.get_or_insert_with(|| error.to_string());
        }));
        let modules = modules(effects);
        let pipeline = pipeline(&device, &modules);
        let limits = limits(&device.limits(), &modules);
        let idle = Mutex::new(Vec::new());
        let effects = effects.clone();
        let core =
            Core { device, queue, pipeline, modules, effects, summary, limits, idle, failure };
        core.check()?;
        Ok(Self { core: Arc::new(core) })
    }

    /// What there is to say of the adapter.
    #[must_use]
    pub fn summary(&self) -> &AdapterSummary {
        &self.core.summary
    }

    /// The effects that are modelled.
    #[must_use]
    pub fn effects(&self) -> &Effects {
        &self.core.effects
    }

    /// What one dispatch can hold.
    #[must_use]
    pub fn limits(&self) -> &BatchLimits {
        &self.core.limits
    }

    /// Uploads and starts `jobs`, in as few dispatches as the limits allow.
    ///
    /// # Errors
    /// If a mesh exceeds the limits or the device failed.
    pub fn submit(&self, jobs: &[CastJob]) -> Result<Pending, GpuError> {
        let core = &self.core;
        let mut pending =
            Pending { core: Arc::clone(core), dispatches: Vec::new(), jobs: jobs.len() };
        let mut batch = Batch::default();
        let mut parts = Vec::new();
        for (at, job) in jobs.iter().enumerate() {
            if !core.limits.holds(&job.target) {
                return Err(self.too_large(job));
            }
            let mut start = 0;
            while start < job.rays.len() {
                let left = job.rays.len() - start;
                if !batch.has_room(&job.target, left.min(WORKGROUP_SIZE), &core.limits) {
                    pending.dispatch(std::mem::take(&mut batch), std::mem::take(&mut parts));
                }
                let rays = left.min(core.limits.rays - batch.rays.len());
                batch.push(job, start..start + rays, &core.modules);
                parts.push(Part { job: at, rays });
                start += rays;
            }
        }
        pending.dispatch(batch, parts);
        core.check()?;
        Ok(pending)
    }

    fn too_large(&self, job: &CastJob) -> GpuError {
        GpuError::TooLarge {
            name: self.core.summary.name.clone(),
            nodes: job.target.bvh.nodes.len(),
            binding_bytes: self.core.limits.binding_bytes,
        }
    }
}

impl Core {
    /// An error if the device reported one.
    fn check(&self) -> Result<(), GpuError> {
        let failure = self.failure.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        match &*failure {
            None => Ok(()),
            Some(cause) => {
                Err(GpuError::Lost { name: self.summary.name.clone(), cause: cause.clone() })
            }
        }
    }

    fn idle(&self) -> std::sync::MutexGuard<'_, Vec<Slot>> {
        self.idle.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Pending {
    fn dispatch(&mut self, batch: Batch, parts: Vec<Part>) {
        if batch.rays.is_empty() {
            return;
        }
        let mut slot = self.core.idle().pop().unwrap_or_default();
        slot.start(&self.core, &batch);
        self.dispatches.push((slot, parts));
    }

    /// The answers, one per job, in order.
    ///
    /// # Errors
    /// If the device was lost.
    pub fn wait(self) -> Result<Vec<Cast>, GpuError> {
        let words_per_ray = words_per_ray(&self.core.modules);
        let mut casts = vec![Cast::default(); self.jobs];
        for (slot, parts) in self.dispatches {
            let answer = slot
                .wait(&self.core)
                .map_err(|cause| GpuError::Lost { name: self.core.summary.name.clone(), cause });
            self.core.check()?;
            let (codes, words) = answer?;
            let (mut codes, mut words) = (&codes[..], &words[..]);
            for Part { job, rays } in parts {
                casts[job].codes.extend_from_slice(&codes[..rays]);
                casts[job].words.extend_from_slice(&words[..rays * words_per_ray]);
                (codes, words) = (&codes[rays..], &words[rays * words_per_ray..]);
            }
            self.core.idle().push(slot);
        }
        Ok(casts)
    }
}

fn limits(limits: &wgpu::Limits, modules: &[Module]) -> BatchLimits {
    let binding = usize::try_from(limits.max_storage_buffer_binding_size).unwrap_or(usize::MAX);
    let buffer = usize::try_from(limits.max_buffer_size).unwrap_or(usize::MAX);
    let binding_bytes = binding.min(buffer);
    // A ray is the largest record per ray, unless many words are asked for.
    let per_ray = (4 * words_per_ray(modules)).max(size_of::<crate::ray::TraceRay>());
    let per_axis = limits.max_compute_workgroups_per_dimension as usize;
    let dispatchable = WORKGROUP_SIZE.saturating_mul(per_axis).saturating_mul(per_axis);
    let rays = RAYS_PER_DISPATCH.min(binding_bytes / per_ray).min(dispatchable);
    BatchLimits { binding_bytes, rays }
}

fn pipeline(device: &wgpu::Device, modules: &[Module]) -> wgpu::ComputePipeline {
    let storage = |binding, read_only| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let layout = |entries: &[wgpu::BindGroupLayoutEntry]| {
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries })
    };
    let trace = layout(&[storage(0, true), storage(1, true), storage(2, true), storage(3, false)]);
    let mut entries = vec![storage(0, false)];
    entries.extend(reads(modules, Input::Stream).then(|| storage(1, true)));
    entries.extend(reads(modules, Input::Reflectivity).then(|| storage(2, true)));
    let effects = (!modules.is_empty()).then(|| layout(&entries));
    let mut groups = vec![Some(&trace)];
    groups.extend(effects.iter().map(Some));
    let constants: Vec<_> = modules.iter().flat_map(|m| m.constants.iter().copied()).collect();
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("trace"),
        layout: Some(&device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &groups,
            immediate_size: 0,
        })),
        module: &device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("trace"),
            source: wgpu::ShaderSource::Wgsl(compose(modules).into()),
        }),
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants: &constants,
            // No workgroup memory is used.
            zero_initialize_workgroup_memory: false,
        },
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Builder;
    use crate::effects::{Dropout, Intensity, Noise, NoiseModel};
    use crate::job::Culling;
    use crate::mesh::Mesh;
    use crate::pose::Pose;
    use crate::ray::RayFrame;
    use crate::sensor::Sensor;
    use crate::target::{Surface, Target};
    use formats::rng::StreamKey;
    use glam::{DAffine3, DVec3};
    use test_support::need;

    /// A caster of all effects; an error if there is no adapter.
    fn caster() -> Result<GpuCaster, String> {
        let effects = Effects {
            noise: Some(Noise { mean_m: 0.0, sigma_m: 1.0, model: NoiseModel::Xyz }),
            dropout: Some(Dropout { probability: 0.5 }),
            intensity: Some(Intensity),
            quantum: None,
        };
        let best = test_support::adapter(adapter::adapters().into_iter().next())?;
        Ok(GpuCaster::open(&best, &effects).unwrap())
    }

    /// Pyramids of different sizes, each from its own side.
    fn jobs() -> Vec<CastJob> {
        let pattern = Sensor::builtin("generic-static").unwrap().pattern();
        (1..6u32)
            .map(|i| {
                let vertices = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::ONE * f64::from(i)];
                let triangles = vec![[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]];
                let surface = Surface::new(Mesh { vertices, triangles }, vec![0, 1, 2, 3]);
                let position_m = DVec3::new(4.0, f64::from(i) - 3.0, 1.0) * f64::from(i);
                let pose = Pose::look_at(position_m, DVec3::ZERO).unwrap();
                let frame = RayFrame::new(&surface, &DAffine3::IDENTITY, &pose);
                let target = Arc::new(Target::new(surface, Builder::Sah));
                let stream = StreamKey::new(0, "pyramid", i);
                CastJob::aim(target, frame, &pattern, Culling::Off, stream, 0.1 * i as f32)
            })
            .collect()
    }

    #[test]
    fn rays_cut_into_many_dispatches_answer_as_in_one() {
        let mut caster = need!(caster());
        let jobs = jobs();
        let whole = caster.submit(&jobs).unwrap().wait().unwrap();
        assert_eq!(whole.iter().map(|cast| cast.codes.len()).sum::<usize>(), 50_000);
        // Less than a workgroup, no multiple of one, less than a job, more.
        for rays in [40, 1000, 6400, 25_001] {
            Arc::get_mut(&mut caster.core).unwrap().limits.rays = rays;
            let pending = caster.submit(&jobs).unwrap();
            assert!(pending.dispatches.len() >= 50_000 / rays);
            assert_eq!(pending.wait().unwrap(), whole, "{rays} rays a dispatch");
        }
    }

    #[test]
    fn targets_that_fill_a_binding_are_parted() {
        let mut caster = need!(caster());
        let jobs = jobs();
        let whole = caster.submit(&jobs).unwrap().wait().unwrap();
        // Four triangles of 48 bytes each: room for two targets.
        Arc::get_mut(&mut caster.core).unwrap().limits.binding_bytes = 2 * 4 * 48;
        let pending = caster.submit(&jobs).unwrap();
        assert_eq!(pending.dispatches.len(), 3);
        assert_eq!(pending.wait().unwrap(), whole);
    }

    #[test]
    fn a_target_beyond_a_binding_is_refused_by_name() {
        let mut caster = need!(caster());
        Arc::get_mut(&mut caster.core).unwrap().limits.binding_bytes = 100;
        let Err(error) = caster.submit(&jobs()) else { panic!("it was accepted") };
        assert!(matches!(error, GpuError::TooLarge { binding_bytes: 100, .. }), "{error}");
        assert!(error.to_string().contains(&caster.summary().name));
    }
}
