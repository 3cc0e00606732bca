//! Traces eight coherent rays at once, one in each lane of AVX2 or AVX-512: Wald, Slusallek,
//! Benthin, Wagner, "Interactive rendering with coherent ray tracing", Eurographics 2001.
//!
//! Below a node that few of the rays enter, each ray goes on by itself. Each lane equals the result
//! of `traverse` for a single ray to the bit.

use super::frustum::Frustum;
use super::intersect::{DISPLACEMENT, EDGE_ROUNDING};
use super::traverse::{FAR_SCALE, Instructions, Nearest, PACKET, Prepared};
use crate::bvh::{Entered, LEAF, Leaf4, MAX_DEPTH, Stack, WIDTH, WideBvh, WideChild, WideNode};
use crate::lanes::each;
use crate::ray::{MISS, NO_HIT, TraceRay};
use fearless_simd::{Simd, f32x8, i32x8, mask32x8, prelude::*};

/// A packet of this many live rays or fewer is split into single rays: a box test of the packet
/// costs as much for one live ray as for eight.
const FEW: u32 = 3;

type Lanes = [f32; PACKET];

#[derive(Clone, Copy)]
struct Pending {
    /// The distance at which each ray enters it; infinity for a ray that does not.
    near: Lanes,
    child: WideChild,
}

pub struct Stacks {
    packet: Vec<Pending>,
    single: Stack<f32>,
}

impl Default for Stacks {
    fn default() -> Self {
        let packet = Vec::with_capacity((WIDTH - 1) * MAX_DEPTH);
        Self { packet, single: Stack::default() }
    }
}

/// Eight rays, one in each lane.
struct Packet<S: Simd> {
    by: Packets<S>,
    rays: [Prepared; PACKET],
    frustum: Frustum,
    /// The axes that the shear of the first ray makes x, y and z.
    axes: [usize; 3],
    /// As [`Prepared`], transposed.
    per_direction: [f32x8<S>; 3],
    offset: [f32x8<S>; 3],
    /// Along `axes`.
    origin: [f32x8<S>; 3],
    /// The shear's x, y and `per_z`.
    shear: [f32x8<S>; 3],
}

/// [`Nearest`] of each ray, transposed.
struct NearestOfRays {
    t: Lanes,
    error: Lanes,
    /// Signed, as vectors compare indices.
    index: [i32; PACKET],
    farthest: Lanes,
    rival: Lanes,
}

/// Instructions with registers of eight lanes: traces coherent rays in packets.
#[derive(Clone, Copy)]
pub(super) struct Packets<S>(pub S);

impl<S: Simd> Instructions for Packets<S> {
    type Stacks = Stacks;

    #[inline(always)]
    fn enter(self, ray: &Prepared, node: &WideNode, farthest: f32) -> Entered<f32> {
        // The sign of the direction says which side of a box is nearer, on each axis.
        let [x, y, z] = ray.per_direction.map(|d| usize::from(d < 0.0));
        let near = self.distances(ray, node, x, 0).max(self.distances(ray, node, y, 1));
        let near = near.max(self.distances(ray, node, z, 2)).max(0.0);
        let far = self.distances(ray, node, 1 - x, 0).min(self.distances(ray, node, 1 - y, 1));
        let far = far.min(self.distances(ray, node, 1 - z, 2)).min(farthest);
        (near.simd_le(far * FAR_SCALE).to_bitmask() as u32, *near)
    }

    #[inline(always)]
    fn trace(
        self,
        tree: &WideBvh,
        stacks: &mut Stacks,
        rays: &[TraceRay; PACKET],
        frustum: Frustum,
    ) -> [u32; PACKET] {
        let mut nearest = NearestOfRays::NONE;
        Packet::new(rays, frustum, self).trace(tree, stacks, &mut nearest);
        each(|lane| nearest.get(lane).code())
    }
}

impl<S: Simd> Packets<S> {
    /// The distances at which a ray meets one side, low or high, of the boxes of `node`.
    #[inline(always)]
    fn distances(self, ray: &Prepared, node: &WideNode, side: usize, axis: usize) -> f32x8<S> {
        self.lanes(node.boxes[side][axis]) * ray.per_direction[axis] + ray.offset[axis]
    }

