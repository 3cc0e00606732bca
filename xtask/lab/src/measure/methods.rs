//! Methods that find the ranges of rays on the CPU, from exact to fast.

use super::ray_set::RaySet;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use sim_gpu::bvh::{self, Bvh, LeafTriangle};
use sim_gpu::cpu::oracle;
use sim_gpu::cpu::traverse::traverse;
use sim_gpu::ray::{MISS, TraceRay};

/// The f64 oracle; `[n_rays]`, metres.
pub fn in_f64(ray_set: &RaySet) -> Vec<Option<f64>> {
    let target = &ray_set.job.target;
    ray_set.rays.par_iter().map(|ray| oracle::nearest(target, ray).map(|c| c.range_m)).collect()
}

/// Möller and Trumbore's test in f32: the common method, as a measure of what
/// watertightness and accuracy cost.
pub fn moller_trumbore(ray_set: &RaySet) -> Vec<Option<f64>> {
    in_f32(ray_set, |ray| {
        let t = moller_trumbore_nearest(&ray_set.job.target.bvh, ray);
        t.is_finite().then_some(t)
    })
}

/// The watertight test in f32, with the range that it finds.
pub fn watertight_in_f32(ray_set: &RaySet) -> Vec<Option<f64>> {
    let bvh = &ray_set.job.target.bvh;
    in_f32(ray_set, |ray| {
        let nearest = traverse(&bvh.nodes, &bvh.triangles, ray);
        (nearest.index != MISS).then_some(nearest.t)
    })
}

/// Ranges in f32: the distance skipped and the distance traced.
fn in_f32(ray_set: &RaySet, nearest: impl Fn(&TraceRay) -> Option<f32> + Sync) -> Vec<Option<f64>> {
    let scale = ray_set.job.target.surface.frame.scale;
    let range = |ray: &TraceRay| nearest(ray).map(|t| f64::from(ray.skipped + t) * scale);
    ray_set.job.rays.par_iter().map(range).collect()
}

/// Distance to the nearest triangle along `ray` from its origin, unit lengths; infinite if
/// there is none: Möller and Trumbore, "Fast, minimum storage ray/triangle intersection",
/// JGT 2(1), 1997, over the same tree, with a plain slab test.
fn moller_trumbore_nearest(bvh: &Bvh, ray: &TraceRay) -> f32 {
    let (origin, direction) = (Vec3::from_array(ray.origin), Vec3::from_array(ray.direction));
    let (corner, per_direction) = (Vec3A::from(origin), Vec3A::from(direction.recip()));
    let mut nearest = f32::INFINITY;
    bvh::traverse(
        &bvh.nodes,
        ray.root,
        &mut nearest,
        |&nearest, low, high| enter(low, high, corner, per_direction, nearest),
        |nearest, leaf| {
            for triangle in &bvh.triangles[leaf] {
                *nearest = nearest.min(intersect(origin, direction, triangle));
            }
        },
    );
    nearest
}

fn enter(low: [f32; 3], high: [f32; 3], origin: Vec3A, per_direction: Vec3A, farthest: f32) -> f32 {
    let t0 = (Vec3A::from_array(low) - origin) * per_direction;
    let t1 = (Vec3A::from_array(high) - origin) * per_direction;
    let near = t0.min(t1).max_element().max(0.0);
    let far = t0.max(t1).min_element().min(farthest);
    if near <= far { near } else { f32::INFINITY }
}

fn intersect(origin: Vec3, direction: Vec3, triangle: &LeafTriangle) -> f32 {
    let [a, b, c] = [triangle.a, triangle.b, triangle.c].map(Vec3::from_array);
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return f32::INFINITY;
    }
    let per_determinant = 1.0 / determinant;
    let from_a = origin - a;
    let u = from_a.dot(p) * per_determinant;
    let q = from_a.cross(ab);
    let v = direction.dot(q) * per_determinant;
    if u < 0.0 || v < 0.0 || u + v > 1.0 {
        return f32::INFINITY;
    }
    let t = ac.dot(q) * per_determinant;
    if t >= 0.0 { t } else { f32::INFINITY }
}
