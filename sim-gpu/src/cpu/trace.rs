//! Traces rays on all cores: the code of the nearest triangle of each, and the outputs of
//! effects. Twin of `shaders/trace.wgsl`.

use super::effects::append_outputs;
use super::frustum::Frustum;
use super::interleaved::Interleaved;
#[cfg(target_arch = "x86_64")]
use super::packet::Packets;
use super::traverse::{Instructions, PACKET, Portable};
use crate::bvh::WideBvh;
use crate::effects::Effects;
use crate::job::{Cast, CastJob};
use crate::lanes::{Lanewise, widest};
use crate::ray::{AMBIGUOUS, MISS, Ray, TraceRay};
#[cfg(target_arch = "x86_64")]
use fearless_simd::Level;
use fearless_simd::Simd;
use glam::Vec3;
use rayon::prelude::*;

/// Rays per task: enough to hide the cost of scheduling it.
const TASK: usize = 2048;

/// The code of each ray, on all cores. `[n_rays]`, in order.
#[must_use]
pub fn trace(tree: &WideBvh, rays: &[TraceRay]) -> Vec<u32> {
    let mut codes = vec![MISS; rays.len()];
    codes
        .par_chunks_mut(TASK)
        .zip(rays.par_chunks(TASK))
        .for_each(|(codes, rays)| widest(Task { tree, rays, codes }));
    codes
}

struct Task<'a> {
    tree: &'a WideBvh,
    rays: &'a [TraceRay],
    codes: &'a mut [u32],
}

impl Lanewise for Task<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        match simd.level() {
            // Packets need registers of eight lanes.
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(_) | Level::Avx512(_) => self.trace(Packets(simd)),
            _ => self.trace(Portable),
        }
    }
}

impl Task<'_> {
    /// Traces coherent rays in packets, and the others interleaved.
    #[inline(always)]
    fn trace<I: Instructions>(self, by: I) {
        let Self { tree, rays, codes } = self;
        // Filled once per task, not once per ray.
        let mut stacks = I::Stacks::default();
        let mut interleaved = Interleaved::for_tree(tree);
        let mut from = 0;
        while from < rays.len() {
            // Incoherent rays before the next packet go interleaved, up to the end if there is
            // none.
            let packet = next_packet(rays, from);
            let at = packet.as_ref().map_or(rays.len(), |(at, ..)| *at);
            interleaved.trace(tree, &rays[from..at], &mut codes[from..at], by);
            from = at;
            if let Some((_, rays, frustum)) = packet {
                from += PACKET;
                codes[at..from].copy_from_slice(&by.trace(tree, &mut stacks, rays, frustum));
            }
        }
    }
}

/// The first packet of coherent rays from number `from` on, and the number of its first ray.
#[inline(always)]
fn next_packet(rays: &[TraceRay], from: usize) -> Option<(usize, &[TraceRay; PACKET], Frustum)> {
    for (rays, at) in rays[from..].as_chunks().0.iter().zip((from..).step_by(PACKET)) {
        if let Some(frustum) = Frustum::around(rays) {
            return Some((at, rays, frustum));
        }
    }
    None
}

/// Casts `job` and models `effects`, on all cores.
#[must_use]
pub fn cast(job: &CastJob, effects: &Effects) -> Cast {
    let codes = trace(&job.target.bvh.wide, job.rays());
    let per_ray = effects.outputs_per_ray();
    if per_ray == 0 {
        return Cast { codes, effect_outputs: Vec::new() };
    }
    let mut effect_outputs = Vec::with_capacity(codes.len() * per_ray);
    for ((&code, &beam), ray) in codes.iter().zip(&job.beams).zip(job.rays()) {
        // Outputs of misses are not meaningful, but keep the places of the others.
        if code == MISS {
            effect_outputs.resize(effect_outputs.len() + per_ray, 0.0);
            continue;
        }
        // Effects use the direction alone, for which f32 is accurate enough.
        let ray = Ray {
            origin: Vec3::from_array(ray.origin).as_dvec3(),
            direction: Vec3::from_array(ray.direction).as_dvec3(),
        };
        append_outputs(&mut effect_outputs, effects, job, beam, &ray, code & !AMBIGUOUS);
    }
    Cast { codes, effect_outputs }
}

#[cfg(test)]
mod tests;
