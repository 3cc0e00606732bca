//! Finds the nearest triangle along a ray. Twin of `shaders/traverse.wgsl`.

use super::intersect::{Candidate, Shear, intersect};
use crate::bvh::{self, LeafTriangle, Node};
use crate::ray::{AMBIGUOUS, MISS, NO_HIT, TraceRay};
use glam::{Vec3, Vec3A};

/// Directions closer to zero than this count as this: a reciprocal stays
/// finite and boxes are padded by far more than a ray drifts by it.
pub const LEAST_COMPONENT: f32 = 1e-20;

/// Bounds the rounding of near and far together: Ize, "Robust BVH ray
/// traversal", JCGT 2(2), 2013; twice his 1 + 2 gamma(3), and room for the
/// 2.5 ULP that WGSL allows a division.
pub const FAR_SCALE: f32 = 1.0 + 32.0 / 16_777_216.0;

/// Relative accuracy that a range found in f32 must allow; where it does not,
/// f64 decides.
pub const ACCURACY: f32 = 1e-6;

/// What is known of the nearest surface while a ray is traced.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// Distance from the ray's origin, unit lengths.
    pub t: f32,
    /// How far the true distance may be from `t`.
    pub error: f32,
    /// The triangle's index in its mesh, or [`MISS`].
    pub index: u32,
    /// No surface that starts beyond this can be the nearest.
    farthest: f32,
    /// The lowest distance that another surface may truly have.
    rival: f32,
}

fn reciprocal(direction: Vec3) -> Vec3A {
    let away = |d: f32| {
        if d.abs() >= LEAST_COMPONENT {
            d
        } else if d >= 0.0 {
            LEAST_COMPONENT
        } else {
            -LEAST_COMPONENT
        }
    };
    Vec3A::new(1.0 / away(direction.x), 1.0 / away(direction.y), 1.0 / away(direction.z))
}

/// A ray as slab tests see it: distance to a plane at x is
/// x * `per_direction` + `offset`. Rounding moves the plane by 4 * 2^-24 at
/// most, for which boxes are padded.
#[derive(Clone, Copy)]
struct Slabs {
    per_direction: Vec3A,
    offset: Vec3A,
}

/// Where the ray enters the box; infinity if it does not.
#[inline]
fn enter(low: [f32; 3], high: [f32; 3], slabs: Slabs, farthest: f32) -> f32 {
    let t0 = Vec3A::from_array(low) * slabs.per_direction + slabs.offset;
    let t1 = Vec3A::from_array(high) * slabs.per_direction + slabs.offset;
    let near = t0.min(t1).max_element().max(0.0);
    let far = t0.max(t1).min_element().min(farthest) * FAR_SCALE;
    if near <= far { near } else { f32::INFINITY }
}

impl Nearest {
    const NONE: Self = Self { t: NO_HIT, error: 0.0, index: MISS, farthest: NO_HIT, rival: NO_HIT };

    #[inline]
    fn consider(&mut self, candidate: Candidate, index: u32) {
        let wins = candidate.t < self.t || (candidate.t == self.t && index < self.index);
        let loser = if wins { self.t - self.error } else { candidate.t - candidate.error };
        self.rival = self.rival.min(loser).min(candidate.rival);
        self.farthest = self.farthest.min(candidate.t + candidate.error);
        if wins {
            (self.t, self.error, self.index) = (candidate.t, candidate.error, index);
        }
    }

    /// The caster's answer: index, [`MISS`], and whether f64 must decide.
    #[must_use]
    pub fn code(&self, skipped: f32) -> u32 {
        if self.index == MISS {
            return MISS;
        }
        let doubt = self.t + self.error - self.rival;
        if doubt > ACCURACY * (skipped + self.t) { self.index | AMBIGUOUS } else { self.index }
    }
}

/// Finds the nearest triangle along `ray`.
#[must_use]
pub fn traverse(nodes: &[Node], triangles: &[LeafTriangle], ray: &TraceRay) -> Nearest {
    let direction = Vec3::from_array(ray.direction);
    let origin = Vec3::from_array(ray.origin);
    let shear = Shear::of(direction);
    let per_direction = reciprocal(direction);
    let slabs = Slabs { per_direction, offset: -(Vec3A::from(origin) * per_direction) };
    let mut nearest = Nearest::NONE;
    bvh::traverse(
        nodes,
        ray.root,
        &mut nearest,
        |nearest, low, high| enter(low, high, slabs, nearest.farthest),
        |nearest, leaf| {
            for triangle in &triangles[leaf] {
                if let Some(candidate) = intersect(origin, &shear, triangle) {
                    nearest.consider(candidate, triangle.index);
                }
            }
        },
    );
    nearest
}
