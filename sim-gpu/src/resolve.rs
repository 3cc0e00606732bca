//! Turns a caster's codes into ranges, in f64.
//!
//! Casters find the triangle that a ray hits, or leave it to f64; this module computes where. Hits are
//! thus the same to the last bit on every adapter, and accurate at grazing incidence too.

use crate::cpu::effects::append_outputs;
use crate::cpu::oracle::{self, Crossing};
use crate::effects::Effects;
use crate::job::{Cast, CastJob};
use crate::lanes::{LANES, Lanewise, each, widest};
use crate::ray::{AMBIGUOUS, MISS};
use crate::sensor::BeamPattern;
use fearless_simd::Simd;

/// The nearest surface along a ray.
#[derive(Clone, Debug, PartialEq)]
pub struct Hit {
    /// The ray, as an index into its pattern.
    pub beam: u32,
    /// The triangle, as an index into its mesh.
    pub triangle: u32,
    /// The distance from the start of the ray, metres, before any effect.
    pub range_m: f64,
}

/// The hits of one job, and the outputs of effects for each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hits {
    /// The hits, ascending by ray.
    pub hits: Vec<Hit>,
    /// The effects' outputs, as in [`Cast`]; `[n_hits, outputs_per_ray]`.
    pub effect_outputs: Vec<f32>,
    /// The number of rays for which f32 could not decide between surfaces.
    pub decided_in_f64: usize,
}

/// Computes the ranges of `job`'s hits and sorts them by ray.
#[must_use]
pub fn resolve(job: &CastJob, cast: &Cast, pattern: &BeamPattern, effects: &Effects) -> Hits {
    let per_ray = effects.outputs_per_ray();
    let order = by_beam(job, cast, pattern.len());
    let ranges_m = widest(Ranges { job, cast, pattern, rays: &order });
    let mut resolved = Hits { hits: Vec::with_capacity(order.len()), ..Hits::default() };
    for (ray, range_m) in order.into_iter().zip(ranges_m) {
        let (beam, code) = (job.beams[ray as usize], cast.codes[ray as usize]);
        let triangle = code & !AMBIGUOUS;
        if code & AMBIGUOUS != 0 {
            resolved.decided_in_f64 += 1;
            let ray = job.beam(pattern, beam);
            let Some(Crossing { index, .. }) = oracle::nearest(&job.target, &ray) else { continue };
            if index != triangle {
                // By the same formula as for all other hits.
                let Some(range_m) = oracle::range_to(&job.target, &ray, index) else { continue };
                resolved.hits.push(Hit { beam, triangle: index, range_m });
                append_outputs(&mut resolved.effect_outputs, effects, job, beam, &ray, index);
                continue;
            }
        }
        if range_m.is_nan() {
            continue;
        }
        resolved.hits.push(Hit { beam, triangle, range_m });
        let from = ray as usize * per_ray;
        resolved.effect_outputs.extend(&cast.effect_outputs[from..from + per_ray]);
    }
    resolved
}

/// Computes the range from each of these rays to the triangle that its code names; NaN if that
/// lies behind the sensor.
struct Ranges<'a> {
    job: &'a CastJob,
    cast: &'a Cast,
    pattern: &'a BeamPattern,
    rays: &'a [u32],
}

impl Lanewise for Ranges<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Vec<f64> {
        let mut ranges_m = Vec::with_capacity(self.rays.len());
        for rays in self.rays.chunks(LANES) {
            let of_lane: [u32; LANES] = each(|lane| rays[lane.min(rays.len() - 1)]);
            let triangles: [u32; LANES] =
                each(|i| self.cast.codes[of_lane[i] as usize] & !AMBIGUOUS);
            let beams: [u32; LANES] = each(|i| self.job.beams[of_lane[i] as usize]);
            let of_beam = self.job.rays_of(self.pattern, beams);
            let found = oracle::ranges_to(&self.job.target.surface, &of_beam, triangles);
            ranges_m.extend(&found[..rays.len()]);
        }
        ranges_m
    }
}

/// A job is sparse if it casts less than one in this many of the pattern's beams.
const SPARSE: usize = 16;

/// The rays of `job` that hit anything, by beam. Each beam has at most one ray.
fn by_beam(job: &CastJob, cast: &Cast, n_beams: usize) -> Vec<u32> {
    let hits =
        || (0..).zip(job.beams.iter().zip(&cast.codes)).filter(|(_, (_, code))| **code != MISS);
    // For a sparse job, sorting its hits is faster than a table of all beams.
    if job.beams.len() < n_beams / SPARSE {
        let mut hits: Vec<(u32, u32)> = hits().map(|(ray, (&beam, _))| (beam, ray)).collect();
        hits.sort_unstable();
        return hits.into_iter().map(|(_, ray)| ray).collect();
    }
    let mut ray_of = vec![u32::MAX; n_beams];
    for (ray, (&beam, _)) in hits() {
        ray_of[beam as usize] = ray;
    }
    ray_of.retain(|&ray| ray != u32::MAX);
    ray_of
}
