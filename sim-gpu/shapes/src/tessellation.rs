//! Finds the fineness at which a shape has the triangles wanted.

use glam::DVec3;

use super::finish::{Finish, MIN_TRIANGLES};
use crate::primitives::Builder;
use sim_gpu::mesh::Mesh;
use sim_gpu::mesh::unit_frame::bounding_box;

/// Trials before the best mesh so far is good enough.
const MAX_TRIALS: usize = 10;
/// A mesh this close below its target is good enough.
const CLOSE_ENOUGH: f64 = 0.93;
/// Finer by this much each time while a mesh has too few triangles.
const REFINEMENT: f64 = 0.85;

/// Runs `build` at several finenesses; gives the mesh that comes nearest to
/// the finish's target from below, or the coarsest if none is below.
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
        // Triangles go with the square of the edge; overshoot a little less.
        let step = (n / (0.98 * target)).sqrt();
        edge_m *= step.clamp(0.25, 4.0);
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

/// The box of the vertices: its lowest and highest corner.
pub fn bounds(mesh: &Mesh) -> [DVec3; 2] {
    bounding_box(mesh.vertices.iter().copied()).into()
}
