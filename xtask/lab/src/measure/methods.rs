//! Methods that find the ranges of rays on the CPU, from exact to fast, and their errors.

use super::ray_set::RaySet;
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;
use sim_gpu::internals::bvh::{
    self, Entered, LEAF, Leaf4, Search, Stack, WIDTH, WideBvh, WideChild, WideNode, boxes_that,
};
use sim_gpu::internals::cpu::oracle;
use sim_gpu::internals::cpu::traverse::traverse;
use sim_gpu::internals::ray::{MISS, TraceRay};

/// The f64 oracle; `[n_rays]`, metres.
pub fn in_f64(ray_set: &RaySet) -> Vec<Option<f64>> {
    let target = &ray_set.job.target;
    ray_set.rays.par_iter().map(|ray| oracle::nearest(target, ray).map(|c| c.range_m)).collect()
}

/// Möller and Trumbore's test in f32: the common method, as a measure of what
/// watertightness and accuracy cost.
pub fn moller_trumbore(ray_set: &RaySet) -> Vec<Option<f64>> {
    in_f32(ray_set, |ray| {
        let t = moller_trumbore_nearest(&ray_set.job.target.bvh.wide, ray);
        t.is_finite().then_some(t)
    })
}

/// The watertight test in f32, with the range that it finds.
pub fn watertight_in_f32(ray_set: &RaySet) -> Vec<Option<f64>> {
    let tree = &ray_set.job.target.bvh.wide;
    in_f32(ray_set, |ray| {
        let nearest = traverse(tree, &mut Stack::default(), ray);
        (nearest.index != MISS).then_some(nearest.t)
    })
}

/// Ranges in f32: the distance skipped and the distance traced.
fn in_f32(ray_set: &RaySet, nearest: impl Fn(&TraceRay) -> Option<f32> + Sync) -> Vec<Option<f64>> {
    let scale = ray_set.job.target.surface.frame.scale;
    let range = |ray: &TraceRay| nearest(ray).map(|t| f64::from(ray.skipped + t) * scale);
    ray_set.job.rays().par_iter().map(range).collect()
}

/// Distance to the nearest triangle along `ray` from its origin, unit lengths; infinite if
/// there is none: Möller and Trumbore, "Fast, minimum storage ray/triangle intersection",
/// JGT 2(1), 1997, over the same tree, with a plain slab test.
fn moller_trumbore_nearest(tree: &WideBvh, ray: &TraceRay) -> f32 {
    let direction = Vec3::from_array(ray.direction);
    let mut search = MollerTrumbore {
        origin: Vec3::from_array(ray.origin),
        direction,
        per_direction: direction.recip(),
        nearest: f32::INFINITY,
    };
    bvh::traverse(tree, WideChild::ROOT, &mut Stack::default(), &mut search);
    search.nearest
}

struct MollerTrumbore {
    origin: Vec3,
    direction: Vec3,
    per_direction: Vec3,
    nearest: f32,
}

impl Search for MollerTrumbore {
    type Distance = f32;

    fn enter(&self, node: &WideNode) -> Entered<f32> {
        enter(node, self.origin, self.per_direction, self.nearest)
    }

    fn matters(&self, distance: f32) -> bool {
        distance <= self.nearest
    }

    fn visit(&mut self, leaf: &Leaf4) {
        for i in 0..LEAF {
            let corner = |c: usize| Vec3::from_array(leaf.corners[c].map(|axis| axis[i]));
            let t = intersect(self.origin, self.direction, [0, 1, 2].map(corner));
            self.nearest = self.nearest.min(t);
        }
    }
}

fn enter(node: &WideNode, origin: Vec3, per_direction: Vec3, farthest: f32) -> Entered<f32> {
    let (mut near, mut far) = ([0.0f32; WIDTH], [farthest; WIDTH]);
    for axis in 0..3 {
        let [low, high] = node.boxes.map(|corners| corners[axis]);
        for i in 0..WIDTH {
            let t0 = (low[i] - origin[axis]) * per_direction[axis];
            let t1 = (high[i] - origin[axis]) * per_direction[axis];
            near[i] = near[i].max(t0.min(t1));
            far[i] = far[i].min(t0.max(t1));
        }
    }
    (boxes_that(|i| near[i] <= far[i]), near)
}

fn intersect(origin: Vec3, direction: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
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

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    pub rays_compared: usize,
    /// Rays that hit something where the oracle finds nothing.
    pub false_hits: usize,
    /// Rays that hit nothing where the oracle finds something.
    pub misses: usize,
    pub worst_m: f64,
    pub rms_m: f64,
}

impl Accuracy {
    /// Compares `ranges` with `truth`, both `[n_rays]`, metres.
    pub fn of(ranges: &[Option<f64>], truth: &[Option<f64>]) -> Self {
        let mut accuracy =
            Self { rays_compared: truth.len(), false_hits: 0, misses: 0, worst_m: 0.0, rms_m: 0.0 };
        let (mut sum_of_squares, mut both_hit) = (0.0, 0usize);
        for pair in ranges.iter().zip(truth) {
            match pair {
                (Some(found), Some(true_m)) => {
                    let error_m = (found - true_m).abs();
                    accuracy.worst_m = accuracy.worst_m.max(error_m);
                    sum_of_squares += error_m * error_m;
                    both_hit += 1;
                }
                (Some(_), None) => accuracy.false_hits += 1,
                (None, Some(_)) => accuracy.misses += 1,
                (None, None) => {}
            }
        }
        accuracy.rms_m = (sum_of_squares / both_hit.max(1) as f64).sqrt();
        accuracy
    }

    /// False hits in a million rays.
    pub fn false_hits_per_million(&self) -> f64 {
        self.false_hits as f64 / self.rays_compared.max(1) as f64 * 1e6
    }

    /// Misses in a million rays.
    pub fn misses_per_million(&self) -> f64 {
        self.misses as f64 / self.rays_compared.max(1) as f64 * 1e6
    }
}

#[cfg(test)]
mod tests {
    use super::Accuracy;

    #[test]
    fn hits_and_misses_are_told_apart() {
        let found = [Some(1.0), Some(2.0), None, None, Some(5.0)];
        let truth = [Some(1.0), None, Some(3.0), None, Some(5.5)];
        let accuracy = Accuracy::of(&found, &truth);
        assert_eq!((accuracy.false_hits, accuracy.misses), (1, 1));
        assert_eq!((accuracy.worst_m, accuracy.rms_m), (0.5, 0.125f64.sqrt()));
        assert_eq!(accuracy.misses_per_million(), 200_000.0);
    }
}
