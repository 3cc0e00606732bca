//! Watertight ray-triangle test: Woop, Benthin, Wald, "Watertight
//! ray/triangle intersection", JCGT 2(1), 2013. Twin of
//! `shaders/intersect.wgsl`.
//!
//! Subnormal numbers: WGSL lets an adapter flush them to 0 or not, as it likes, and
//! the CPU does not. Promised is what does not depend on it. In the unit frame a
//! flushed coordinate moves by less than 1.2e-38, nothing beside [`DISPLACEMENT`].
//! Edge functions multiply two lengths: those of a triangle whose sides are below
//! 1e-19 of the object's longest may vanish on one adapter and not on another, so
//! that a beam hits it on the one and what lies behind it on the other. Such a
//! triangle is smaller than the rounding of any vertex that is not next to 0.

use crate::bvh::LeafTriangle;
use crate::ray::NO_HIT;
use glam::Vec3;

/// Rows of the shear that maps the ray onto +z.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    x: Vec3,
    y: Vec3,
    z: Vec3,
}

/// A triangle that a ray meets.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Distance from the ray's origin, unit lengths.
    pub t: f32,
    /// How far the true distance may be from `t`.
    pub error: f32,
    /// The lowest distance at which the ray may truly meet something else than
    /// this triangle, as far as this test can know; `NO_HIT` if nothing.
    pub rival: f32,
}

/// Rounding moves a triangle by at most this much against the ray, in unit
/// lengths.
///
/// In units u = 2^-24, per component, coordinates of vertices at most 1 and of
/// origins at most 2: vertex u, origin u, their difference 2u, direction 3.5u
/// over a chord of 3.5; twice that through the shear (|Sx| <= 1): 15u. The
/// shear's own arithmetic: 8u, the rounding of Sx: 5.5u, edge functions over
/// edges of at most 2: 8u. Together 36.5u sideways; along the ray
/// 1.74 * 7.5u and 4u * 3.5 of the division: 27u. Both are below 48u.
pub const DISPLACEMENT: f32 = 48.0 / 16_777_216.0;

/// The tangent of the steepest incidence at which a range keeps its promised
/// accuracy: 1 / tan(0.1 degree).
pub const STEEPEST: f32 = 573.0;

impl Shear {
    /// The shear of a ray along `direction`.
    #[must_use]
    pub fn of(direction: Vec3) -> Self {
        let size = direction.abs();
        let (ex, ey, ez, d) = if size.x > size.y && size.x > size.z {
            (Vec3::Y, Vec3::Z, Vec3::X, Vec3::new(direction.y, direction.z, direction.x))
        } else if size.y > size.z {
            (Vec3::Z, Vec3::X, Vec3::Y, Vec3::new(direction.z, direction.x, direction.y))
        } else {
            (Vec3::X, Vec3::Y, Vec3::Z, direction)
        };
        let per_z = 1.0 / d.z;
        Self { x: ex - ez * (d.x * per_z), y: ey - ez * (d.y * per_z), z: ez * per_z }
    }
}

fn row(r: Vec3, p: Vec3) -> f32 {
    r.x * p.x + r.y * p.y + r.z * p.z
}

fn edge(px: f32, py: f32, qx: f32, qy: f32) -> f32 {
    px * qy - py * qx
}

/// Where the ray meets the triangle, both faces alike, edges included.
#[inline]
#[must_use]
pub fn intersect(origin: Vec3, shear: &Shear, triangle: &LeafTriangle) -> Option<Candidate> {
    let a = Vec3::from_array(triangle.a) - origin;
    let b = Vec3::from_array(triangle.b) - origin;
    let c = Vec3::from_array(triangle.c) - origin;
    let (ax, ay) = (row(shear.x, a), row(shear.y, a));
    let (bx, by) = (row(shear.x, b), row(shear.y, b));
    let (cx, cy) = (row(shear.x, c), row(shear.y, c));
    let u = edge(bx, by, cx, cy);
    let v = -edge(ax, ay, cx, cy);
    let w = edge(ax, ay, bx, by);
    let outside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
    let determinant = u + v + w;
    if outside || determinant == 0.0 {
        return None;
    }
    let (az, bz, cz) = (row(shear.z, a), row(shear.z, b), row(shear.z, c));
    let t = (u * az + v * bz + w * cz) / determinant;
    // The normal in sheared space has the determinant as its z: their ratio is
    // the tangent that turns a displacement into an error of distance.
    let slope_x = edge(by - ay, bz - az, cy - ay, cz - az);
    let slope_y = edge(bz - az, bx - ax, cz - az, cx - ax);
    let slope = (slope_x.abs() + slope_y.abs()) / determinant.abs();
    let error = DISPLACEMENT * (1.0 + slope);
    let near_edge =
        within(u, cx - bx, cy - by) || within(v, cx - ax, cy - ay) || within(w, bx - ax, by - ay);
    let rival = if near_edge {
        // Truly the ray may pass the edge and meet the neighbour, whose plane
        // parts from this one by both slopes.
        t - 2.0 * error - DISPLACEMENT * STEEPEST
    } else if t < error {
        // Truly the triangle may lie behind the ray's origin.
        t - error
    } else {
        NO_HIT
    };
    (t + error >= 0.0).then_some(Candidate { t, error, rival })
}

/// Whether a point lies within `DISPLACEMENT` of the line along (x, y), given
/// the edge function there. Squares that vanish count as within.
#[inline]
fn within(edge: f32, x: f32, y: f32) -> bool {
    edge * edge <= DISPLACEMENT * DISPLACEMENT * (x * x + y * y)
}
