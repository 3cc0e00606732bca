//! The f64 twin: the same tests on the same tree in double precision. Every range of a scan is
//! computed here, on whatever adapter the triangle was found.

use super::intersect::axes_by_size;
use crate::bvh::{Entered, Leaf4, Search, Stack, WIDTH, WideChild, WideNode, boxes_that, traverse};
use crate::lanes::{Vectors, each};
use crate::ray::{Ray, Rays};
use crate::target::{Surface, Target};
use glam::DVec3;

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Distance from the sensor, metres.
    pub range_m: f64,
    /// The triangle's index in its mesh.
    pub index: u32,
}

/// The nearest crossing of `ray`, in f64; of two at exactly the same range, the lower index.
#[must_use]
pub fn nearest(target: &Target, ray: &Ray) -> Option<Crossing> {
    if target.surface.is_empty() {
        return None;
    }
    let mut search = NearestInF64 {
        surface: &target.surface,
        origin: ray.origin,
        shear: Shear::along(ray.direction),
        per_direction: reciprocal(ray.direction),
        best: None,
    };
    traverse(&target.bvh.wide, WideChild::ROOT, &mut Stack::default(), &mut search);
    search.best
}

struct NearestInF64<'a> {
    surface: &'a Surface,
    origin: DVec3,
    shear: Shear,
    per_direction: DVec3,
    best: Option<Crossing>,
}

impl NearestInF64<'_> {
    fn farthest(&self) -> f64 {
        self.best.map_or(f64::INFINITY, |best| best.range_m)
    }
}

impl Search for NearestInF64<'_> {
    type Distance = f64;

    fn enter(&self, node: &WideNode) -> Entered<f64> {
        enter(node, self.origin, self.per_direction, self.farthest())
    }

    fn matters(&self, distance: f64) -> bool {
        distance <= self.farthest() * FAR_SCALE
    }

    fn visit(&mut self, leaf: &Leaf4) {
        for &index in leaf.indices() {
            let corners = self.surface.sorted_corners(index);
            let Some(range_m) = cross(self.origin, &self.shear, corners) else { continue };
            if self.best.is_none_or(|best| (range_m, index) < (best.range_m, best.index)) {
                self.best = Some(Crossing { range_m, index });
            }
        }
    }
}

/// The range at which `ray` meets the plane of triangle `index`, which a caster found it to hit,
/// clamped to the triangle's extent along the ray. `None` if all of the triangle lies behind the
/// sensor. The order of the triangle's corners does not change a bit of it.
#[must_use]
pub fn range_to(target: &Target, ray: &Ray, index: u32) -> Option<f64> {
    let [range_m] = ranges_to(&target.surface, &Rays::one(ray), [index]);
    (!range_m.is_nan()).then_some(range_m)
}

/// As [`range_to`] for several rays, each with its own triangle; NaN if all of the triangle lies
/// behind the sensor.
#[inline(always)]
pub(crate) fn ranges_to<const N: usize>(
    surface: &Surface,
    rays: &Rays<N>,
    triangles: [u32; N],
) -> [f64; N] {
    // In the order of coordinates, so that the order in the file does not change a bit.
    let corners: [[DVec3; 3]; N] = each(|i| surface.sorted_corners(triangles[i]));
    let a = Vectors::new(each(|i| corners[i][0])) - rays.origin;
    let b = Vectors::new(each(|i| corners[i][1])) - rays.origin;
    let c = Vectors::new(each(|i| corners[i][2])) - rays.origin;
    let normal = (b - a).cross(&(c - a));
    let length_squared = rays.direction.dot(&rays.direction);
    let [of_a, of_b, of_c] = [a, b, c].map(|v| v.dot(&rays.direction));
    let (height, drop) = (normal.dot(&a), normal.dot(&rays.direction));
    each(|i| {
        let [of_a, of_b, of_c] = [of_a, of_b, of_c].map(|along| along[i] / length_squared[i]);
        // The extent of the triangle along the ray.
        let (low, high) = (of_a.min(of_b).min(of_c), of_a.max(of_b).max(of_c));
        let t = height[i] / drop[i];
        // Grazing rays divide by a `drop` near 0: the quotient may be anything.
        let t = if t.is_finite() && t > low { t } else { low };
        let t = if t > high { high } else { t };
        let t = if t > 0.0 { t } else { 0.0 };
        if high >= 0.0 { t } else { f64::NAN }
    })
}

/// The unit normal of triangle `index` in the unit frame; zero if its area is.
#[must_use]
pub fn normal(target: &Target, index: u32) -> DVec3 {
    let [a, b, c] = target.surface.corners(index);
    (b - a).cross(c - a).normalize_or_zero()
}

/// Bounds the rounding of near and far distances together: Ize 2013, in f64. The boxes' padding
/// of 2^-18 also covers their rounding to f32.
const FAR_SCALE: f64 = 1.0 + 1e-14;

/// The boxes of `node` that the ray enters before `farthest`, and the distances, in units of the
/// direction's length.
fn enter(node: &WideNode, origin: DVec3, per_direction: DVec3, farthest: f64) -> Entered<f64> {
    let (mut near, mut far) = ([0.0f64; WIDTH], [farthest; WIDTH]);
    for axis in 0..3 {
        let [low, high] = node.boxes.map(|corners| corners[axis]);
        for i in 0..WIDTH {
            // Subtracted before multiplied: the precomputed offset of the f32 test loses digits.
            let t0 = (f64::from(low[i]) - origin[axis]) * per_direction[axis];
            let t1 = (f64::from(high[i]) - origin[axis]) * per_direction[axis];
            near[i] = near[i].max(t0.min(t1));
            far[i] = far[i].min(t0.max(t1));
        }
    }
    (boxes_that(|i| near[i] <= far[i] * FAR_SCALE), near)
}

fn reciprocal(direction: DVec3) -> DVec3 {
    const LEAST_COMPONENT: f64 = 1e-200;
    let away = |d: f64| if d.abs() >= LEAST_COMPONENT { d } else { LEAST_COMPONENT.copysign(d) };
    DVec3::new(away(direction.x), away(direction.y), away(direction.z)).recip()
}

/// Woop, Benthin, Wald 2013; see `intersect`.
struct Shear {
    axes: [usize; 3],
    x: f64,
    y: f64,
    z: f64,
}

impl Shear {
    fn along(direction: DVec3) -> Self {
        let axes = axes_by_size(direction.abs().to_array());
        let d = axes.map(|axis| direction[axis]);
        Self { axes, x: d[0] / d[2], y: d[1] / d[2], z: 1.0 / d[2] }
    }

    fn apply(&self, p: DVec3) -> [f64; 3] {
        let p = self.axes.map(|axis| p[axis]);
        [p[0] - self.x * p[2], p[1] - self.y * p[2], p[2] * self.z]
    }
}

fn cross(origin: DVec3, shear: &Shear, corners: [DVec3; 3]) -> Option<f64> {
    let [a, b, c] = corners.map(|v| shear.apply(v - origin));
    let edge = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
    let (u, v, w) = (edge(b, c), -edge(a, c), edge(a, b));
    // Signs differ outside; zeros, on edges and corners, count as either.
    let outside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
    let determinant = u + v + w;
    if outside || determinant == 0.0 {
        return None;
    }
    let t = (u * a[2] + v * b[2] + w * c[2]) / determinant;
    (t >= 0.0).then_some(t)
}