    #[inline(always)]
    fn lanes(self, numbers: Lanes) -> f32x8<S> {
        f32x8::simd_from(self.0, numbers)
    }

    #[inline(always)]
    fn splat(self, number: f32) -> f32x8<S> {
        f32x8::splat(self.0, number)
    }
}

impl<S: Simd> Packet<S> {
    #[inline(always)]
    fn new(rays: &[TraceRay; PACKET], frustum: Frustum, by: Packets<S>) -> Self {
        let rays: [Prepared; PACKET] = each(|lane| Prepared::new(&rays[lane]));
        let axes = rays[0].shear.axes;
        Self {
            by,
            frustum,
            axes,
            per_direction: [0, 1, 2].map(|i| by.lanes(each(|lane| rays[lane].per_direction[i]))),
            offset: [0, 1, 2].map(|axis| by.lanes(each(|lane| rays[lane].offset[axis]))),
            origin: axes.map(|axis| by.lanes(each(|lane| rays[lane].origin[axis]))),
            shear: [
                by.lanes(each(|lane| rays[lane].shear.x)),
                by.lanes(each(|lane| rays[lane].shear.y)),
                by.lanes(each(|lane| rays[lane].shear.per_z)),
            ],
            rays,
        }
    }

    /// Traces the rays, together while more than [`FEW`] of them enter the same nodes.
    #[inline(always)]
    fn trace(&self, tree: &WideBvh, stacks: &mut Stacks, nearest: &mut NearestOfRays) {
        // The triangle test permutes axes for all lanes alike, so rays whose largest components
        // differ are traced one by one.
        let is_of_one_axis = (0..PACKET).all(|lane| self.rays[lane].shear.axes == self.axes);
        let few = if is_of_one_axis { FEW } else { PACKET as u32 };
        let Stacks { packet, single } = stacks;
        let mut next = Some(Pending { near: [0.0; PACKET], child: WideChild::ROOT });
        while let Some(Pending { near, child }) = next.take().or_else(|| packet.pop()) {
            // Surfaces found since the child was pushed may hide it from some of the rays.
            let live = nearest.live(self.by.lanes(near));
            if live.to_bitmask().count_ones() <= few {
                for lane in lanes_of(live.to_bitmask() as u32) {
                    let mut of_ray = nearest.get(lane);
                    self.rays[lane].trace(tree, child, single, &mut of_ray, self.by);
                    nearest.set(lane, &of_ray);
                }
            } else if let Some(leaf) = child.leaf() {
                self.consider_all(&tree.leaves[leaf], live, nearest);
            } else {
                next = self.enter(&tree.nodes[child.node()], &nearest.farthest, packet);
            }
        }
    }

