//! One ray per call: the nearest triangle's code, and what the effects asked
//! for. Twin of `shaders/trace.wgsl`.

use super::effects::append_outputs;
use super::traverse::traverse;
use crate::bvh::{LeafTriangle, Node};
use crate::effects::Effects;
use crate::job::{Cast, CastJob};
use crate::ray::{AMBIGUOUS, MISS, Ray, TraceRay};
use glam::Vec3;
use rayon::prelude::*;

/// Rays that one task traces: enough to hide the cost of handing it over.
const TASK: usize = 2048;

/// The code of each ray, on all cores. `[n_rays]`, in order.
#[must_use]
pub fn trace(nodes: &[Node], triangles: &[LeafTriangle], rays: &[TraceRay]) -> Vec<u32> {
    let mut codes = vec![MISS; rays.len()];
    if triangles.is_empty() {
        return codes;
    }
    codes.par_chunks_mut(TASK).zip(rays.par_chunks(TASK)).for_each(|(codes, rays)| {
        for (code, ray) in codes.iter_mut().zip(rays) {
            *code = traverse(nodes, triangles, ray).code(ray.skipped);
        }
    });
    codes
}

/// Casts `job` and models `effects`, on all cores.
#[must_use]
pub fn cast(job: &CastJob, effects: &Effects) -> Cast {
    let bvh = &job.target.bvh;
    let codes = trace(&bvh.nodes, &bvh.triangles, &job.rays);
    let per_ray = effects.outputs_per_ray();
    if per_ray == 0 {
        return Cast { codes, effect_outputs: Vec::new() };
    }
    let mut effect_outputs = Vec::with_capacity(codes.len() * per_ray);
    for ((&code, &beam), ray) in codes.iter().zip(&job.beams).zip(&job.rays) {
        if code == MISS {
            effect_outputs.resize(effect_outputs.len() + per_ray, 0.0);
            continue;
        }
        // Only the direction matters to an effect, and f32 holds it well.
        let ray = Ray {
            origin: Vec3::from_array(ray.origin).as_dvec3(),
            direction: Vec3::from_array(ray.direction).as_dvec3(),
        };
        append_outputs(&mut effect_outputs, effects, job, beam, &ray, code & !AMBIGUOUS);
    }
    Cast { codes, effect_outputs }
}
