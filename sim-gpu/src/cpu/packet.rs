//! Traces eight coherent rays at once, one in each lane of AVX2 or AVX-512: Wald, Slusallek,
//! Benthin, Wagner, "Interactive rendering with coherent ray tracing", Eurographics 2001.
//!
//! Below a node that few of the rays enter, each ray goes on by itself. Each lane computes to
//! the bit what `traverse` computes for a single ray.

use super::f32x8::{F32x8, Mask8};
use super::frustum::Frustum;
use super::intersect::{DISPLACEMENT, STEEPEST};
use super::traverse::{FAR_SCALE, Instructions, Nearest, PACKET, Prepared};
use crate::bvh::{Entered, LEAF, Leaf4, MAX_DEPTH, Stack, WIDTH, WideBvh, WideChild, WideNode};
use crate::lanes::{Avx2, each};
use crate::ray::{MISS, NO_HIT, TraceRay};

/// A packet of this many live rays or fewer is split into single rays: a box test of the packet
/// costs as much for one live ray as for eight.
const FEW: u32 = 3;

type Lanes = [f32; PACKET];

/// A node or leaf that rays have yet to visit.
#[derive(Clone, Copy)]
struct Pending {
    /// The distance at which each ray enters it; infinity for a ray that does not.
    near: Lanes,
    child: WideChild,
}

/// The traversal stacks of a packet and of a single ray.
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
struct Packet {
    avx2: Avx2,
    rays: [Prepared; PACKET],
    frustum: Frustum,
    /// The axes that the shear of the first ray makes x, y and z.
    axes: [usize; 3],
    /// As [`Prepared`], transposed.
    per_direction: [Lanes; 3],
    offset: [Lanes; 3],
    /// Along `axes`.
    origin: [Lanes; 3],
    /// The shear's x, y and `per_z`.
    shear: [Lanes; 3],
}

/// [`Nearest`] of each ray, transposed.
struct NearestOfRays {
    t: Lanes,
    error: Lanes,
    index: [u32; PACKET],
    farthest: Lanes,
    rival: Lanes,
}

impl Instructions for Avx2 {
    type Stacks = Stacks;

    #[inline(always)]
    fn enter(self, ray: &Prepared, node: &WideNode, farthest: f32) -> Entered<f32> {
        // The sign of the direction says which side of a box is nearer, on each axis.
        let [x, y, z] = ray.per_direction.map(|d| usize::from(d < 0.0));
        let near = distances(ray, node, x, 0).max(distances(ray, node, y, 1));
        let near = near.max(distances(ray, node, z, 2)).max(F32x8::ZERO);
        let far = distances(ray, node, 1 - x, 0).min(distances(ray, node, 1 - y, 1));
        let far = far.min(distances(ray, node, 1 - z, 2)).min(F32x8::splat(farthest));
        (near.cmple(far * F32x8::splat(FAR_SCALE)).bits(), near.into())
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
        each(|lane| nearest.get(lane).code(rays[lane].skipped))
    }
}

/// The distances at which a ray meets one side, low or high, of the boxes of `node`.
#[inline(always)]
fn distances(ray: &Prepared, node: &WideNode, side: usize, axis: usize) -> F32x8 {
    let planes = F32x8::from(node.boxes[side][axis]);
    planes * F32x8::splat(ray.per_direction[axis]) + F32x8::splat(ray.offset[axis])
}

