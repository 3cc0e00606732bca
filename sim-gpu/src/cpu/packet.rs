//! Eight coherent rays at once, with AVX2: a lane for each ray. Wald, Slusallek,
//! Benthin, Wagner, "Interactive rendering with coherent ray tracing",
//! Eurographics 2001.
//!
//! Where few of the rays go the same way, each goes on alone. Each lane does to
//! the bit what `traverse` does for a ray alone.

use super::frustum::Frustum;
use super::intersect::{DISPLACEMENT, STEEPEST};
use super::traverse::{FAR_SCALE, Nearest, Prepared};
use crate::bvh::{Entered, LEAF, Leaf4, MAX_DEPTH, Stack, WIDTH, WideBvh, WideChild, WideNode};
use crate::ray::{MISS, NO_HIT, TraceRay};
use bytemuck::must_cast;
use std::arch::x86_64::*;
use std::array;

/// How many rays are traced at once.
pub const LANES: usize = 8;

/// So many rays, or fewer, go on alone.
const FEW: u32 = 3;

type Lanes = [f32; LANES];

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
    rays: [Prepared; LANES],
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
    index: [u32; LANES],
    farthest: Lanes,
    rival: Lanes,
}

impl Packet {
    /// The packet of `rays`, if all are sheared along the same axis.
    #[inline(always)]
    fn new(rays: &[TraceRay; LANES], frustum: Frustum) -> Option<Self> {
        let rays = rays.each_ref().map(Prepared::new);
        let axes = rays[0].shear.axes;
        let lanes = |of: &dyn Fn(&Prepared) -> f32| array::from_fn(|lane| of(&rays[lane]));
        rays.iter().all(|ray| ray.shear.axes == axes).then(|| Self {
            frustum,
            axes,
            per_direction: array::from_fn(|axis| lanes(&|ray| ray.per_direction[axis])),
            offset: array::from_fn(|axis| lanes(&|ray| ray.offset[axis])),
            origin: axes.map(|axis| lanes(&|ray| ray.origin[axis])),
            shear: [
                lanes(&|ray| ray.shear.x),
                lanes(&|ray| ray.shear.y),
                lanes(&|ray| ray.shear.per_z),
            ],
            rays,
        })
    }
}

impl Found {
    const NONE: Self = Self {
        t: [NO_HIT; LANES],
        error: [0.0; LANES],
        index: [MISS; LANES],
        farthest: [NO_HIT; LANES],
        rival: [NO_HIT; LANES],
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

    /// Traces ray `lane` alone, from node or leaf `from` down.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn trace(
        &mut self,
        lane: usize,
        ray: &Prepared,
        tree: &WideBvh,
        from: WideChild,
        stack: &mut Stack<f32>,
    ) {
        let mut nearest = self.get(lane);
        ray.trace(tree, from, stack, &mut nearest, |ray, node, far| enter(ray, node, far));
        self.set(lane, &nearest);
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, nearest: &Nearest) {
        self.t[lane] = nearest.t;
        self.error[lane] = nearest.error;
        self.index[lane] = nearest.index;
        self.farthest[lane] = nearest.farthest;
        self.rival[lane] = nearest.rival;
    }
}

/// The codes of `rays`, which run side by side within `frustum`.
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
pub fn trace(
    tree: &WideBvh,
    stacks: &mut Stacks,
    rays: &[TraceRay; LANES],
    frustum: Frustum,
) -> [u32; LANES] {
    let mut found = Found::NONE;
    match Packet::new(rays, frustum) {
        Some(packet) => packet.trace(tree, stacks, &mut found),
        None => {
            for (lane, ray) in rays.iter().enumerate() {
                found.trace(lane, &Prepared::new(ray), tree, WideChild::ROOT, &mut stacks.alone);
            }
        }
    }
    array::from_fn(|lane| found.get(lane).code(rays[lane].skipped))
}

