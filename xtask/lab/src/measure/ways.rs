//! Ways from rays to ranges on the CPU, from exact to quick.

use super::moller_trumbore;
use super::shot::Shot;
use rayon::prelude::*;
use sim_gpu::cpu::oracle;
use sim_gpu::cpu::traverse::traverse;
use sim_gpu::ray::{MISS, TraceRay};

/// By the f64 oracle; `[n_rays]`, metres.
pub fn in_f64(shot: &Shot) -> Vec<Option<f64>> {
    let target = &shot.job.target;
    shot.rays.par_iter().map(|ray| oracle::nearest(target, ray).map(|c| c.range_m)).collect()
}

/// By Möller and Trumbore's test in f32.
pub fn moller_trumbore(shot: &Shot) -> Vec<Option<f64>> {
    in_f32(shot, |ray| {
        let t = moller_trumbore::nearest(&shot.job.target.bvh, ray);
        t.is_finite().then_some(t)
    })
}

/// By the watertight test in f32, with the range that it finds.
pub fn watertight_in_f32(shot: &Shot) -> Vec<Option<f64>> {
    let bvh = &shot.job.target.bvh;
    in_f32(shot, |ray| {
        let nearest = traverse(&bvh.nodes, &bvh.triangles, ray);
        (nearest.index != MISS).then_some(nearest.t)
    })
}

/// Ranges as f32 leaves them: the distance skipped and the one traced.
fn in_f32(shot: &Shot, nearest: impl Fn(&TraceRay) -> Option<f32> + Sync) -> Vec<Option<f64>> {
    let scale = shot.job.target.surface.frame.scale;
    let range = |ray: &TraceRay| nearest(ray).map(|t| f64::from(ray.skipped + t) * scale);
    shot.job.rays.par_iter().map(range).collect()
}