    /// Pushes the children of `node` that any ray enters before `farthest`, and pops the one that
    /// begins nearest.
    #[inline(always)]
    fn enter(
        &self,
        node: &WideNode,
        farthest: &Lanes,
        stack: &mut Vec<Pending>,
    ) -> Option<Pending> {
        let [low, high] = &node.boxes;
        let base = stack.len();
        let mut nearest = (f32::INFINITY, base);
        // The frustum is tested against all eight boxes at once, and leaves few for the rays.
        for i in lanes_of(self.frustum.may_enter(node)) {
            let (mut near, mut far) = (self.by.splat(0.0), self.by.lanes(*farthest));
            for axis in 0..3 {
                let [a, b] = [low, high].map(|side| self.distance(axis, side[axis][i]));
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            let entered = near.simd_le(far * FAR_SCALE);
            let bits = entered.to_bitmask() as u32;
            if bits == 0 {
                continue;
            }
            let near: Lanes = *entered.select(near, self.by.splat(f32::INFINITY));
            // The rays run side by side: the first that enters stands for all.
            let begins = near[bits.trailing_zeros() as usize % PACKET];
            if begins < nearest.0 {
                nearest = (begins, stack.len());
            }
            stack.push(Pending { near, child: node.children[i] });
        }
        // The others need no order: each is tested against the nearest surfaces when popped.
        (stack.len() > base).then(|| stack.swap_remove(nearest.1))
    }

    /// The distance at which each ray meets the plane at `coordinate` of `axis`.
    #[inline(always)]
    fn distance(&self, axis: usize, coordinate: f32) -> f32x8<S> {
        self.per_direction[axis] * coordinate + self.offset[axis]
    }

    /// Tests the `live` rays against the triangles of `leaf`: each ray against all triangles at
    /// once, or all rays at once against each triangle, whichever takes fewer tests.
    #[inline(always)]
    fn consider_all(&self, leaf: &Leaf4, live: mask32x8<S>, nearest: &mut NearestOfRays) {
        if live.to_bitmask().count_ones() < leaf.len {
            for lane in lanes_of(live.to_bitmask() as u32) {
                let mut of_ray = nearest.get(lane);
                of_ray.consider_all(&self.rays[lane], leaf);
                nearest.set(lane, &of_ray);
            }
        } else {
            for i in 0..leaf.len as usize {
                // The remainder changes nothing, and saves the bounds checks.
                self.consider(leaf, i % LEAF, live, nearest);
            }
        }
    }

    /// Tests the `live` rays against triangle `i` of `leaf`, as `intersect4` does.
    #[inline(always)]
    fn consider(&self, leaf: &Leaf4, i: usize, live: mask32x8<S>, nearest: &mut NearestOfRays) {
        let [a, b, c] = &leaf.corners;
        let (a, b, c) = (self.sheared(a, i), self.sheared(b, i), self.sheared(c, i));
        // The edge functions of `intersect4`, in the same order of operations.
        let u = edge(b.x, b.y, c.x, c.y);
        let v = -edge(a.x, a.y, c.x, c.y);
        let w = edge(a.x, a.y, b.x, b.y);
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let margin = leaf.longest[i] * (2.0 * DISPLACEMENT);
        let apart = least.simd_lt(-margin) & most.simd_gt(margin);
        let live = live & !apart;
        if live.to_bitmask() == 0 {
            return;
        }
        let near = [
            within(u, c.x - b.x, c.y - b.y),
            within(v, c.x - a.x, c.y - a.y),
            within(w, b.x - a.x, b.y - a.y),
        ];
        let near_edge = near[0] | near[1] | near[2];
        let zero = self.by.splat(0.0);
        let left = (u.simd_lt(zero) & !near[0])
            | (v.simd_lt(zero) & !near[1])
            | (w.simd_lt(zero) & !near[2]);
        let right = (u.simd_gt(zero) & !near[0])
            | (v.simd_gt(zero) & !near[1])
            | (w.simd_gt(zero) & !near[2]);
        let per_z = self.shear[2];
        let (az, bz, cz) = (a.along * per_z, b.along * per_z, c.along * per_z);
        let determinant = u + v + w;
        let t = (u * az + v * bz + w * cz) / determinant;
        let slope_x = edge(b.y - a.y, bz - az, c.y - a.y, cz - az);
        let slope_y = edge(bz - az, b.x - a.x, cz - az, c.x - a.x);
        let slope = (slope_x.abs() + slope_y.abs()) / determinant.abs();
        let (first, last) = (az.min(bz).min(cz), az.max(bz).max(cz));
        let longest = leaf.longest[i];
        let rounding = (last - first) * (EDGE_ROUNDING * longest * longest) / determinant.abs();
        let error = (slope + 1.0) * DISPLACEMENT + rounding;
        let edge_on = determinant.simd_eq(zero);
        let t = edge_on.select(first, t);
        let error = edge_on.select((last - first) + DISPLACEMENT, error);
        let is_open = near_edge | t.simd_lt(error);
        let rival = is_open.select(t - error, self.by.splat(NO_HIT));
        let met = zero.simd_le(t + error) & !(left & right) & live;
        nearest.consider(met, [t, error, rival], leaf.indices[i]);
    }

    #[inline(always)]
    fn sheared(&self, corner: &[[f32; LEAF]; 3], i: usize) -> Sheared<S> {
        let along = self.corner_from_origin(corner, i, 2);
        let x = self.corner_from_origin(corner, i, 0) - along * self.shear[0];
        let y = self.corner_from_origin(corner, i, 1) - along * self.shear[1];
        Sheared { x, y, along }
    }

    #[inline(always)]
    fn corner_from_origin(&self, corner: &[[f32; LEAF]; 3], i: usize, to: usize) -> f32x8<S> {
        self.by.splat(corner[self.axes[to]][i]) - self.origin[to]
    }
}

impl NearestOfRays {
    const NONE: Self = Self {
        t: [NO_HIT; PACKET],
        error: [0.0; PACKET],
        index: [MISS as i32; PACKET],
        farthest: [NO_HIT; PACKET],
        rival: [NO_HIT; PACKET],
    };

