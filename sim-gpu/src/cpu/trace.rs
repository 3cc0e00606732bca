//! One ray per call: the nearest triangle's code. Twin of
//! `shaders/trace.wgsl`.

use super::traverse::traverse;
use super::effects::words;
use crate::bvh::{LeafTriangle, Node};
use crate::caster::{Cast, CastJob};
use crate::effects::Effects;
use crate::ray::{AMBIGUOUS, MISS, TraceRay};
use crate::sensor::BeamPattern;
use rayon::prelude::*;

/// Rays that one task traces: enough to hide the cost of handing it over.
const TASK: usize = 2048;

/// The code of each ray, on all cores. `[n_rays]`, in order.
#[must_use]
pub fn trace(nodes: &[Node], triangles: &[LeafTriangle], rays: &[TraceRay]) -> Vec<u32> {
    let mut codes = vec![0; rays.len()];
    codes.par_chunks_mut(TASK).zip(rays.par_chunks(TASK)).for_each(|(codes, rays)| {
        for (code, ray) in codes.iter_mut().zip(rays) {
            *code = traverse(nodes, triangles, ray).code(ray.skipped);
        }
    });
    codes
}
