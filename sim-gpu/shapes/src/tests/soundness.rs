use glam::{DVec3, IVec3};
use rayon::prelude::*;

use super::{SEED, ShapeClass, for_all, generate};
use crate::tessellation::bounds;
use edgepuck_mesh::TriangleMesh;

pub fn corners(mesh: &TriangleMesh, triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|i| mesh.vertices[i as usize])
}

#[test]
fn every_mesh_is_sound() {
    for_all(|class, k, mesh| {
        let what = format!("{class} {k}");
        assert_well_formed(mesh, &what);
        assert_every_vertex_used(mesh, &what);
        assert_stands_and_is_of_a_thing_s_size(mesh, &what);
        assert_eq!(pieces(mesh), 1, "{what} does not hang together");
    });
}

fn assert_well_formed(mesh: &TriangleMesh, what: &str) {
    let n = mesh.triangles.len();
    assert!((200..=50_000).contains(&n), "{what}: {n} triangles");
    assert!(mesh.vertices.iter().all(|v| v.is_finite()), "{what}");
    for &triangle in &mesh.triangles {
        let [a, b, c] = corners(mesh, triangle);
        assert!((b - a).cross(c - a).length() > 0.0, "{what}: {triangle:?} has no area");
    }
}

fn assert_every_vertex_used(mesh: &TriangleMesh, what: &str) {
    let mut used = vec![false; mesh.vertices.len()];
    mesh.triangles.as_flattened().iter().for_each(|&corner| used[corner as usize] = true);
    assert!(used.iter().all(|&used| used), "{what}");
}

fn assert_stands_and_is_of_a_thing_s_size(mesh: &TriangleMesh, what: &str) {
    let [low, high] = bounds(mesh);
    let size = high - low;
    assert_eq!(low.z, 0.0, "{what}");
    // The range is from an espresso cup to an airliner. The flattest shapes are screens for the
    // wall, 1.5 % as deep as wide, and flying wings.
    let longest = size.max_element();
    assert!((0.03..90.0).contains(&longest), "{what}: {size}");
    assert!(size.min_element() > 0.01 * longest, "{what}: {size}");
    let middle = (low + high).with_z(0.0) / 2.0;
    assert!(middle.length() < longest, "{what}: far from the origin, {middle}");
}

/// Whether an edge belongs to only one triangle. Vertices at one place count as one, and so do
/// doubled triangles.
fn is_open(mesh: &TriangleMesh) -> bool {
    let place = |v: DVec3| (v * 1e6).round().to_array().map(|c| c as i64);
    let sorted = |&triangle| {
        let mut places = corners(mesh, triangle).map(place);
        places.sort_unstable();
        places
    };
    let mut triangles: Vec<_> = mesh.triangles.iter().map(sorted).collect();
    triangles.sort_unstable();
    triangles.dedup();
    let edges = |[a, b, c]: [_; 3]| [[a, b], [b, c], [a, c]];
    let mut edges: Vec<_> = triangles.into_iter().flat_map(edges).collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).any(|same| same.len() == 1)
}

#[test]
fn many_vessels_and_shades_are_open_sheets() {
    use ShapeClass::{Bottle, Bowl, Cone, Cup, Lamp, Vase};
    for class in [Bottle, Bowl, Cone, Cup, Lamp, Vase] {
        let looked_at = 50;
        let open =
            (0..looked_at).into_par_iter().filter(|&k| is_open(&generate(class, SEED, k))).count();
        println!("{class}: {open} of {looked_at} are open");
        // At least a third of the walls are sheets: 17 expected, standard deviation 3.3.
        assert!(open >= 8, "{class}: only {open} of {looked_at} are open");
    }
}

/// The number of cells along the diagonal and along a side of the grid in [`pieces`]. A border of
/// empty cells makes checks for the end unnecessary.
const CELLS: f64 = 64.0;
const SIDE: i32 = 68;

/// The number of connected pieces of the surface if gaps of up to about 2 % of the diagonal are
/// closed: the connected sets of occupied cells, with neighbours at corners.
fn pieces(mesh: &TriangleMesh) -> usize {
    let [low, high] = bounds(mesh);
    let per_metre = CELLS / low.distance(high);
    let index = |p: DVec3| {
        let cell = ((p - low) * per_metre).as_ivec3() + IVec3::ONE;
        (cell.x + SIDE * (cell.y + SIDE * cell.z)) as usize
    };
    let mut occupied = vec![false; SIDE.pow(3) as usize];
    for &triangle in &mesh.triangles {
        let [a, b, c] = corners(mesh, triangle);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let n = (1.5 * longest * per_metre).ceil() as u32;
        let [u, v] = [b - a, c - a].map(|edge| edge / f64::from(n));
        for i in 0..=n {
            for j in 0..=n - i {
                occupied[index(a + f64::from(i) * u + f64::from(j) * v)] = true;
            }
        }
    }
    let mut pieces = 0;
    for start in 0..occupied.len() {
        if occupied[start] {
            pieces += 1;
            clear_connected(&mut occupied, start);
        }
    }
    pieces
}

/// Clears the cell `start` and all occupied cells that are connected to it.
fn clear_connected(occupied: &mut [bool], start: usize) {
    let mut border = vec![start];
    while let Some(at) = border.pop() {
        if std::mem::take(&mut occupied[at]) {
            let steps = [-1, 0, 1];
            let around = steps.map(|x| steps.map(|y| steps.map(|z| x + SIDE * (y + SIDE * z))));
            for step in around.as_flattened().as_flattened() {
                border.push(at.wrapping_add_signed(*step as isize));
            }
        }
    }
}
