//! Boxes, cylinders, spheres and capsules as triangles.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::TriangleMesh;

/// How far a triangle may be inside of a round surface, metres.
pub const BOUND_M: f64 = 1e-3;

/// Larger ones would take more than a million triangles.
pub const LARGEST_RADIUS_M: f64 = 100.0;

/// A box of size 1 around the origin.
pub fn cube() -> TriangleMesh {
    let sign = |i: usize, axis: usize| if i >> axis & 1 == 1 { 0.5 } else { -0.5 };
    let vertices = (0..8).map(|i| DVec3::new(sign(i, 0), sign(i, 1), sign(i, 2))).collect();
    let sides: [[u32; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriangleMesh { vertices, triangles }
}

/// A cylinder around z, with its middle at the origin.
pub fn cylinder(radius_m: f64, length_m: f64) -> TriangleMesh {
    let (r, z) = (radius_m, 0.5 * length_m);
    turned(&[(0.0, -z), (r, -z), (r, z), (0.0, z)], segments(radius_m))
}

/// A sphere around the origin; with a length, a capsule around z: two halves of a sphere so far apart.
pub fn capsule(radius_m: f64, length_m: f64) -> TriangleMesh {
    let n = segments(radius_m);
    let quarter = n / 4;
    let point = |i: usize, z: f64| {
        let angle = TAU * i as f64 / n as f64;
        let r = if i.is_multiple_of(2 * quarter) { 0.0 } else { radius_m * libm::sin(angle) };
        (r, z - radius_m * libm::cos(angle))
    };
    let lower = (0..=quarter).map(|i| point(i, -0.5 * length_m));
    let from = if length_m > 0.0 { quarter } else { quarter + 1 };
    let upper = (from..=2 * quarter).map(|i| point(i, 0.5 * length_m));
    turned(&lower.chain(upper).collect::<Vec<_>>(), n)
}

/// The sides of a circle, a multiple of four. Of a sphere with as many in all directions, the middle of
/// a side is `radius (1 - cos^2(pi / n))` inside at most.
fn segments(radius_m: f64) -> usize {
    let half = libm::asin((BOUND_M / radius_m).sqrt().min(1.0));
    ((PI / half).ceil() as usize).clamp(16, 4096).next_multiple_of(4)
}

/// The surface that this profile (radius, z), from below, has around z; radius 0 is a pole.
fn turned(profile: &[(f64, f64)], n: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut rings = Vec::new();
    for &(radius, z) in profile {
        let first = mesh.vertices.len() as u32;
        let n_points = if radius == 0.0 { 1 } else { n };
        mesh.vertices.extend((0..n_points).map(|i| {
            let (sin, cos) = libm::sincos(TAU * i as f64 / n as f64);
            DVec3::new(radius * cos, radius * sin, z)
        }));
        rings.push((first, n_points as u32));
    }
    for [below, above] in rings.array_windows() {
        let at = |(first, n_points): &(u32, u32), i: usize| first + i as u32 % n_points;
        for i in 0..n {
            let [a, b, c, d] = [at(below, i), at(below, i + 1), at(above, i + 1), at(above, i)];
            mesh.triangles.extend(
                [[a, b, c], [a, c, d]].into_iter().filter(|[a, b, c]| a != b && b != c && a != c),
            );
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six times the volume that the triangles enclose, if they look outwards.
    fn volume(mesh: &TriangleMesh) -> f64 {
        let corners = |t: &[u32; 3]| t.map(|corner| mesh.vertices[corner as usize]);
        let parts = mesh.triangles.iter().map(|t| {
            let [a, b, c] = corners(t);
            a.dot(b.cross(c)) / 6.0
        });
        parts.sum()
    }

    #[test]
    fn shapes_have_the_volumes_of_their_formulas() {
        assert!((volume(&cube()) - 1.0).abs() < 1e-12);
        for r in [0.01, 0.5, 30.0] {
            // A shell of 1 mm, as an upper bound.
            let shell = |area: f64| area * BOUND_M;
            let (round, sphere) = (PI * r * r, 4.0 / 3.0 * PI * r.powi(3));
            let found = volume(&cylinder(r, 2.0));
            assert!((0.0..shell(TAU * r * 2.0)).contains(&(2.0 * round - found)), "{r}: {found}");
            for length in [0.0, 3.0] {
                let found = volume(&capsule(r, length));
                let expected = sphere + length * round;
                let area = 4.0 * round + TAU * r * length;
                assert!((0.0..shell(area)).contains(&(expected - found)), "{r}: {found}");
            }
        }
    }

    #[test]
    fn no_triangle_of_a_sphere_is_deeper_than_the_bound() {
        for r in [0.002, 0.1, 1.0, 20.0] {
            let mesh = capsule(r, 0.0);
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|corner| mesh.vertices[corner as usize]);
                // The nearest point of its plane is no farther than that of the triangle.
                let distance = (b - a).cross(c - a).normalize().dot(a);
                assert!((r - BOUND_M - 1e-12..=r).contains(&distance), "{r}: {distance}");
            }
        }
    }
}
