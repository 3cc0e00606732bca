//! From a mesh and a sensor to hits, in one call.

use formats::rng::StreamKey;
use glam::{DAffine3, DQuat, DVec3};
use sim_gpu::bvh::Builder;
use sim_gpu::caster::Caster;
use sim_gpu::effects::Effects;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::Mesh;
use sim_gpu::mesh::validate::triangle_stats;
use sim_gpu::pose::Pose;
use sim_gpu::ray::RayFrame;
use sim_gpu::resolve::{Hits, resolve};
use sim_gpu::sensor::{BeamPattern, Sensor};
use sim_gpu::target::{Surface, Target};

/// `mesh` without its degenerate and duplicate triangles, ready for casting.
#[must_use]
pub fn target(mesh: &Mesh) -> Target {
    target_by(Builder::Sah, mesh)
}

/// As [`target`], by this builder.
#[must_use]
pub fn target_by(builder: Builder, mesh: &Mesh) -> Target {
    let kept = triangle_stats(mesh).kept;
    Target::new(Surface::new(mesh.clone(), kept), builder)
}

/// The beams of a sensor that comes with the program.
///
/// # Panics
/// If there is no such sensor.
#[must_use]
pub fn builtin(name: &str) -> BeamPattern {
    Sensor::builtin(name).unwrap_or_else(|| panic!("no sensor {name}")).pattern()
}

/// Beams in these directions, which are brought to unit length.
#[must_use]
pub fn beams(directions: impl IntoIterator<Item = DVec3>) -> BeamPattern {
    let directions: Vec<DVec3> = directions.into_iter().map(DVec3::normalize).collect();
    let n = directions.len();
    BeamPattern::new(directions, vec![0; n], vec![0.0; n])
}

/// A sensor at `position_m` whose axes are the world's.
#[must_use]
pub fn at(position_m: DVec3) -> Pose {
    Pose { position_m, world_from_sensor: DQuat::IDENTITY }
}

/// `pattern` from `pose` at a target whose frame is the world's.
#[must_use]
pub fn job(target: &Target, pose: &Pose, pattern: &BeamPattern) -> CastJob {
    job_with(target, pose, pattern, Culling::On)
}

/// As [`job`], with or without culling.
#[must_use]
pub fn job_with(target: &Target, pose: &Pose, pattern: &BeamPattern, culling: Culling) -> CastJob {
    let frame = RayFrame::new(&target.surface, &DAffine3::IDENTITY, pose);
    let stream = StreamKey::new(7, "object", 0);
    CastJob::aim(target.clone(), frame, pattern, culling, stream, 0.75)
}

/// What `caster` finds for `job`, without effects.
///
/// # Panics
/// If casting fails.
#[must_use]
pub fn hits(caster: &Caster, job: &CastJob, pattern: &BeamPattern) -> Hits {
    hits_with(caster, job, pattern, &Effects::default())
}

/// What `caster`, which was opened for `effects`, finds for `job`.
///
/// # Panics
/// If casting fails.
#[must_use]
pub fn hits_with(caster: &Caster, job: &CastJob, pattern: &BeamPattern, effects: &Effects) -> Hits {
    let casts = caster.cast(std::slice::from_ref(job)).unwrap_or_else(|error| panic!("{error}"));
    resolve(job, &casts[0], pattern, effects)
}
