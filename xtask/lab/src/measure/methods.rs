//! Methods that find the ranges of rays on the CPU, from exact to fast.

use super::ray_set::RaySet;
use glam::Vec3;
use rayon::prelude::*;
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