    #[inline(always)]
    fn get(&self, lane: usize) -> Nearest {
        Nearest {
            t: self.t[lane],
            error: self.error[lane],
            index: self.index[lane] as u32,
            farthest: self.farthest[lane],
            rival: self.rival[lane],
        }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, nearest: &Nearest) {
        self.t[lane] = nearest.t;
        self.error[lane] = nearest.error;
        self.index[lane] = nearest.index as i32;
        self.farthest[lane] = nearest.farthest;
        self.rival[lane] = nearest.rival;
    }

    /// The rays for which a box that begins at `near` may hold the nearest surface.
    #[inline(always)]
    fn live<S: Simd>(&self, near: f32x8<S>) -> mask32x8<S> {
        near.simd_le(f32x8::simd_from(near.token(), self.farthest) * FAR_SCALE)
    }

    /// As `Nearest::consider`, for the rays that `met` triangle `index`.
    #[inline(always)]
    fn consider<S: Simd>(
        &mut self,
        met: mask32x8<S>,
        [t, error, rival]: [f32x8<S>; 3],
        index: u32,
    ) {
        let simd = t.token();
        let [old_t, old_error, old_rival, old_farthest] =
            [self.t, self.error, self.rival, self.farthest].map(|old| f32x8::simd_from(simd, old));
        let (index, old_index) =
            (i32x8::splat(simd, index as i32), i32x8::simd_from(simd, self.index));
        // Signed, `MISS` is below every index, but no triangle lies at its distance, `NO_HIT`.
        let is_lower = old_index.simd_gt(index);
        let wins = t.simd_lt(old_t) | (t.simd_eq(old_t) & is_lower);
        let loser = wins.select(old_t - old_error, t - error);
        // Of two infinite numbers the differences are NaN, which must not hide a rival.
        let new_rival = rival.min_precise(loser.min_precise(old_rival));
        self.rival = *met.select(new_rival, old_rival);
        self.farthest = *met.select((t + error).min(old_farthest), old_farthest);
        let wins = wins & met;
        self.t = *wins.select(t, old_t);
        self.error = *wins.select(error, old_error);
        self.index = *wins.select(index, old_index);
    }
}

/// A corner in the sheared space of each ray.
#[derive(Clone, Copy)]
struct Sheared<S: Simd> {
    x: f32x8<S>,
    y: f32x8<S>,
    /// Along the largest axis, not yet scaled by `per_z`.
    along: f32x8<S>,
}

#[inline(always)]
fn edge<S: Simd>(px: f32x8<S>, py: f32x8<S>, qx: f32x8<S>, qy: f32x8<S>) -> f32x8<S> {
    px * qy - py * qx
}

/// As in `intersect4`.
#[inline(always)]
fn within<S: Simd>(edge: f32x8<S>, x: f32x8<S>, y: f32x8<S>) -> mask32x8<S> {
    (edge * edge).simd_le((x * x + y * y) * (DISPLACEMENT * DISPLACEMENT))
}

#[inline(always)]
fn lanes_of(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (lane < PACKET).then_some(lane)
    })
}
