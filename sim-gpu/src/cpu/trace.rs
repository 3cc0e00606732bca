//! One ray per call: the nearest triangle's code, and what the effects asked
//! for. Twin of `shaders/trace.wgsl`.

use super::effects::append_outputs;
use super::frustum::Frustum;
use super::interleaved::Interleaved;
#[cfg(target_arch = "x86_64")]
use super::packet;
use super::traverse::{Prepared, enter, traverse};
use crate::bvh::{Entered, Stack, WideBvh, WideNode};
use crate::effects::Effects;
use crate::job::{Cast, CastJob};
#[cfg(target_arch = "x86_64")]
use crate::lanes::has_avx2;
use crate::ray::{AMBIGUOUS, MISS, Ray, TraceRay};
use glam::Vec3;
use rayon::prelude::*;

/// Rays that one task traces: enough to hide the cost of handing it over.
const TASK: usize = 2048;

/// The code of each ray, on all cores. `[n_rays]`, in order.
#[must_use]
pub fn trace(tree: &WideBvh, rays: &[TraceRay]) -> Vec<u32> {
    let mut codes = vec![MISS; rays.len()];
    let one_task = task_for_this_processor();
    codes
        .par_chunks_mut(TASK)
        .zip(rays.par_chunks(TASK))
        .for_each(|(codes, rays)| one_task(tree, rays, codes));
    codes
}

type Task = fn(&WideBvh, &[TraceRay], &mut [u32]);

/// How many rays are looked at together.
const PACKET: usize = 8;

/// The code of each of `rays`: `side_by_side` traces those that run so, the others
/// are traced interleaved. `enter` does what `traverse::enter` does.
#[inline(always)]
fn task(
    tree: &WideBvh,
    rays: &[TraceRay],
    codes: &mut [u32],
    mut side_by_side: impl FnMut(&[TraceRay; PACKET], Frustum) -> [u32; PACKET],
    enter: impl Fn(&Prepared, &WideNode, f32) -> Entered<f32>,
) {
    let (packets, _) = rays.as_chunks();
    let mut apart = Interleaved::for_tree(tree);
    // From here on rays have still to be traced.
    let mut from = 0;
    for (packet, at) in packets.iter().zip((0..).step_by(PACKET)) {
        if let Some(frustum) = Frustum::around(packet) {
            apart.trace(tree, &rays[from..at], &mut codes[from..at], &enter);
            from = at + PACKET;
            codes[at..from].copy_from_slice(&side_by_side(packet, frustum));
        }
    }
    apart.trace(tree, &rays[from..], &mut codes[from..], &enter);
}

fn task_anywhere(tree: &WideBvh, rays: &[TraceRay], codes: &mut [u32]) {
    let mut stack = Stack::default();
    let one_by_one = |rays: &[TraceRay; PACKET], _| {
        rays.each_ref().map(|ray| traverse(tree, &mut stack, ray).code(ray.skipped))
    };
    task(tree, rays, codes, one_by_one, enter);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn task_avx2(tree: &WideBvh, rays: &[TraceRay], codes: &mut [u32]) {
    let mut stacks = packet::Stacks::default();
    let at_once =
        |rays: &[TraceRay; PACKET], frustum| packet::trace(tree, &mut stacks, rays, frustum);
    task(tree, rays, codes, at_once, |ray, node, far| packet::enter(ray, node, far));
}

fn task_for_this_processor() -> Task {
    #[cfg(target_arch = "x86_64")]
    if has_avx2() {
        // SAFETY: the processor has the instructions.
        return |tree, rays, codes| unsafe { task_avx2(tree, rays, codes) };
    }
    task_anywhere
}

/// Casts `job` and models `effects`, on all cores.
#[must_use]
pub fn cast(job: &CastJob, effects: &Effects) -> Cast {
    let codes = trace(&job.target.bvh.wide, &job.rays);
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

#[cfg(test)]
mod tests;
