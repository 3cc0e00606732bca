//! Finds the nearest triangle along a ray. Twin of `shaders/traverse.wgsl`.

use super::frustum::Frustum;
use super::intersect::{Shear, intersect4};
use crate::bvh::{self, Entered, LEAF, Leaf4, Search, Stack, WIDTH, WideBvh, WideChild, WideNode};
use crate::ray::{AMBIGUOUS, MISS, NO_HIT, TraceRay};
use bytemuck::{must_cast, must_cast_ref};
use glam::{Vec3, Vec4};

/// Components of a direction closer to zero than this are replaced by this, so that their
/// reciprocals stay finite. Boxes are padded by far more than a ray drifts by it.
pub const LEAST_COMPONENT: f32 = 1e-20;

/// Bounds the rounding of near and far distances together: Ize, "Robust BVH ray traversal",
/// JCGT 2(2), 2013. Twice his 1 + 2 gamma(3), for the 2.5 ULP that WGSL allows a division.
pub const FAR_SCALE: f32 = 1.0 + 32.0 / 16_777_216.0;

/// The nearest surface along a ray so far.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// Distance from the ray's origin, unit lengths.
    pub t: f32,
    /// Bound of the difference between `t` and the true distance.
    pub error: f32,
    /// The triangle's index in its mesh, or [`MISS`].
    pub index: u32,
    /// Surfaces that begin beyond this are not the nearest.
    pub(super) farthest: f32,
    /// Lower bound of the true distance of every other surface that the ray may meet.
    pub(super) rival: f32,
}

/// A ray prepared for tests against boxes and triangles.
#[derive(Clone, Copy, Default)]
pub(super) struct Prepared {
    pub origin: Vec3,
    pub shear: Shear,
    /// The ray meets the plane at x at distance x * `per_direction` + `offset`. Rounding moves
    /// the plane by at most 4 * 2^-24, for which boxes are padded.
    pub per_direction: [f32; 3],
    pub offset: [f32; 3],
}

impl Prepared {
    #[inline(always)]
    pub fn new(ray: &TraceRay) -> Self {
        let direction = Vec3::from_array(ray.direction);
        let away = |d: f32| match d.abs() >= LEAST_COMPONENT {
            true => d,
            false if d >= 0.0 => LEAST_COMPONENT,
            false => -LEAST_COMPONENT,
        };
        let per_direction = ray.direction.map(|d| 1.0 / away(d));
        let [x, y, z] = ray.origin;
        let offset = [-(x * per_direction[0]), -(y * per_direction[1]), -(z * per_direction[2])];
        let origin = Vec3::from_array(ray.origin);
        Self { origin, shear: Shear::along(direction), per_direction, offset }
    }

    /// Updates `nearest` with the triangles at or below `from`.
    #[inline(always)]
    pub fn trace(
        &self,
        tree: &WideBvh,
        from: WideChild,
        stack: &mut Stack<f32>,
        nearest: &mut Nearest,
        by: impl Instructions,
    ) {
        bvh::traverse(tree, from, stack, &mut Along { ray: self, nearest, by });
    }
}

pub(super) struct Along<'a, I> {
    pub ray: &'a Prepared,
    pub nearest: &'a mut Nearest,
    pub by: I,
}

impl<I: Instructions> Search for Along<'_, I> {
    type Distance = f32;

    #[inline(always)]
    fn enter(&self, node: &WideNode) -> Entered<f32> {
        self.by.enter(self.ray, node, self.nearest.farthest)
    }

    #[inline(always)]
    fn matters(&self, distance: f32) -> bool {
        distance <= self.nearest.farthest * FAR_SCALE
    }

    #[inline(always)]
    fn visit(&mut self, leaf: &Leaf4) {
        self.nearest.consider_all(self.ray, leaf);
    }
}

/// How many coherent rays are traced together.
pub(super) const PACKET: usize = 8;

/// The instruction sets that trace rays. All give the same codes.
pub(super) trait Instructions: Copy {
    type Stacks: Default;

