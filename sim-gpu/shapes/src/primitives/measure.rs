//! Measures of a mesh that tests compare with geometry's formulas.

use glam::DVec3;

use super::super::builder::Builder;

/// The enclosed volume of what `build` makes at an edge length of `edge_m`;
/// positive if front faces look outwards.
pub fn volume_m3(edge_m: f64, build: impl FnOnce(&mut Builder)) -> f64 {
    sum(edge_m, build, |[a, b, c]| a.dot(b.cross(c)) / 6.0)
}

/// The surface area of what `build` makes at an edge length of `edge_m`.
pub fn area_m2(edge_m: f64, build: impl FnOnce(&mut Builder)) -> f64 {
    sum(edge_m, build, |[a, b, c]| (b - a).cross(c - a).length() / 2.0)
}

fn sum(
    edge_m: f64,
    build: impl FnOnce(&mut Builder),
    of_triangle: impl Fn([DVec3; 3]) -> f64,
) -> f64 {
    let mut builder = Builder::new(edge_m, 1.0);
    build(&mut builder);
    let (mesh, _) = builder.finish();
    mesh.triangles.iter().map(|t| of_triangle(t.map(|i| mesh.vertices[i as usize]))).sum()
}