/// As `traverse::enter`.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
pub fn enter(ray: &Prepared, node: &WideNode, farthest: f32) -> Entered<f32> {
    let [x, y, z] = ray.per_direction.map(|d| usize::from(d < 0.0));
    let reach = |side: usize, axis: usize| {
        let product = _mm256_mul_ps(
            must_cast(node.boxes[side][axis]),
            _mm256_set1_ps(ray.per_direction[axis]),
        );
        _mm256_add_ps(product, _mm256_set1_ps(ray.offset[axis]))
    };
    let near = _mm256_max_ps(reach(x, 0), reach(y, 1));
    let near = _mm256_max_ps(near, reach(z, 2));
    let near = _mm256_max_ps(near, _mm256_setzero_ps());
    let far = _mm256_min_ps(reach(1 - x, 0), reach(1 - y, 1));
    let far = _mm256_min_ps(far, reach(1 - z, 2));
    let far = _mm256_min_ps(far, _mm256_set1_ps(farthest));
    let far = _mm256_mul_ps(far, _mm256_set1_ps(FAR_SCALE));
    (bits(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)), must_cast(near))
}

impl Packet {
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn trace(&self, tree: &WideBvh, stacks: &mut Stacks, found: &mut Found) {
        let Stacks { waiting, alone } = stacks;
        let mut at = Some(Waiting { near: [0.0; LANES], child: WideChild::ROOT });
        while let Some(Waiting { near, child }) = at.take().or_else(|| waiting.pop()) {
            let live = self.live(&near, found);
            if bits(live).count_ones() <= FEW {
                for lane in lanes_of(bits(live)) {
                    found.trace(lane, &self.rays[lane], tree, child, alone);
                }
            } else if let Some(leaf) = child.leaf() {
                self.consider_all(&tree.leaves[leaf], live, found);
            } else {
                at = self.enter(&tree.nodes[child.node()], found, waiting);
            }
        }
    }

