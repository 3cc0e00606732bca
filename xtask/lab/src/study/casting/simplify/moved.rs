//! Where the points of a simplified scan lie, and how its ranges differ.

use crate::measure::ray_set::RaySet;
use rayon::prelude::*;
use serde::Serialize;
use sim_gpu::internals::cpu::oracle;
use sim_gpu::internals::ray::Ray;
use sim_gpu::internals::simplify::distance_to_surface;

/// Errors over all rays of some ray_sets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Moved {
    /// Rays that hit the simplified mesh.
    pub hits: usize,
    /// Farthest that a point of the simplified scan lies from the mesh as it
    /// is, metres.
    pub farthest_m: f64,
    /// Median of the range errors of rays that hit both, metres.
    pub median_m: f64,
    /// Their 99th percentile.
    pub most_m: f64,
    /// Rays whose range error is within the bound over the cosine of the
    /// incidence on the mesh as it is.
    pub within_oblique: usize,
    /// Rays that hit one of both meshes alone.
    pub hit_by_one: usize,
}

/// What one ray showed.
#[derive(Default)]
struct Seen {
    hits: bool,
    distance_m: f64,
    /// Range error, and the cosine of the incidence.
    error: Option<(f64, f64)>,
    hit_by_one: bool,
}

impl Moved {
    /// Of the same rays against a mesh as it is and simplified.
    pub fn of([whole, fewer]: &[Vec<RaySet>; 2], bound_m: f64) -> Self {
        let pairs = whole.iter().zip(fewer);
        let seen: Vec<Seen> = pairs
            .flat_map(|(whole, fewer)| {
                let rays = whole.rays.par_iter().zip(&fewer.rays);
                rays.map(|(p, q)| one(whole, fewer, p, q)).collect::<Vec<_>>()
            })
            .collect();
        let mut errors: Vec<f64> = seen.iter().filter_map(|s| Some(s.error?.0)).collect();
        errors.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| {
            errors.get((share * errors.len() as f64) as usize).copied().unwrap_or_default()
        };
        let within = |s: &&Seen| s.error.is_some_and(|(error, cosine)| error * cosine <= bound_m);
        Self {
            hits: seen.iter().filter(|s| s.hits).count(),
            farthest_m: seen.iter().map(|s| s.distance_m).fold(0.0, f64::max),
            median_m: at(0.5),
            most_m: at(0.99),
            within_oblique: seen.iter().filter(within).count(),
            hit_by_one: seen.iter().filter(|s| s.hit_by_one).count(),
        }
    }
}

/// The ray as `whole` sees it is `of_whole`, as `fewer` sees it `of_fewer`.
fn one(whole: &RaySet, fewer: &RaySet, of_whole: &Ray, of_fewer: &Ray) -> Seen {
    let whole = &whole.job.target;
    let truth = oracle::nearest(whole, of_whole);
    let Some(found) = oracle::nearest(&fewer.job.target, of_fewer) else {
        return Seen { hit_by_one: truth.is_some(), ..Seen::default() };
    };
    let point = of_whole.origin + of_whole.direction * found.range_m;
    let distance_m = distance_to_surface(whole, point) * whole.surface.frame.scale;
    let error = truth.map(|truth| {
        let cosine = oracle::normal(whole, truth.index).dot(of_whole.direction.normalize()).abs();
        ((found.range_m - truth.range_m).abs(), cosine)
    });
    Seen { hits: true, distance_m, error, hit_by_one: truth.is_none() }
}
