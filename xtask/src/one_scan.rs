//! One sensor's scan of one object, on the CPU, without files.

use crate::bench::speed::target;
use anyhow::{Context, Result};
use formats::rng::StreamKey;
use formats::scan::{AttributeSet, Scan};
use glam::DAffine3;
use sim_gpu::bvh::Builder;
use sim_gpu::caster::Caster;
use sim_gpu::effects::Effects;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::frame::{Normalize, to_world};
use sim_gpu::mesh::load;
use sim_gpu::mesh::tree::MeshEntry;
use sim_gpu::pose::Pose;
use sim_gpu::ray::RayFrame;
use sim_gpu::resolve::{Hits, resolve};
use sim_gpu::scan::{Seen, View, assemble};
use sim_gpu::sensor::{BeamPattern, Sensor};
use sim_gpu::target::Target;
use std::sync::Arc;

/// The mesh of `entry` in the unit sphere, as casters want it.
///
/// # Errors
/// A mesh that cannot be read.
pub fn load_target(entry: &MeshEntry) -> Result<Arc<Target>> {
    let loaded = load(&entry.path).with_context(|| format!("cannot scan {}", entry.relative))?;
    let world = to_world(&loaded.mesh, loaded.format.default_up(), Normalize::default());
    Ok(target(world.mesh, Builder::Sah))
}

/// A sensor's look at an object that stands where its mesh says.
pub struct Look<'a> {
    /// The object.
    pub target: &'a Arc<Target>,
    /// The sensor.
    pub sensor: &'a Sensor,
    /// Its beams.
    pub pattern: &'a BeamPattern,
    /// Where it stands.
    pub pose: &'a Pose,
    /// What the scan models.
    pub effects: &'a Effects,
    /// What points carry besides positions.
    pub attributes: &'a AttributeSet,
    /// Keys its random numbers.
    pub stream: StreamKey,
}

impl Look<'_> {
    /// The scan, and the hits before any effect.
    pub fn scan(&self) -> (Scan, Hits) {
        let &Self { target, sensor, pattern, pose, effects, attributes, stream } = self;
        let frame = RayFrame::new(&target.surface, &DAffine3::IDENTITY, pose);
        let job = CastJob::aim(Arc::clone(target), frame, pattern, Culling::On, stream, 1.0);
        let casts = Caster::Cpu(effects.clone()).cast_on_cpu(std::slice::from_ref(&job));
        let hits = resolve(&job, &casts[0], pattern, effects);
        let cast_effects = effects;
        let view = View { sensor, pattern, pose, cast_effects, effects, attributes, stream };
        let world_from_object = &DAffine3::IDENTITY;
        let seen = [Seen { object: 0, world_from_object, job: &job, hits: &hits }];
        (assemble(&view, &seen).0, hits)
    }
}
