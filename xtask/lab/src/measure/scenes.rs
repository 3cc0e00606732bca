//! Meshes made by rule, so that every machine measures the same.

use glam::{DQuat, DVec3, dvec3};
use harness::meshes::{icosphere, mapped};
use sim_gpu::internals::mesh::TriangleMesh;
use std::f64::consts::TAU;

/// A bumpy torus of about `triangles` triangles that fits the unit sphere.
pub fn torus(triangles: usize) -> TriangleMesh {
    let n = ((triangles as f64 / 2.0).sqrt().round() as usize).max(3);
    let mut mesh = TriangleMesh::default();
    for i in 0..n {
        for j in 0..n {
            let (u, v) = (i as f64 / n as f64 * TAU, j as f64 / n as f64 * TAU);
            let tube = 0.27 * (1.0 + 0.1 * (7.0 * u).sin() * (5.0 * v).cos());
            let ring = 0.7 + tube * v.cos();
            mesh.vertices.push(dvec3(ring * u.cos(), ring * u.sin(), tube * v.sin()));
            let at = |i: usize, j: usize| (i % n * n + j % n) as u32;
            push_quad(&mut mesh, [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    mesh
}

/// `mesh` inside a closed cube of 16 m, so that every ray hits.
pub fn in_a_room(mut mesh: TriangleMesh) -> TriangleMesh {
    const HALF_SIDE_M: f64 = 8.0;
    let first = mesh.vertices.len() as u32;
    for corner in 0..8 {
        let side = |bit: u32| if corner & bit > 0 { HALF_SIDE_M } else { -HALF_SIDE_M };
        mesh.vertices.push(dvec3(side(1), side(2), side(4)));
    }
    let walls =
        [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    walls.iter().for_each(|wall| push_quad(&mut mesh, wall.map(|corner| first + corner)));
    mesh
}

/// A closed sphere of 20 * 4^`levels` triangles, neither centred nor aligned.
pub fn closed_sphere(levels: u32) -> TriangleMesh {
    let turn = DQuat::from_axis_angle(dvec3(0.3, -0.5, 0.8).normalize(), 0.7);
    let shift = dvec3(0.137, -0.291, 0.053);
    mapped(&icosphere(levels), |v| turn * v + shift)
}

/// The points halfway along each edge of `mesh`, once each.
pub fn edge_midpoints(mesh: &TriangleMesh) -> Vec<DVec3> {
    let mut edges: Vec<[u32; 2]> = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[p, q]| [p.min(q), p.max(q)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges.iter().map(|e| e.map(|v| mesh.vertices[v as usize])).map(|[p, q]| 0.5 * (p + q)).collect()
}

fn push_quad(mesh: &mut TriangleMesh, [a, b, c, d]: [u32; 4]) {
    mesh.triangles.extend([[a, b, c], [a, c, d]]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torus_has_about_as_many_triangles_as_asked() {
        for triangles in [1_000, 10_000, 100_000] {
            let mesh = torus(triangles);
            assert!((mesh.triangles.len() as f64 / triangles as f64 - 1.0).abs() < 0.05);
            assert!(mesh.vertices.iter().all(|v| v.length() < 1.0));
        }
    }

    #[test]
    fn the_closed_sphere_is_the_one_of_the_published_comparison() {
        let mesh = closed_sphere(5);
        assert_eq!(mesh.triangles.len(), 20_480);
        assert_eq!(mesh.vertices.len(), 10_242);
        assert_eq!(edge_midpoints(&mesh).len(), 30_720);
    }
}
