//! Eight coherent rays at once, with AVX2 or AVX-512: a lane for each ray. Wald, Slusallek,
//! Benthin, Wagner, "Interactive rendering with coherent ray tracing",
//! Eurographics 2001.
//!
//! Where few of the rays go the same way, each goes on alone. Each lane does to
//! the bit what `traverse` does for a ray alone.

use super::f32x8::{F32x8, Mask8};
use super::frustum::Frustum;
use super::intersect::{DISPLACEMENT, STEEPEST};
use super::traverse::{FAR_SCALE, Instructions, Nearest, PACKET, Prepared};
use crate::bvh::{Entered, LEAF, Leaf4, MAX_DEPTH, Stack, WIDTH, WideBvh, WideChild, WideNode};
use crate::lanes::{Avx2, each};
use crate::ray::{MISS, NO_HIT, TraceRay};

/// So many rays, or fewer, go on alone.
const FEW: u32 = 3;

type Lanes = [f32; PACKET];

/// A node or leaf that rays have still to visit.
#[derive(Clone, Copy)]
struct Waiting {
    /// Where each ray enters it; infinity for a ray that does not.
    near: Lanes,
    child: WideChild,
}

/// What packets have still to visit, and what a ray alone has.
pub struct Stacks {
    waiting: Vec<Waiting>,
    alone: Stack<f32>,
}

impl Default for Stacks {
    fn default() -> Self {
        let waiting = Vec::with_capacity((WIDTH - 1) * MAX_DEPTH);
        Self { waiting, alone: Stack::default() }
    }
}

/// Eight rays side by side.
struct Packet {
    avx2: Avx2,
    rays: [Prepared; PACKET],
    frustum: Frustum,
    /// The axes that the shear makes x, y and z.
    axes: [usize; 3],
    per_direction: [Lanes; 3],
    offset: [Lanes; 3],
    /// Along `axes`.
    origin: [Lanes; 3],
    shear: [Lanes; 3],
}

/// What is known of each ray's nearest surface.
struct Found {
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
        let [x, y, z] = ray.per_direction.map(|d| usize::from(d < 0.0));
        let near = reach(ray, node, x, 0).max(reach(ray, node, y, 1));
        let near = near.max(reach(ray, node, z, 2)).max(F32x8::ZERO);
        let far = reach(ray, node, 1 - x, 0).min(reach(ray, node, 1 - y, 1));
        let far = far.min(reach(ray, node, 1 - z, 2)).min(F32x8::splat(farthest));
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
        let mut found = Found::NONE;
        Packet::new(rays, frustum, self).trace(tree, stacks, &mut found);
        each(|lane| found.get(lane).code(rays[lane].skipped))
    }
}