    fn enter(self, ray: &Prepared, node: &WideNode, farthest: f32) -> Entered<f32>;

    fn trace(
        self,
        tree: &WideBvh,
        stacks: &mut Self::Stacks,
        rays: &[TraceRay; PACKET],
        frustum: Frustum,
    ) -> [u32; PACKET];
}

/// Instructions of every processor: tests four boxes at once, and traces rays one by one.
#[derive(Clone, Copy)]
pub(super) struct Portable;

impl Instructions for Portable {
    type Stacks = Stack<f32>;

    #[inline(always)]
    fn enter(self, ray: &Prepared, node: &WideNode, farthest: f32) -> Entered<f32> {
        // Every processor has vectors of four lanes.
        let (mut entered, mut distances) = (0, [[0.0; 4]; WIDTH / 4]);
        for four in 0..WIDTH / 4 {
            let (mut near, mut far) = (Vec4::ZERO, Vec4::splat(farthest));
            for axis in 0..3 {
                let [t0, t1] = [0, 1].map(|side| {
                    let planes: &[[f32; 4]; WIDTH / 4] = must_cast_ref(&node.boxes[side][axis]);
                    Vec4::from_array(planes[four]) * ray.per_direction[axis] + ray.offset[axis]
                });
                // Ordered by value: this needs no sign of the direction.
                near = near.max(t0.min(t1));
                far = far.min(t0.max(t1));
            }
            entered |= near.cmple(far * FAR_SCALE).bitmask() << (4 * four);
            distances[four] = near.to_array();
        }
        (entered, must_cast(distances))
    }

    #[inline(always)]
    fn trace(
        self,
        tree: &WideBvh,
        stack: &mut Stack<f32>,
        rays: &[TraceRay; PACKET],
        _: Frustum,
    ) -> [u32; PACKET] {
        rays.each_ref().map(|ray| traverse(tree, stack, ray).code())
    }
}

impl Nearest {
    pub(super) const NONE: Self =
        Self { t: NO_HIT, error: 0.0, index: MISS, farthest: NO_HIT, rival: NO_HIT };

    #[inline(always)]
    fn consider(&mut self, t: f32, error: f32, rival: f32, index: u32) {
        // Equal distances go to the lower index, so that the order of the tree has no say.
        let wins = t < self.t || (t == self.t && index < self.index);
        // The loser may truly be the nearer one, by as much as its error.
        let loser = if wins { self.t - self.error } else { t - error };
        self.rival = self.rival.min(loser).min(rival);
        self.farthest = self.farthest.min(t + error);
        if wins {
            (self.t, self.error, self.index) = (t, error, index);
        }
    }

    #[inline(always)]
    pub(super) fn consider_all(&mut self, ray: &Prepared, leaf: &Leaf4) {
        let Some(found) = intersect4(ray.origin, &ray.shear, leaf) else { return };
        let mut met = found.met;
        while met != 0 {
            // The remainder changes nothing, and saves the bounds checks.
            let i = met.trailing_zeros() as usize % LEAF;
            met &= met - 1;
            self.consider(found.t[i], found.error[i], found.rival[i], leaf.indices[i]);
        }
    }

    /// The caster's answer: [`MISS`], or the index, with [`AMBIGUOUS`] if f64 must decide, because
    /// the rival may truly be nearer.
    #[must_use]
    pub fn code(&self) -> u32 {
        let is_open = self.index != MISS && self.t + self.error > self.rival;
        if is_open { self.index | AMBIGUOUS } else { self.index }
    }
}

/// Finds the nearest triangle along `ray`.
#[inline(always)]
#[must_use]
pub fn traverse(tree: &WideBvh, stack: &mut Stack<f32>, ray: &TraceRay) -> Nearest {
    let mut nearest = Nearest::NONE;
    Prepared::new(ray).trace(tree, WideChild::ROOT, stack, &mut nearest, Portable);
    nearest
}
