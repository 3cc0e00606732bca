//! What bounds a few rays that run side by side: Reshetov, Soupikov, Hurley,
//! "Multi-level ray tracing algorithm", SIGGRAPH 2005.

use super::intersect::axes_by_size;
use crate::bvh::{WIDTH, WideNode};
use crate::ray::TraceRay;

/// Rays whose slopes differ by more than this do not run side by side.
const WIDEST: f32 = 0.3;

/// How much wider a frustum is than its rays, unit lengths.
///
/// In units u = 2^-24, boxes within 1 of the origin, origins within 2 and slopes
/// within 1.3: a slope is off by 3u, a crossing by 13u, their sum at a box by 23u. A
/// triangle may answer that lies 48u beside its ray (`intersect::DISPLACEMENT`).
const MARGIN: f32 = 128.0 / 16_777_216.0;

/// The least and the largest of some values.
type Interval = [f32; 2];

/// Bounds of rays that all run the same way along their largest axis, the main one.
#[derive(Clone, Copy, Debug)]
pub struct Frustum {
    /// The other two axes, and the main one.
    axes: [usize; 3],
    /// Whether the rays run towards higher coordinates along the main axis.
    is_forward: bool,
    /// The coordinate on the main axis before which no ray starts.
    start: f32,
    /// On each of the other axes, where the rays cross 0 of the main axis, and how far
    /// they go for each unit along it.
    crossing: [Interval; 2],
    slope: [Interval; 2],
}

impl Frustum {
    /// The frustum of `rays`; `None` if they do not run side by side, or if a number is
    /// not finite.
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
            // Fails where a number is not one.
            is_narrow &= slope[i][1] - slope[i][0] <= WIDEST && slope[i][0].abs() <= 1.0 + WIDEST;
            is_narrow &= crossing[i].iter().all(|c| c.is_finite());
        }
        let [least, most] = interval(&start);
        let start = if is_forward { least } else { most };
        is_narrow.then_some(Self { axes, is_forward, start, crossing, slope })
    }

    /// The boxes of `node` that a ray may enter, a bit each. A plain loop over all
    /// boxes, which the compiler turns into vector instructions.
    #[inline(always)]
    pub fn may_enter(&self, node: &WideNode) -> u32 {
        let [low, high] = &node.boxes;
        let main = self.axes[2];
        let mut entered = 0;
        for i in 0..WIDTH {
            let (from, to) = match self.is_forward {
                true => (low[main][i].max(self.start - MARGIN), high[main][i]),
                false => (low[main][i], high[main][i].min(self.start + MARGIN)),
            };
            let mut may = from <= to;
            for (j, &axis) in self.axes[..2].iter().enumerate() {
                let [least, most] = self.slope[j];
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
    let least = |a: f32, &b: &f32| if b < a { b } else { a };
    let most = |a: f32, &b: &f32| if b > a { b } else { a };
    let [first, ..] = values else { return [f32::NAN; 2] };
    [values.iter().fold(*first, least), values.iter().fold(*first, most)]
}
