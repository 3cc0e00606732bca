//! The f64 twin: the same test on the same tree, in double precision. Every
//! range that leaves this crate was solved here, whoever found the triangle.

use crate::bvh::{LeafTriangle, traverse};
use crate::ray::Ray;
use crate::target::Target;
use glam::DVec3;

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Distance from the sensor, metres.
    pub range_m: f64,
    /// The triangle's index in its mesh.
    pub index: u32,
}

/// The nearest crossing of `ray`, in f64.
///
/// Two triangles at exactly the same range: the lower index.
#[must_use]
pub fn nearest(target: &Target, ray: &Ray) -> Option<Crossing> {
    if target.surface.is_empty() {
        return None;
    }
    let shear = Shear::of(ray.direction);
    let per_direction = reciprocal(ray.direction);
    let mut best: Option<Crossing> = None;
    traverse(
        &target.bvh.nodes,
        0,
        &mut best,
        |best, low, high| {
            let farthest = best.map_or(f64::INFINITY, |best| best.range_m);
            enter(low, high, ray.origin, per_direction, farthest)
        },
        |best, leaf| {
            for &LeafTriangle { index, .. } in &target.bvh.triangles[leaf] {
                let corners = target.surface.corners(index);
                let Some(range_m) = cross(ray.origin, &shear, corners) else { continue };
                if best.is_none_or(|best| (range_m, index) < (best.range_m, best.index)) {
                    *best = Some(Crossing { range_m, index });
                }
            }
        },
    );
    best
}

/// The range at which `ray` meets the plane of triangle `index`, which a
/// caster found it to hit; never outside the triangle's own extent along the
/// ray, however grazing. `None` if all of it lies behind the sensor. The order
/// of the triangle's corners has no say, to the last bit.
#[must_use]
pub fn range_to(target: &Target, ray: &Ray, index: u32) -> Option<f64> {
    let corners = canonical(target.surface.corners(index));
    let [a, b, c] = corners.map(|v| v - ray.origin);
    let normal = (b - a).cross(c - a);
    let length_squared = ray.direction.length_squared();
    let along = [a, b, c].map(|v| v.dot(ray.direction) / length_squared);
    let (low, high) =
        along.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &t| (l.min(t), h.max(t)));
    let t = normal.dot(a) / normal.dot(ray.direction);
    let t = if t.is_finite() { t.clamp(low, high) } else { low };
    (high >= 0.0).then_some(t.max(0.0))
}

/// The unit normal of triangle `index` in the unit frame; zero if it has none.
#[must_use]
pub fn normal(target: &Target, index: u32) -> DVec3 {
    let [a, b, c] = target.surface.corners(index);
    (b - a).cross(c - a).normalize_or_zero()
}

/// Where the ray enters the box, in its own units; infinity if it does not.
fn enter(low: [f32; 3], high: [f32; 3], origin: DVec3, per_direction: DVec3, farthest: f64) -> f64 {
    let corner = |p: [f32; 3]| DVec3::from_array(p.map(f64::from));
    let t0 = (corner(low) - origin) * per_direction;
    let t1 = (corner(high) - origin) * per_direction;
    let near = t0.min(t1).max_element().max(0.0);
    // Ize 2013, in f64: boxes are padded by 2^-18, which also covers that they
    // were rounded to f32.
    let far = t0.max(t1).min_element().min(farthest) * (1.0 + 1e-14);
    if near <= far { near } else { f64::INFINITY }
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
    fn of(direction: DVec3) -> Self {
        let size = direction.abs();
        let axes = if size.x > size.y && size.x > size.z {
            [1, 2, 0]
        } else if size.y > size.z {
            [2, 0, 1]
        } else {
            [0, 1, 2]
        };
        let d = axes.map(|axis| direction[axis]);
        Self { axes, x: d[0] / d[2], y: d[1] / d[2], z: 1.0 / d[2] }
    }

    fn apply(&self, p: DVec3) -> [f64; 3] {
        let p = self.axes.map(|axis| p[axis]);
        [p[0] - self.x * p[2], p[1] - self.y * p[2], p[2] * self.z]
    }
}

fn cross(origin: DVec3, shear: &Shear, corners: [DVec3; 3]) -> Option<f64> {
    let [a, b, c] = canonical(corners).map(|v| shear.apply(v - origin));
    let edge = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
    let (u, v, w) = (edge(b, c), -edge(a, c), edge(a, b));
    let outside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
    let determinant = u + v + w;
    if outside || determinant == 0.0 {
        return None;
    }
    let t = (u * a[2] + v * b[2] + w * c[2]) / determinant;
    (t >= 0.0).then_some(t)
}

fn canonical(mut corners: [DVec3; 3]) -> [DVec3; 3] {
    corners.sort_unstable_by(|p, q| {
        p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(p.z.total_cmp(&q.z))
    });
    corners
}
