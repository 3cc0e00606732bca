//! Meshes whose surface is known.

use std::collections::HashMap;
use std::f64::consts::TAU;

use edgepuck_mesh::TriangleMesh;
use glam::{DVec3, dvec3};

use crate::random::Random;

/// A unit sphere of `20 * 4^level` triangles, all vertices on the sphere.
pub fn icosphere(level: u32) -> TriangleMesh {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for (i, j) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        vertices.extend([dvec3(i, j, 0.0), dvec3(0.0, i, j), dvec3(j, 0.0, i)]);
    }
    vertices.iter_mut().for_each(|v| *v = v.normalize());
    let mut mesh = TriangleMesh { triangles: hull_triangles(&vertices), vertices };
    for _ in 0..level {
        mesh = subdivided(&mesh);
    }
    mesh
}

/// The icosahedron's faces: triples of neighbours. Neighbours are 1.05 apart,
/// all others at least 1.7.
fn hull_triangles(vertices: &[DVec3]) -> Vec<[u32; 3]> {
    let near = |i: usize, j: usize| vertices[i].distance(vertices[j]) < 1.2;
    let n = vertices.len();
    let mut faces = Vec::new();
    for i in 0..n {
        for j in i + 1..n {
            faces.extend(
                (j + 1..n)
                    .filter(|&k| near(i, j) && near(j, k) && near(i, k))
                    .map(|k| [i as u32, j as u32, k as u32]),
            );
        }
    }
    faces
}

fn subdivided(mesh: &TriangleMesh) -> TriangleMesh {
    let mut vertices = mesh.vertices.clone();
    let mut middles = HashMap::new();
    let mut triangles = Vec::with_capacity(mesh.triangles.len() * 4);
    for &[a, b, c] in &mesh.triangles {
        let mut middle = |i: u32, j: u32| {
            *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                vertices.push((vertices[i as usize] + vertices[j as usize]).normalize());
                vertices.len() as u32 - 1
            })
        };
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    TriangleMesh { vertices, triangles }
}

/// A box of twelve triangles between two corners.
pub fn cuboid(low: DVec3, high: DVec3) -> TriangleMesh {
    let vertices = (0..8)
        .map(|i| {
            let pick =
                |bit: usize, axis: usize| if i >> bit & 1 == 1 { high[axis] } else { low[axis] };
            dvec3(pick(0, 0), pick(1, 1), pick(2, 2))
        })
        .collect();
    let quads =
        [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriangleMesh { vertices, triangles }
}

/// The cube from -1 to 1.
pub fn cube() -> TriangleMesh {
    cuboid(DVec3::NEG_ONE, DVec3::ONE)
}

/// The cube from -1 to 1, each face of `n` x `n` squares: boxes of its triangles
/// are flat and touch without overlap.
pub fn tiled_cube(n: u32) -> TriangleMesh {
    let at = |i: u32| f64::from(i) / f64::from(n) * 2.0 - 1.0;
    let mut mesh = TriangleMesh::default();
    for face in 0..6usize {
        let base = mesh.vertices.len() as u32;
        let side = if face < 3 { -1.0 } else { 1.0 };
        for i in 0..=n {
            for j in 0..=n {
                let mut v = [at(i), at(j), side];
                v.rotate_right(face % 3);
                mesh.vertices.push(DVec3::from_array(v));
            }
        }
        let id = |i: u32, j: u32| base + i * (n + 1) + j;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            mesh.triangles.push([id(i, j), id(i + 1, j), id(i + 1, j + 1)]);
            mesh.triangles.push([id(i, j), id(i + 1, j + 1), id(i, j + 1)]);
        }
    }
    mesh
}

/// A wavy torus about z, within 1.1 of the origin, of `2 n^2` triangles.
pub fn torus(n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..n {
        for j in 0..n {
            let (u, v) = (TAU * f64::from(i) / f64::from(n), TAU * f64::from(j) / f64::from(n));
            let tube = 0.3 * (1.0 + 0.1 * (7.0 * u).sin() * (5.0 * v).cos());
            let arm = 0.7 + tube * v.cos();
            mesh.vertices.push(dvec3(arm * u.cos(), arm * u.sin(), tube * v.sin()));
            let id = |i: u32, j: u32| i % n * n + j % n;
            mesh.triangles.push([id(i, j), id(i + 1, j), id(i + 1, j + 1)]);
            mesh.triangles.push([id(i, j), id(i + 1, j + 1), id(i, j + 1)]);
        }
    }
    mesh
}

/// `n` triangles in the cube from -1 to 1, their corners within `size` of each other.
pub fn soup(n: u32, size: f64) -> TriangleMesh {
    let mut random = Random::new("soup");
    let mut corners = |_| {
        let place = random.in_cube();
        [(); 3].map(|()| place + random.in_cube() * size)
    };
    unconnected((0..n).flat_map(&mut corners).collect())
}

/// Triangles of three vertices each, in their order.
pub fn unconnected(vertices: Vec<DVec3>) -> TriangleMesh {
    let n = vertices.len() as u32 / 3;
    TriangleMesh { vertices, triangles: (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect() }
}

/// The meshes side by side in one.
pub fn together(meshes: &[TriangleMesh]) -> TriangleMesh {
    let mut all = TriangleMesh::default();
    for mesh in meshes {
        let base = all.vertices.len() as u32;
        all.vertices.extend(&mesh.vertices);
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + base)));
    }
    all
}

/// The same surface with three vertices of its own for each triangle.
pub fn unmerged(mesh: &TriangleMesh) -> TriangleMesh {
    let corners = mesh.triangles.iter().flatten();
    unconnected(corners.map(|&v| mesh.vertices[v as usize]).collect())
}

/// The mesh with each vertex mapped.
pub fn mapped(mesh: &TriangleMesh, map: impl Fn(DVec3) -> DVec3) -> TriangleMesh {
    let vertices = mesh.vertices.iter().map(|&v| map(v)).collect();
    TriangleMesh { vertices, triangles: mesh.triangles.clone() }
}