impl Packet {
    #[inline(always)]
    fn new(rays: &[TraceRay; PACKET], frustum: Frustum, avx2: Avx2) -> Self {
        let rays: [Prepared; PACKET] = each(|lane| Prepared::new(&rays[lane]));
        let axes = rays[0].shear.axes;
        Self {
            avx2,
            frustum,
            axes,
            per_direction: each(|axis| each(|lane| rays[lane].per_direction[axis])),
            offset: each(|axis| each(|lane| rays[lane].offset[axis])),
            origin: each(|to| each(|lane| rays[lane].origin[axes[to]])),
            shear: [
                each(|lane| rays[lane].shear.x),
                each(|lane| rays[lane].shear.y),
                each(|lane| rays[lane].shear.per_z),
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
            let live = nearest.live(near.into());
            if live.bits().count_ones() <= few {
                for lane in lanes_of(live.bits()) {
                    let mut of_ray = nearest.get(lane);
                    self.rays[lane].trace(tree, child, single, &mut of_ray, self.avx2);
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
            let (mut near, mut far) = (F32x8::ZERO, F32x8::from(*farthest));
            for axis in 0..3 {
                let [a, b] = [low, high].map(|side| self.distance(axis, side[axis][i]));
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            let entered = near.cmple(far * F32x8::splat(FAR_SCALE));
            if entered.bits() == 0 {
                continue;
            }
            let near: Lanes = entered.select(near, F32x8::splat(f32::INFINITY)).into();
            // The rays run side by side: the first that enters stands for all.
            let begins = near[entered.bits().trailing_zeros() as usize % PACKET];
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
    fn distance(&self, axis: usize, coordinate: f32) -> F32x8 {
        F32x8::splat(coordinate) * self.per_direction[axis].into() + self.offset[axis].into()
    }

    /// Tests the `live` rays against the triangles of `leaf`: each ray against all triangles at
    /// once, or all rays at once against each triangle, whichever takes fewer tests.
    #[inline(always)]
    fn consider_all(&self, leaf: &Leaf4, live: Mask8, nearest: &mut NearestOfRays) {
        if live.bits().count_ones() < leaf.len {
            for lane in lanes_of(live.bits()) {
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
    fn consider(&self, leaf: &Leaf4, i: usize, live: Mask8, nearest: &mut NearestOfRays) {
        let [a, b, c] = &leaf.corners;
        let (a, b, c) = (self.sheared(a, i), self.sheared(b, i), self.sheared(c, i));
        let u = edge(b.x, b.y, c.x, c.y);
        let v = edge(a.x, a.y, c.x, c.y).negated();
        let w = edge(a.x, a.y, b.x, b.y);
        let zero = F32x8::ZERO;
        let negative = u.cmplt(zero) | v.cmplt(zero) | w.cmplt(zero);
        let positive = zero.cmplt(u) | zero.cmplt(v) | zero.cmplt(w);
        let determinant = u + v + w;
        // A NaN, which is not equal to 0, passes here and fails the comparison for `met`.
        let inside = determinant.cmpne(zero).without(negative & positive) & live;
        if inside.bits() == 0 {
            return;
        }
        let per_z = F32x8::from(self.shear[2]);
        let (az, bz, cz) = (a.along * per_z, b.along * per_z, c.along * per_z);
        let t = (u * az + v * bz + w * cz) / determinant;
        let slope_x = edge(b.y - a.y, bz - az, c.y - a.y, cz - az);
        let slope_y = edge(bz - az, b.x - a.x, cz - az, c.x - a.x);
        let slope = (slope_x.abs() + slope_y.abs()) / determinant.abs();
        let error = F32x8::splat(DISPLACEMENT) * (F32x8::splat(1.0) + slope);
        let met = zero.cmple(t + error) & inside;
        let near_edge = within(u, c.x - b.x, c.y - b.y)
            | within(v, c.x - a.x, c.y - a.y)
            | within(w, b.x - a.x, b.y - a.y);
        let neighbour = t - F32x8::splat(2.0) * error - F32x8::splat(DISPLACEMENT * STEEPEST);
        let if_behind = t.cmplt(error).select(t - error, F32x8::splat(NO_HIT));
        let rival = near_edge.select(neighbour, if_behind);
        nearest.consider(met, t, error, rival, leaf.indices[i]);
    }

    #[inline(always)]
    fn sheared(&self, corner: &[[f32; LEAF]; 3], i: usize) -> Sheared {
        let along = self.from_origin(corner, i, 2);
        let x = self.from_origin(corner, i, 0) - along * self.shear[0].into();
        let y = self.from_origin(corner, i, 1) - along * self.shear[1].into();
        Sheared { x, y, along }
    }

    /// A coordinate of a corner relative to the origin of each ray.
    #[inline(always)]
    fn from_origin(&self, corner: &[[f32; LEAF]; 3], i: usize, to: usize) -> F32x8 {
        F32x8::splat(corner[self.axes[to]][i]) - self.origin[to].into()
    }
}

impl NearestOfRays {
    const NONE: Self = Self {
        t: [NO_HIT; PACKET],
        error: [0.0; PACKET],
        index: [MISS; PACKET],
        farthest: [NO_HIT; PACKET],
        rival: [NO_HIT; PACKET],
    };

    #[inline(always)]
    fn get(&self, lane: usize) -> Nearest {
        Nearest {
            t: self.t[lane],
            error: self.error[lane],
            index: self.index[lane],
            farthest: self.farthest[lane],
            rival: self.rival[lane],
        }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, nearest: &Nearest) {
        self.t[lane] = nearest.t;
        self.error[lane] = nearest.error;
        self.index[lane] = nearest.index;
        self.farthest[lane] = nearest.farthest;
        self.rival[lane] = nearest.rival;
    }

    /// The rays for which a box that begins at `near` may hold the nearest surface.
    #[inline(always)]
    fn live(&self, near: F32x8) -> Mask8 {
        near.cmple(F32x8::from(self.farthest) * F32x8::splat(FAR_SCALE))
    }

    /// As `Nearest::consider`, for the rays that `met` triangle `index`.
    #[inline(always)]
    fn consider(&mut self, met: Mask8, t: F32x8, error: F32x8, rival: F32x8, index: u32) {
        let (old_t, old_error) = (F32x8::from(self.t), F32x8::from(self.error));
        // Signed, `MISS` is below every index, but no triangle lies at its distance, `NO_HIT`.
        let is_lower = Mask8::above(self.index, index);
        let wins = t.cmplt(old_t) | (t.cmpeq(old_t) & is_lower);
        let loser = wins.select(old_t - old_error, t - error);
        let old_rival = F32x8::from(self.rival);
        // If the first number is NaN, `min` returns the second: a NaN must not hide a rival.
        let new_rival = rival.min(loser.min(old_rival));
        self.rival = met.select(new_rival, old_rival).into();
        let old_farthest = F32x8::from(self.farthest);
        self.farthest = met.select((t + error).min(old_farthest), old_farthest).into();
        let wins = wins & met;
        self.t = wins.select(t, old_t).into();
        self.error = wins.select(error, old_error).into();
        self.index = wins.select_index(index, self.index);
    }
}

/// A corner in the sheared space of each ray.
#[derive(Clone, Copy)]
struct Sheared {
    x: F32x8,
    y: F32x8,
    /// Along the largest axis, not yet scaled by `per_z`.
    along: F32x8,
}

#[inline(always)]
fn edge(px: F32x8, py: F32x8, qx: F32x8, qy: F32x8) -> F32x8 {
    px * qy - py * qx
}

/// As in `intersect4`.
#[inline(always)]
fn within(edge: F32x8, x: F32x8, y: F32x8) -> Mask8 {
    (edge * edge).cmple(F32x8::splat(DISPLACEMENT * DISPLACEMENT) * (x * x + y * y))
}

/// The numbers of the lanes whose bits are set.
#[inline(always)]
fn lanes_of(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (lane < PACKET).then_some(lane)
    })
}
