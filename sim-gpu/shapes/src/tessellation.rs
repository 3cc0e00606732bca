//! Finds the edge length at which a shape has the wanted number of triangles.

use glam::DVec3;

use super::finish::{Finish, MIN_TRIANGLES};
use crate::primitives::Builder;
use edgepuck_mesh::TriangleMesh;
use edgepuck_mesh::unit_frame::bounding_box;

const MAX_TRIALS: usize = 10;
/// A mesh with this fraction of the wanted triangles is good enough.
const CLOSE_ENOUGH: f64 = 0.93;
/// The factor of the edge length after each mesh with too few triangles.
const REFINEMENT: f64 = 0.85;

/// Runs `build` at several edge lengths. Returns the mesh with the most triangles up to the target
/// of `finish`, or the coarsest mesh if all have more.
pub fn fit(finish: &Finish, build: impl Fn(&mut Builder)) -> Builder {
    let at = |edge_m: f64| {
        let mut builder = Builder::new(edge_m, finish.flat_ratio);
        build(&mut builder);
        builder
    };
    let target = finish.target_triangles as f64;
    let mut best = at(f64::INFINITY);
    let [low, high] = bounds(best.mesh());
    let mut edge_m = low.distance(high) / 10.0;
    for _ in 0..MAX_TRIALS {
        if best.n_triangles() as f64 >= CLOSE_ENOUGH * target {
            break;
        }
        let trial = at(edge_m);
        let n = trial.n_triangles() as f64;
        // The number of triangles grows with the inverse square of the edge. Aim a little below the
        // target.
        edge_m *= (n / (0.98 * target)).sqrt().clamp(0.25, 4.0);
        if n <= target && trial.n_triangles() > best.n_triangles() {
            best = trial;
        }
    }
    while best.n_triangles() < MIN_TRIANGLES {
        edge_m *= REFINEMENT;
        best = at(edge_m);
    }
    best
}

/// The lowest and the highest corner of the bounding box.
pub fn bounds(mesh: &TriangleMesh) -> [DVec3; 2] {
    bounding_box(mesh.vertices.iter().copied()).into()
}