    /// The rays for which what begins at `near` still matters.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn live(&self, near: &Lanes, found: &Found) -> __m256 {
        let far = _mm256_mul_ps(must_cast(found.farthest), _mm256_set1_ps(FAR_SCALE));
        _mm256_cmp_ps::<_CMP_LE_OQ>(must_cast(*near), far)
    }

    /// Tests the boxes of `node`: the nearest child to go on with, while the
    /// others that any ray enters wait, farther ones below nearer ones.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn enter(&self, node: &WideNode, found: &Found, waiting: &mut Vec<Waiting>) -> Option<Waiting> {
        let [low, high] = &node.boxes;
        let base = waiting.len();
        let mut nearest = (f32::INFINITY, base);
        for i in lanes_of(self.frustum.may_enter(node)) {
            let (mut near, mut far) = (_mm256_setzero_ps(), must_cast(found.farthest));
            for axis in 0..3 {
                let (a, b) = (self.reach(axis, low[axis][i]), self.reach(axis, high[axis][i]));
                near = _mm256_max_ps(near, _mm256_min_ps(a, b));
                far = _mm256_min_ps(far, _mm256_max_ps(a, b));
            }
            let far = _mm256_mul_ps(far, _mm256_set1_ps(FAR_SCALE));
            let entered = _mm256_cmp_ps::<_CMP_LE_OQ>(near, far);
            let live = bits(entered);
            if live == 0 {
                continue;
            }
            let never = _mm256_set1_ps(f32::INFINITY);
            let near: Lanes = must_cast(_mm256_blendv_ps(never, near, entered));
            let begins = near[live.trailing_zeros() as usize % LANES];
            if begins < nearest.0 {
                nearest = (begins, waiting.len());
            }
            waiting.push(Waiting { near, child: node.children[i] });
        }
        (waiting.len() > base).then(|| waiting.swap_remove(nearest.1))
    }

    /// Where the rays meet the plane at `coordinate` of `axis`.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn reach(&self, axis: usize, coordinate: f32) -> __m256 {
        let product =
            _mm256_mul_ps(_mm256_set1_ps(coordinate), must_cast(self.per_direction[axis]));
        _mm256_add_ps(product, must_cast(self.offset[axis]))
    }

    /// Considers the triangles of `leaf` for the rays that are `live`: all triangles
    /// with one ray at once, or all rays with one triangle, whichever is less.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn consider_all(&self, leaf: &Leaf4, live: __m256, found: &mut Found) {
        if bits(live).count_ones() < leaf.len {
            for lane in lanes_of(bits(live)) {
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
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn consider(&self, leaf: &Leaf4, i: usize, live: __m256, found: &mut Found) {
        let [a, b, c] = &leaf.corners;
        let (a, b, c) = (self.sheared(a, i), self.sheared(b, i), self.sheared(c, i));
        let u = edge(b.x, b.y, c.x, c.y);
        let v = negated(edge(a.x, a.y, c.x, c.y));
        let w = edge(a.x, a.y, b.x, b.y);
        let zero = _mm256_setzero_ps();
        let below = |v| _mm256_cmp_ps::<_CMP_LT_OQ>(v, zero);
        let above = |v| _mm256_cmp_ps::<_CMP_GT_OQ>(v, zero);
        let negative = _mm256_or_ps(_mm256_or_ps(below(u), below(v)), below(w));
        let positive = _mm256_or_ps(_mm256_or_ps(above(u), above(v)), above(w));
        let determinant = _mm256_add_ps(_mm256_add_ps(u, v), w);
        let some = _mm256_cmp_ps::<_CMP_NEQ_UQ>(determinant, zero);
        let outside = _mm256_and_ps(negative, positive);
        let inside = _mm256_and_ps(_mm256_andnot_ps(outside, some), live);
        if bits(inside) == 0 {
            return;
        }
        let (az, bz, cz) = (self.depth(a.along), self.depth(b.along), self.depth(c.along));
        let weighted = _mm256_add_ps(_mm256_mul_ps(u, az), _mm256_mul_ps(v, bz));
        let t = _mm256_div_ps(_mm256_add_ps(weighted, _mm256_mul_ps(w, cz)), determinant);
        let less = |p, q| _mm256_sub_ps(p, q);
        let slope_x = edge(less(b.y, a.y), less(bz, az), less(c.y, a.y), less(cz, az));
        let slope_y = edge(less(bz, az), less(b.x, a.x), less(cz, az), less(c.x, a.x));
        let slope = _mm256_add_ps(absolute(slope_x), absolute(slope_y));
        let slope = _mm256_div_ps(slope, absolute(determinant));
        let displacement = _mm256_set1_ps(DISPLACEMENT);
        let error = _mm256_mul_ps(displacement, _mm256_add_ps(_mm256_set1_ps(1.0), slope));
        let met = _mm256_cmp_ps::<_CMP_GE_OQ>(_mm256_add_ps(t, error), zero);
        let met = _mm256_and_ps(met, inside);
        let near_edge = _mm256_or_ps(
            _mm256_or_ps(
                within(u, less(c.x, b.x), less(c.y, b.y)),
                within(v, less(c.x, a.x), less(c.y, a.y)),
            ),
            within(w, less(b.x, a.x), less(b.y, a.y)),
        );
        let twice = _mm256_mul_ps(_mm256_set1_ps(2.0), error);
        let beside = less(less(t, twice), _mm256_set1_ps(DISPLACEMENT * STEEPEST));
        let is_behind = _mm256_cmp_ps::<_CMP_LT_OQ>(t, error);
        let behind = _mm256_blendv_ps(_mm256_set1_ps(NO_HIT), less(t, error), is_behind);
        let rival = _mm256_blendv_ps(behind, beside, near_edge);
        found.consider(met, t, error, rival, leaf.indices[i]);
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn sheared(&self, corner: &[[f32; LEAF]; 3], i: usize) -> Sheared {
        let from = |to: usize| {
            let coordinate = _mm256_set1_ps(corner[self.axes[to]][i]);
            _mm256_sub_ps(coordinate, must_cast(self.origin[to]))
        };
        let along = from(2);
        let less = |p, shear: Lanes| _mm256_sub_ps(p, _mm256_mul_ps(along, must_cast(shear)));
        Sheared { x: less(from(0), self.shear[0]), y: less(from(1), self.shear[1]), along }
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn depth(&self, along: __m256) -> __m256 {
        _mm256_mul_ps(along, must_cast(self.shear[2]))
    }
}

impl Found {
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn consider(&mut self, met: __m256, t: __m256, error: __m256, rival: __m256, index: u32) {
        let (old_t, old_error): (__m256, __m256) = (must_cast(self.t), must_cast(self.error));
        let indices: __m256i = must_cast(self.index);
        let index = _mm256_set1_epi32(index as i32);
        // Indices are below 2^31; `MISS`, of a distance that nothing else has, is -1.
        let lower = _mm256_castsi256_ps(_mm256_cmpgt_epi32(indices, index));
        let same = _mm256_cmp_ps::<_CMP_EQ_OQ>(t, old_t);
        let nearer = _mm256_cmp_ps::<_CMP_LT_OQ>(t, old_t);
        let wins = _mm256_or_ps(nearer, _mm256_and_ps(same, lower));
        let loser =
            _mm256_blendv_ps(_mm256_sub_ps(t, error), _mm256_sub_ps(old_t, old_error), wins);
        // Of two numbers of which the first is none, these choose the second.
        let least = |new, old: Lanes| {
            let old = must_cast(old);
            must_cast(_mm256_blendv_ps(old, _mm256_min_ps(new, old), met))
        };
        self.rival = least(loser, self.rival);
        self.rival = least(rival, self.rival);
        self.farthest = least(_mm256_add_ps(t, error), self.farthest);
        let wins = _mm256_and_ps(wins, met);
        self.t = must_cast(_mm256_blendv_ps(old_t, t, wins));
        self.error = must_cast(_mm256_blendv_ps(old_error, error, wins));
        let indices =
            _mm256_blendv_ps(_mm256_castsi256_ps(indices), _mm256_castsi256_ps(index), wins);
        self.index = must_cast(_mm256_castps_si256(indices));
    }
}

/// A corner as the sheared rays see it, before its distance is asked for.
struct Sheared {
    x: __m256,
    y: __m256,
    along: __m256,
}

#[inline]
#[target_feature(enable = "avx2")]
fn edge(px: __m256, py: __m256, qx: __m256, qy: __m256) -> __m256 {
    _mm256_sub_ps(_mm256_mul_ps(px, qy), _mm256_mul_ps(py, qx))
}

/// As in `intersect4`.
#[inline]
#[target_feature(enable = "avx2")]
fn within(edge: __m256, x: __m256, y: __m256) -> __m256 {
    let squared = _mm256_add_ps(_mm256_mul_ps(x, x), _mm256_mul_ps(y, y));
    let reach = _mm256_mul_ps(_mm256_set1_ps(DISPLACEMENT * DISPLACEMENT), squared);
    _mm256_cmp_ps::<_CMP_LE_OQ>(_mm256_mul_ps(edge, edge), reach)
}

#[inline]
#[target_feature(enable = "avx2")]
fn negated(v: __m256) -> __m256 {
    _mm256_xor_ps(v, _mm256_set1_ps(-0.0))
}

#[inline]
#[target_feature(enable = "avx2")]
fn absolute(v: __m256) -> __m256 {
    _mm256_andnot_ps(_mm256_set1_ps(-0.0), v)
}

#[inline]
#[target_feature(enable = "avx2")]
fn bits(mask: __m256) -> u32 {
    _mm256_movemask_ps(mask) as u32
}

/// The numbers of the lanes whose bits are set.
#[inline(always)]
fn lanes_of(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (lane < LANES).then_some(lane)
    })
}
