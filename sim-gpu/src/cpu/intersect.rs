//! Watertight ray-triangle test: Woop, Benthin, Wald, "Watertight ray/triangle intersection", JCGT
//! 2(1), 2013. Twin of `shaders/intersect.wgsl`, for the four triangles of a leaf at once. Each
//! lane equals the result of `reference` for one triangle to the bit.
//!
//! Subnormal numbers: WGSL allows adapters to flush them to 0, and the CPU does not flush. What
//! this crate promises does not depend on it. In the unit frame, flushing moves a coordinate by
//! less than 1.2e-38, which is negligible beside [`DISPLACEMENT`]. Edge functions are products of
//! two lengths: those of a triangle whose sides are below 1e-19 of the object's longest may vanish
//! on some adapters, and so may those of one whose corners coincide in f32; beams then hit the
//! surface behind it. Such a triangle is smaller than the rounding of any vertex that is not next
//! to 0.

#[cfg(test)]
mod reference;

use crate::bvh::{LEAF, Leaf4};
use crate::ray::NO_HIT;
use glam::{Vec3, Vec4};

/// The shear that maps a ray onto +z.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shear {
    /// The axes that become x, y and z: z is the ray's largest component.
    pub(super) axes: [usize; 3],
    /// The decrease of x and y for each unit along z.
    pub(super) x: f32,
    pub(super) y: f32,
    /// Distance along the ray for each unit along z.
    pub(super) per_z: f32,
}

/// The crossings of a ray with the triangles of a leaf, one in each lane.
#[derive(Clone, Copy, Debug)]
pub struct Candidates4 {
    /// A bit for each lane whose triangle the ray meets, or passes within [`DISPLACEMENT`] of the
    /// sides that it is outside of.
    pub met: u32,
    /// Distance from the ray's origin, unit lengths.
    pub t: [f32; LEAF],
    /// Bound of the difference between `t` and the true distance.
    pub error: [f32; LEAF],
    /// Lower bound of the distance of what the ray may truly meet instead, because it passes near
    /// an edge or starts near the triangle; else `NO_HIT`.
    pub rival: [f32; LEAF],
}

/// The most that rounding displaces a triangle relative to the ray, in unit lengths.
///
/// In units u = 2^-24, as lengths of vectors, with coordinates of vertices at most 1, origins at most
/// 1.87 from the centre, and 3.55 to go. WGSL rounds sums and products correctly or fuses them
/// ("Reassociation and Fusion"), and lets a division err by 2.5 ULP ("Accuracy of Concrete Floating
/// Point Expressions"), which is at most 5u of its result.
///
/// The vertex counts 0.9u, the origin of a ray made in integers ([`aim`](super::aim)) 8.2u (6.5u of its
/// matrix and 1.7u of its start), their difference 3.5u, and the direction 3.7u: 16.3u, which the
/// shear lengthens to at most sqrt(3) times that, 28.2u. Its products add 2.8u and its differences
/// 3u. Sx and Sy are off by 5.5u each, over a z of at most 3.55 / sqrt(3) where both are 1: 15.9u.
/// Edge functions add 4u where the ray is near the side. That is 53.9u sideways; a ray rounded from
/// f64 has less.
///
/// Along the ray, errors of the origin, the direction and `per_z` move all surfaces alike. The vertex
/// and its difference from the origin count 4.4u, the product 2u, and the quotient 27.8u: 34.2u.
pub const DISPLACEMENT: f32 = 56.0 / 16_777_216.0;

/// How much the rounding of edge functions moves the distance of a crossing, in the square of the longest
/// side, times the extent along the ray, over the determinant.
///
/// Corners are at most sqrt(3) times the longest side from a ray that meets the triangle. An edge
/// function rounds by at most twice u times the product of two such lengths: 6u. As a weight, it
/// moves the crossing between the distances of corners, two of which differ from it by up to the
/// extent: 12u. Only slivers have a determinant that is small beside the square.
pub const EDGE_ROUNDING: f32 = 12.0 / 16_777_216.0;

/// The axes in cyclic order, the one of largest size last.
#[must_use]
#[inline(always)]
pub(super) fn axes_by_size<T: PartialOrd>([x, y, z]: [T; 3]) -> [usize; 3] {
    if x > y && x > z {
        [1, 2, 0]
    } else if y > z {
        [2, 0, 1]
    } else {
        [0, 1, 2]
    }
}

impl Shear {
    /// The shear of a ray along `direction`.
    #[must_use]
    #[inline]
    pub fn along(direction: Vec3) -> Self {
        let axes = axes_by_size(direction.abs().to_array());
        let d = axes.map(|axis| direction[axis]);
        let per_z = 1.0 / d[2];
        Self { axes, x: d[0] * per_z, y: d[1] * per_z, per_z }
    }
}

