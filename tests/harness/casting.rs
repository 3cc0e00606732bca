//! From a mesh and a sensor to hits, in one call.

use edgepuck_mesh::TriangleMesh;
use edgepuck_mesh::validate::triangle_stats;
use formats::rng::StreamKey;
use glam::{DAffine3, DQuat, DVec3};
use sim_gpu::internals::bvh::{Builder, Bvh, TwoWide};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::job::{Cast, CastJob, Culling};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::ray::RayFrame;
use sim_gpu::internals::resolve::{Hits, resolve};
use sim_gpu::internals::sensor::{BeamPattern, SensorProfile};
use sim_gpu::internals::target::{Surface, Target};

/// `mesh` without its degenerate and duplicate triangles, ready for casting.
pub fn target(mesh: &TriangleMesh) -> Target {
    target_by(Builder::Sah, mesh)
}

/// As [`target`], by this builder.
pub fn target_by(builder: Builder, mesh: &TriangleMesh) -> Target {
    let kept = triangle_stats(mesh).kept;
    Target::new(Surface::new(mesh.clone(), kept), builder)
}

/// A tree as it is uploaded: its nodes, then its triangles.
pub fn tree_bytes(bvh: &Bvh) -> Vec<u8> {
    let TwoWide { nodes, triangles } = bvh.two_wide();
    [bytemuck::cast_slice::<_, u8>(nodes), bytemuck::cast_slice(triangles)].concat()
}

/// The beams of a sensor that comes with the program.
pub fn builtin(name: &str) -> BeamPattern {
    SensorProfile::builtin(name).unwrap_or_else(|| panic!("no sensor {name}")).pattern()
}

/// Beams in these directions, which are brought to unit length.
pub fn beams(directions: impl IntoIterator<Item = DVec3>) -> BeamPattern {
    let directions: Vec<DVec3> = directions.into_iter().map(DVec3::normalize).collect();
    let n = directions.len();
    BeamPattern::new(directions, vec![0; n], vec![0.0; n])
}

/// A sensor at `position_m` whose axes are the world's.
pub fn at(position_m: DVec3) -> Pose {
    Pose { position_m, rotation: DQuat::IDENTITY }
}

/// `pattern` from `pose` at a target whose frame is the world's.
pub fn job(target: &Target, pose: &Pose, pattern: &BeamPattern) -> CastJob {
    job_with(target, pose, pattern, Culling::On)
}

/// As [`job`], with or without culling.
pub fn job_with(target: &Target, pose: &Pose, pattern: &BeamPattern, culling: Culling) -> CastJob {
    placed_job(target, &DAffine3::IDENTITY, pose, pattern, culling)
}

/// As [`job_with`], at a target that stands elsewhere.
pub fn placed_job(
    target: &Target,
    world_from_object: &DAffine3,
    pose: &Pose,
    pattern: &BeamPattern,
    culling: Culling,
) -> CastJob {
    let frame = RayFrame::new(&target.surface, world_from_object, pose);
    let stream = StreamKey::new(7, "object", 0);
    CastJob::aim(target.clone(), frame, pattern, culling, stream, 0.75)
}

/// What `caster` answers for `job` alone.
pub fn cast(caster: &OpenCaster, job: &CastJob) -> Cast {
    let casts = caster.cast(std::slice::from_ref(job)).unwrap_or_else(|error| panic!("{error}"));
    casts.into_iter().next().expect("invariant: one job has one answer")
}

/// What `caster` finds for `job`.
pub fn hits(caster: &OpenCaster, job: &CastJob, pattern: &BeamPattern) -> Hits {
    resolve(job, &cast(caster, job), pattern, caster.effects())
}

/// The range of each beam of `pattern`; `None` for a beam that misses.
pub fn ranges(hits: &Hits, pattern: &BeamPattern) -> Vec<Option<f64>> {
    let mut ranges = vec![None; pattern.len()];
    hits.hits.iter().for_each(|hit| ranges[hit.beam as usize] = Some(hit.range_m));
    ranges
}
