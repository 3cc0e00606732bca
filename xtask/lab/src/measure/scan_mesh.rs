//! One sensor's scan of one object, on the CPU, without files.

use crate::study::casting::speed::target;
use anyhow::{Context, Result};
use formats::scan::Scan;
use glam::DAffine3;
use sim_gpu::bvh::Builder;
use sim_gpu::caster::Caster;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::frame::{Normalize, to_world};
use sim_gpu::mesh::load;
use sim_gpu::mesh::tree::MeshEntry;
use sim_gpu::ray::RayFrame;
use sim_gpu::resolve::{Hits, resolve};
use sim_gpu::scan::{Seen, View, assemble};
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

/// What `view` sees of `target`, which stands where its mesh says: the scan, and
/// the hits before any effect.
pub fn scan(target: &Arc<Target>, view: &View) -> (Scan, Hits) {
    let &View { pattern, pose, cast_effects, stream, .. } = view;
    let world_from_object = &DAffine3::IDENTITY;
    let frame = RayFrame::new(&target.surface, world_from_object, pose);
    let job = CastJob::aim(Arc::clone(target), frame, pattern, Culling::On, stream, 1.0);
    let casts = Caster::Cpu(cast_effects.clone()).cast_on_cpu(std::slice::from_ref(&job));
    let hits = resolve(&job, &casts[0], pattern, cast_effects);
    let seen = [Seen { object: 0, world_from_object, job: &job, hits: &hits }];
    (assemble(view, &seen).0, hits)
}
