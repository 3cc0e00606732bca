//! From a caster's codes to ranges, in f64.
//!
//! A caster finds which triangle a ray hits; this solves where. So ranges are
//! the same to the last bit on every adapter that finds the same triangle,
//! and as accurate near grazing as elsewhere.

use crate::cpu::effects::append_outputs;
use crate::cpu::oracle;
use crate::effects::Effects;
use crate::job::{Cast, CastJob};
use crate::ray::{AMBIGUOUS, MISS};
use crate::sensor::BeamPattern;

/// One beam's nearest surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Hit {
    /// The beam, as an index into its pattern.
    pub beam: u32,
    /// The triangle, as an index into its mesh.
    pub triangle: u32,
    /// Distance from where the beam starts, metres, without any effect.
    pub range_m: f64,
}

/// The hits of one job and what the effects say of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hits {
    /// By beam, ascending.
    pub hits: Vec<Hit>,
    /// The effects' outputs, as in [`Cast`]; `[n_hits, outputs_per_ray]`.
    pub effect_outputs: Vec<f32>,
    /// Rays for which f32 left more than one surface in question.
    pub decided_in_f64: usize,
}

/// Solves the ranges of `job`'s hits and puts them in the order of beams.
#[must_use]
pub fn resolve(job: &CastJob, cast: &Cast, pattern: &BeamPattern, effects: &Effects) -> Hits {
    let per_ray = effects.outputs_per_ray();
    let mut order: Vec<usize> = (0..cast.codes.len()).filter(|&i| cast.codes[i] != MISS).collect();
    order.sort_unstable_by_key(|&i| job.beams[i]);
    let mut resolved = Hits { hits: Vec::with_capacity(order.len()), ..Hits::default() };
    for i in order {
        let beam = job.beams[i];
        let ray = job.frame.beam(pattern, beam);
        let found = cast.codes[i] & !AMBIGUOUS;
        let mut triangle = found;
        if cast.codes[i] & AMBIGUOUS != 0 {
            resolved.decided_in_f64 += 1;
            let Some(nearest) = oracle::nearest(&job.target, &ray) else { continue };
            triangle = nearest.index;
        }
        // By the same formula whoever found the triangle.
        let Some(range_m) = oracle::range_to(&job.target, &ray, triangle) else { continue };
        resolved.hits.push(Hit { beam, triangle, range_m });
        if triangle == found {
            let of_ray = &cast.effect_outputs[i * per_ray..(i + 1) * per_ray];
            resolved.effect_outputs.extend(of_ray);
        } else {
            append_outputs(&mut resolved.effect_outputs, effects, job, beam, &ray, triangle);
        }
    }
    resolved
}