/// Points in the sheared space of a ray.
struct Sheared {
    x: Vec4,
    y: Vec4,
    /// Along the largest axis, not yet scaled by `per_z`.
    along: Vec4,
}

#[inline(always)]
fn sheared(points: &[[f32; LEAF]; 3], origin: &[Vec4; 3], shear: &Shear) -> Sheared {
    let [i, j, k] = shear.axes;
    let [x, y, along] = [points[i], points[j], points[k]].map(Vec4::from_array);
    let along = along - origin[2];
    let x = (x - origin[0]) - along * shear.x;
    let y = (y - origin[1]) - along * shear.y;
    Sheared { x, y, along }
}

#[inline(always)]
fn edge(px: Vec4, py: Vec4, qx: Vec4, qy: Vec4) -> Vec4 {
    px * qy - py * qx
}

/// Intersects a ray with a leaf's triangles; `None` if it meets none of them. Both faces count.
/// Whatever the adapter's rounding, a triangle that the ray truly meets is among those met.
#[inline(always)]
#[must_use]
pub fn intersect4(origin: Vec3, shear: &Shear, leaf: &Leaf4) -> Option<Candidates4> {
    let origin = shear.axes.map(|axis| Vec4::splat(origin[axis]));
    let [a, b, c] = &leaf.corners;
    let (a, b, c) =
        (sheared(a, &origin, shear), sheared(b, &origin, shear), sheared(c, &origin, shear));
    let u = edge(b.x, b.y, c.x, c.y);
    let v = -edge(a.x, a.y, c.x, c.y);
    let w = edge(a.x, a.y, b.x, b.y);
    let (least, most) = (u.min(v).min(w), u.max(v).max(w));
    // A ray within `DISPLACEMENT` of the triangle is outside no side by more than this: the shear makes
    // a side at most sqrt(3) longer.
    let longest = Vec4::from_array(leaf.longest);
    let margin = longest * (2.0 * DISPLACEMENT);
    let apart = least.cmplt(-margin) & most.cmpgt(margin);
    if apart.all() {
        return None;
    }
    // Whether a point lies within `DISPLACEMENT` of the line along (x, y), given
    // the edge function there. Squares that vanish count as within.
    let within = |edge: Vec4, x: Vec4, y: Vec4| {
        (edge * edge).cmple(DISPLACEMENT * DISPLACEMENT * (x * x + y * y))
    };
    let near = [
        within(u, c.x - b.x, c.y - b.y),
        within(v, c.x - a.x, c.y - a.y),
        within(w, b.x - a.x, b.y - a.y),
    ];
    let near_edge = near[0] | near[1] | near[2];
    // Outside by the sides that the ray is not near.
    let zero = Vec4::ZERO;
    let left = (u.cmplt(zero) & !near[0]) | (v.cmplt(zero) & !near[1]) | (w.cmplt(zero) & !near[2]);
    let right =
        (u.cmpgt(zero) & !near[0]) | (v.cmpgt(zero) & !near[1]) | (w.cmpgt(zero) & !near[2]);
    let outside = left & right;
    let (az, bz, cz) = (a.along * shear.per_z, b.along * shear.per_z, c.along * shear.per_z);
    let determinant = u + v + w;
    let t = (u * az + v * bz + w * cz) / determinant;
    // The normal in sheared space has the determinant as its z: their ratio is
    // the tangent that turns a displacement into an error of distance.
    let slope_x = edge(b.y - a.y, bz - az, c.y - a.y, cz - az);
    let slope_y = edge(bz - az, b.x - a.x, cz - az, c.x - a.x);
    let slope = (slope_x.abs() + slope_y.abs()) / determinant.abs();
    let (first, last) = (az.min(bz).min(cz), az.max(bz).max(cz));
    let rounding = EDGE_ROUNDING * longest * longest * (last - first) / determinant.abs();
    let error = DISPLACEMENT * (1.0 + slope) + rounding;
    // A triangle seen edge-on is met anywhere along its extent.
    let edge_on = determinant.cmpeq(zero);
    let t = Vec4::select(edge_on, first, t);
    let error = Vec4::select(edge_on, DISPLACEMENT + (last - first), error);
    // Near an edge the ray may truly miss the triangle. A triangle within its error of the origin
    // may truly lie behind it.
    let is_open = near_edge | t.cmplt(error);
    let rival = Vec4::select(is_open, t - error, Vec4::splat(NO_HIT));
    // A NaN fails the last comparison.
    let met = (!apart & !outside & (t + error).cmpge(zero)).bitmask();
    let [t, error, rival] = [t, error, rival].map(|lanes| lanes.to_array());
    Some(Candidates4 { met, t, error, rival })
}
