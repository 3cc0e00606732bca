//! Watertight ray-triangle test: Woop, Benthin, Wald, "Watertight ray/triangle intersection", JCGT
//! 2(1), 2013. Twin of `shaders/intersect.wgsl`, for the four triangles of a leaf at once. Each
//! lane equals the result of `reference` for one triangle to the bit.
//!
//! Subnormal numbers: WGSL allows adapters to flush them to 0, and the CPU does not flush. What
//! this crate promises does not depend on it. In the unit frame, flushing moves a coordinate by
//! less than 1.2e-38, which is negligible beside [`DISPLACEMENT`]. Edge functions are products of
//! two lengths: those of a triangle whose sides are below 1e-19 of the object's longest may vanish
//! on some adapters, whose beams then hit the surface behind it. Such a triangle is smaller than
//! the rounding of any vertex that is not next to 0.

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
    /// A bit for each lane whose triangle the ray meets.
    pub met: u32,
    /// Distance from the ray's origin, unit lengths.
    pub t: [f32; LEAF],
    /// Bound of the difference between `t` and the true distance.
    pub error: [f32; LEAF],
    /// Lower bound of the distance of another surface that the ray may truly meet instead,
    /// because it passes near an edge or starts near the triangle; else `NO_HIT`.
    pub rival: [f32; LEAF],
}

/// The most that rounding displaces a triangle relative to the ray, in unit lengths.
///
/// In units u = 2^-24, for each component, with coordinates of vertices at most 1 and of origins at
/// most 2: u for the vertex, u for the origin, 2u for their difference, and 3.5u for the direction
/// over a chord of 3.5, in sum 7.5u. The shear (|Sx| <= 1) doubles that to 15u. Its own arithmetic
/// adds 8u, the rounding of Sx 5.5u, and edge functions over edges of at most 2 add 8u: 36.5u
/// sideways. Along the ray it is 1.74 x 7.5u, and 3.5 x 4u for the division: 27u.
///
/// For a ray made in integers ([`aim`](super::aim)), the origin counts 5.5u, and the direction 0.6u
/// over each unit length, 2.2u over 3.55. The sum is 10.7u instead of 7.5u: 43u sideways and 33u
/// along the ray. All are below 48u.
pub const DISPLACEMENT: f32 = 48.0 / 16_777_216.0;

/// The tangent of the steepest incidence with the promised accuracy: 1 / tan(0.1 degree).
pub const STEEPEST: f32 = 573.0;

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

/// Intersects a ray with a leaf's triangles; `None` if it meets none of them. Both faces count,
/// and edges belong to the triangle.
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
    let zero = Vec4::ZERO;
    let negative = u.cmplt(zero) | v.cmplt(zero) | w.cmplt(zero);
    let positive = u.cmpgt(zero) | v.cmpgt(zero) | w.cmpgt(zero);
    let determinant = u + v + w;
    // A NaN, which is not equal to 0, passes here and fails the comparison for `met`.
    let inside = !(negative & positive) & determinant.cmpne(zero);
    if !inside.any() {
        return None;
    }
    let (az, bz, cz) = (a.along * shear.per_z, b.along * shear.per_z, c.along * shear.per_z);
    let t = (u * az + v * bz + w * cz) / determinant;
    // The normal in sheared space has the determinant as its z: their ratio is
    // the tangent that turns a displacement into an error of distance.
    let slope_x = edge(b.y - a.y, bz - az, c.y - a.y, cz - az);
    let slope_y = edge(bz - az, b.x - a.x, cz - az, c.x - a.x);
    let slope = (slope_x.abs() + slope_y.abs()) / determinant.abs();
    let error = DISPLACEMENT * (1.0 + slope);
    // Whether a point lies within `DISPLACEMENT` of the line along (x, y), given
    // the edge function there. Squares that vanish count as within.
    let within = |edge: Vec4, x: Vec4, y: Vec4| {
        (edge * edge).cmple(DISPLACEMENT * DISPLACEMENT * (x * x + y * y))
    };
    let near_edge = within(u, c.x - b.x, c.y - b.y)
        | within(v, c.x - a.x, c.y - a.y)
        | within(w, b.x - a.x, b.y - a.y);
    // Near an edge the ray may truly miss the triangle and meet its neighbour. Within the
    // displacement the two planes part by at most the slopes of both.
    let neighbour = t - 2.0 * error - DISPLACEMENT * STEEPEST;
    // A triangle within its error of the origin may truly lie behind it.
    let if_behind = Vec4::select(t.cmplt(error), t - error, Vec4::splat(NO_HIT));
    let rival = Vec4::select(near_edge, neighbour, if_behind);
    let met = (inside & (t + error).cmpge(zero)).bitmask();
    let [t, error, rival] = [t, error, rival].map(|lanes| lanes.to_array());
    Some(Candidates4 { met, t, error, rival })
}
