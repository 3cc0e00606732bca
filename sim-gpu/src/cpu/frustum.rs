//! Frusta, which bound a few coherent rays: Reshetov, Soupikov, Hurley, "Multi-level ray tracing
//! algorithm", SIGGRAPH 2005.

use super::intersect::axes_by_size;
use crate::bvh::{WIDTH, WideNode};
use crate::ray::TraceRay;

/// Rays whose slopes differ by more than this are not coherent.
const WIDEST: f32 = 0.3;

/// How much wider a frustum is than its rays, unit lengths.
///
/// In units u = 2^-24, with boxes within 1 of the origin, origins within 2 and slopes within
/// 1.3: a slope is off by 3u, a crossing by 13u, their sum at a box by 23u. The triangle test
/// accepts triangles up to 56u from the ray (`intersect::DISPLACEMENT`).
const MARGIN: f32 = 128.0 / 16_777_216.0;

type Interval = [f32; 2];

/// Bounds of rays that share the axis of their largest component, the main axis, and its sign.
#[derive(Clone, Copy, Debug)]
pub struct Frustum {
    /// The other two axes, and the main one.
    axes: [usize; 3],
    /// Whether the rays run towards higher coordinates along the main axis.
    is_forward: bool,
    /// The coordinate on the main axis where the first ray starts.
    start: f32,
    /// On each of the other axes: the rays' coordinates where the main axis is 0, and their
    /// slopes along the main axis.
    crossing: [Interval; 2],
    slope: [Interval; 2],
}

impl Frustum {
    /// The frustum of `rays`; `None` if they are not coherent, or if a number is not finite.
    #[inline(always)]
    pub fn around<const N: usize>(rays: &[TraceRay; N]) -> Option<Self> {
        let axes = axes_by_size(rays[0].direction.map(f32::abs));
        let main = axes[2];
        let is_forward = rays[0].direction[main] > 0.0;
        let along = rays.each_ref().map(|ray| ray.direction[main]);
        let start = rays.each_ref().map(|ray| ray.origin[main]);
        let per_unit = along.map(|d| 1.0 / d);
        let mut is_narrow = along.iter().all(|&d| (d > 0.0) == is_forward);
        let (mut crossing, mut slope) = ([[0.0; 2]; 2], [[0.0; 2]; 2]);
        for (i, axis) in [(0, axes[0]), (1, axes[1])] {
            let slopes: [f32; N] = std::array::from_fn(|n| rays[n].direction[axis] * per_unit[n]);
            let crossings: [f32; N] =
                std::array::from_fn(|n| rays[n].origin[axis] - slopes[n] * start[n]);
            (crossing[i], slope[i]) = (interval(&crossings), interval(&slopes));
            // A comparison with NaN is false.
            is_narrow &= slope[i][1] - slope[i][0] <= WIDEST && slope[i][0].abs() <= 1.0 + WIDEST;
            is_narrow &= crossing[i].iter().all(|c| c.is_finite());
        }
        let [least, most] = interval(&start);
        let start = if is_forward { least } else { most };
        is_narrow.then_some(Self { axes, is_forward, start, crossing, slope })
    }

    /// A bit for each box of `node` that a ray may enter. The compiler vectorizes this plain
    /// loop over all boxes.
    #[inline(always)]
    pub fn may_enter(&self, node: &WideNode) -> u32 {
        let [low, high] = &node.boxes;
        let main = self.axes[2];
        let mut entered = 0;
        for i in 0..WIDTH {
            // The part of the main axis where both the box and the rays are.
            let (from, to) = match self.is_forward {
                true => (low[main][i].max(self.start - MARGIN), high[main][i]),
                false => (low[main][i], high[main][i].min(self.start + MARGIN)),
            };
            let mut may = from <= to;
            for (j, &axis) in self.axes[..2].iter().enumerate() {
                let [least, most] = self.slope[j];
                // Bilinear in slope and coordinate, so the extremes lie at the corners.
                let [a, b, c, d] = [from * least, to * least, from * most, to * most];
                let leftmost = a.min(b).min(c.min(d)) + (self.crossing[j][0] - MARGIN);
                let rightmost = a.max(b).max(c.max(d)) + (self.crossing[j][1] + MARGIN);
                may &= leftmost <= high[axis][i];
                may &= rightmost >= low[axis][i];
            }
            entered |= u32::from(may) << i;
        }
        entered
    }
}

#[inline(always)]
fn interval(values: &[f32]) -> Interval {
    // One instruction each; `f32::min` and `max` would also have to handle NaN.
    let least = |a: f32, &b: &f32| if b < a { b } else { a };
    let most = |a: f32, &b: &f32| if b > a { b } else { a };
    let [first, ..] = values else { return [f32::NAN; 2] };
    [values.iter().fold(*first, least), values.iter().fold(*first, most)]
}