/// Where the ray meets the planes of `side` of the boxes of `node`.
#[inline(always)]
fn reach(ray: &Prepared, node: &WideNode, side: usize, axis: usize) -> F32x8 {
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

    /// Traces the rays, together where more than a few of them go the same way.
    #[inline(always)]
    fn trace(&self, tree: &WideBvh, stacks: &mut Stacks, found: &mut Found) {
        let is_of_one_axis = (0..PACKET).all(|lane| self.rays[lane].shear.axes == self.axes);
        let few = if is_of_one_axis { FEW } else { PACKET as u32 };
        let Stacks { waiting, alone } = stacks;
        let mut at = Some(Waiting { near: [0.0; PACKET], child: WideChild::ROOT });
        while let Some(Waiting { near, child }) = at.take().or_else(|| waiting.pop()) {
            let live = found.live(near.into());
            if live.bits().count_ones() <= few {
                for lane in lanes_of(live.bits()) {
                    let mut nearest = found.get(lane);
                    self.rays[lane].trace(tree, child, alone, &mut nearest, self.avx2);
                    found.set(lane, &nearest);
                }
            } else if let Some(leaf) = child.leaf() {
                self.consider_all(&tree.leaves[leaf], live, found);
            } else {
                at = self.enter(&tree.nodes[child.node()], found, waiting);
            }
        }
    }

    /// Tests the boxes of `node`: the nearest child to go on with, while the
    /// others that any ray enters wait, farther ones below nearer ones.
    #[inline(always)]
    fn enter(&self, node: &WideNode, found: &Found, waiting: &mut Vec<Waiting>) -> Option<Waiting> {
        let [low, high] = &node.boxes;
        let base = waiting.len();
        let mut nearest = (f32::INFINITY, base);
        for i in lanes_of(self.frustum.may_enter(node)) {
            let (mut near, mut far) = (F32x8::ZERO, F32x8::from(found.farthest));
            for axis in 0..3 {
                let (a, b) = (self.reach(axis, low[axis][i]), self.reach(axis, high[axis][i]));
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            let entered = near.cmple(far * F32x8::splat(FAR_SCALE));
            if entered.bits() == 0 {
                continue;
            }
            let near: Lanes = entered.select(near, F32x8::splat(f32::INFINITY)).into();
            let begins = near[entered.bits().trailing_zeros() as usize % PACKET];
            if begins < nearest.0 {
                nearest = (begins, waiting.len());
            }
            waiting.push(Waiting { near, child: node.children[i] });
        }
        (waiting.len() > base).then(|| waiting.swap_remove(nearest.1))
    }

    /// Where the rays meet the plane at `coordinate` of `axis`.
    #[inline(always)]
    fn reach(&self, axis: usize, coordinate: f32) -> F32x8 {
        F32x8::splat(coordinate) * self.per_direction[axis].into() + self.offset[axis].into()
    }

    /// Considers the triangles of `leaf` for the rays that are `live`: all triangles
    /// with one ray at once, or all rays with one triangle, whichever is less.
    #[inline(always)]
    fn consider_all(&self, leaf: &Leaf4, live: Mask8, found: &mut Found) {
        if live.bits().count_ones() < leaf.len {
            for lane in lanes_of(live.bits()) {
                let mut nearest = found.get(lane);
                nearest.consider_all(&self.rays[lane], leaf);
                found.set(lane, &nearest);
            }
        } else {
            for i in 0..leaf.len as usize {
                self.consider(leaf, i % LEAF, live, found);
            }
        }
    }

    /// As `Nearest::consider` for what `intersect4` says of triangle `i` of `leaf`.
    #[inline(always)]
    fn consider(&self, leaf: &Leaf4, i: usize, live: Mask8, found: &mut Found) {
        let [a, b, c] = &leaf.corners;
        let (a, b, c) = (self.sheared(a, i), self.sheared(b, i), self.sheared(c, i));
        let u = edge(b.x, b.y, c.x, c.y);
        let v = edge(a.x, a.y, c.x, c.y).negated();
        let w = edge(a.x, a.y, b.x, b.y);
        let zero = F32x8::ZERO;
        let negative = u.cmplt(zero) | v.cmplt(zero) | w.cmplt(zero);
        let positive = zero.cmplt(u) | zero.cmplt(v) | zero.cmplt(w);
        let determinant = u + v + w;
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
        let beside = t - F32x8::splat(2.0) * error - F32x8::splat(DISPLACEMENT * STEEPEST);
        let behind = t.cmplt(error).select(t - error, F32x8::splat(NO_HIT));
        let rival = near_edge.select(beside, behind);
        found.consider(met, t, error, rival, leaf.indices[i]);
    }

    #[inline(always)]
    fn sheared(&self, corner: &[[f32; LEAF]; 3], i: usize) -> Sheared {
        let along = self.beside_origin(corner, i, 2);
        let x = self.beside_origin(corner, i, 0) - along * self.shear[0].into();
        let y = self.beside_origin(corner, i, 1) - along * self.shear[1].into();
        Sheared { x, y, along }
    }

    #[inline(always)]
    fn beside_origin(&self, corner: &[[f32; LEAF]; 3], i: usize, to: usize) -> F32x8 {
        F32x8::splat(corner[self.axes[to]][i]) - self.origin[to].into()
    }
}

impl Found {
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

    /// The rays for which what begins at `near` still matters.
    #[inline(always)]
    fn live(&self, near: F32x8) -> Mask8 {
        near.cmple(F32x8::from(self.farthest) * F32x8::splat(FAR_SCALE))
    }

    /// As `Nearest::consider`, of the rays that have `met` triangle `index`.
    #[inline(always)]
    fn consider(&mut self, met: Mask8, t: F32x8, error: F32x8, rival: F32x8, index: u32) {
        let (old_t, old_error) = (F32x8::from(self.t), F32x8::from(self.error));
        // `MISS` is at a distance that nothing else has.
        let is_lower = Mask8::above(self.index, index);
        let wins = t.cmplt(old_t) | (t.cmpeq(old_t) & is_lower);
        let loser = wins.select(old_t - old_error, t - error);
        let old_rival = F32x8::from(self.rival);
        // Of two numbers of which the first is none, `min` is the second.
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

/// A corner as the sheared rays see it, before its distance is asked for.
#[derive(Clone, Copy)]
struct Sheared {
    x: F32x8,
    y: F32x8,
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
