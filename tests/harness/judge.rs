//! Holds a caster's hits to the f64 oracle, ray by ray.
//!
//! The promise: a range within [`RANGE_TOLERANCE`] wherever the beam meets the
//! surface at more than [`GRAZING_RAD`]; hit or miss alike unless a silhouette
//! lies within [`SILHOUETTE_RAD`] of the beam.

use std::fmt;

use glam::DVec3;
use rayon::prelude::*;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::cpu::oracle::{self, Crossing};
use sim_gpu::internals::job::CastJob;
use sim_gpu::internals::ray::Ray;
use sim_gpu::internals::resolve::{Hit, Hits};
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::target::Target;

use crate::casting::hits;

/// Relative error allowed of a range.
pub const RANGE_TOLERANCE: f64 = 1e-6;
/// Beams closer than this to the surface's plane may be less accurate.
pub const GRAZING_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;
/// Beams closer than this to a silhouette may see what lies on its other side.
pub const SILHOUETTE_RAD: f64 = 1e-6;

/// The most of a mesh's hits that a caster may leave to f64, of meshes whose
/// surfaces do not lie upon one another.
///
/// A caster marks a ray that passes an edge by less than its own rounding,
/// `DISPLACEMENT`, which is 56 * 2^-24 of a unit length: of triangles whose sides
/// are a fiftieth of the object, whose perimeter is 350 times their area, that is
/// 350 * 3.3e-6, a thousandth of all hits. This allows twenty times as much, for
/// triangles that are seen from the side.
pub const MOST_AMBIGUOUS: f64 = 0.02;

/// How a caster's hits compare with the oracle's.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// Rays that the caster left to f64.
    pub decided_in_f64: usize,
    /// Hits of the oracle.
    pub hits: usize,
    /// Largest relative error of a range on the same surface, not grazing.
    pub worst: f64,
    /// Beams that differ, all within [`SILHOUETTE_RAD`] of a silhouette.
    pub at_silhouettes: usize,
    /// What breaks the promise, in words.
    pub broken: Vec<String>,
}

/// Whether a caster left more than the share `most` of `hits` to f64, and more
/// than one. A caster that marks every ray would keep every promise.
pub fn leaves_too_much(hits: &Hits, most: f64) -> bool {
    hits.decided_in_f64 as f64 > (most * hits.hits.len() as f64).max(1.0)
}

/// Compares `hits` with the oracle on all beams of `pattern`, cast or not.
pub fn judge(job: &CastJob, pattern: &BeamPattern, hits: &Hits) -> Verdict {
    let mut found = vec![None; pattern.len()];
    for hit in &hits.hits {
        found[hit.beam as usize] = Some(hit);
    }
    let verdict = found
        .par_iter()
        .enumerate()
        .map(|(beam, hit)| {
            let ray = job.frame.beam(pattern, beam as u32);
            let mut verdict = judge_beam(&job.target, &ray, *hit);
            verdict.broken.iter_mut().for_each(|broken| *broken = format!("beam {beam}: {broken}"));
            verdict
        })
        .reduce(Verdict::default, Verdict::and);
    Verdict { decided_in_f64: hits.decided_in_f64, ..verdict }
}

/// Asserts the promise, and that at most the share `most_ambiguous` of hits is left to f64.
pub fn assert_promise(
    caster: &OpenCaster,
    job: &CastJob,
    pattern: &BeamPattern,
    most_ambiguous: f64,
    what: &str,
) -> Verdict {
    let hits = hits(caster, job, pattern);
    let verdict = judge(job, pattern, &hits);
    let what = format!("{what} on {}", caster.name());
    verdict.assert_kept(&what);
    let (decided, n) = (hits.decided_in_f64, hits.hits.len());
    assert!(!leaves_too_much(&hits, most_ambiguous), "{what}: {decided} of {n} in f64");
    verdict
}

fn judge_beam(target: &Target, ray: &Ray, found: Option<&Hit>) -> Verdict {
    let truth = oracle::nearest(target, ray);
    let mut verdict = Verdict { hits: truth.iter().count(), ..Verdict::default() };
    let differs = match (truth, found) {
        (None, None) => return verdict,
        (Some(truth), Some(found)) => {
            let error = (truth.range_m - found.range_m).abs();
            let relative = if error == 0.0 { 0.0 } else { error / truth.range_m };
            if relative <= RANGE_TOLERANCE || incidence_rad(target, ray, truth.index) < GRAZING_RAD
            {
                verdict.worst = if relative <= RANGE_TOLERANCE { relative } else { 0.0 };
                return verdict;
            }
            format!("{truth:?} found as {found:?}, relative error {relative:.2e}")
        }
        _ => format!("{truth:?} found as {found:?}"),
    };
    if near_silhouette(target, ray, truth) {
        verdict.at_silhouettes = 1;
    } else {
        verdict.broken.push(differs);
    }
    verdict
}

/// The angle between the beam and the triangle's plane.
pub fn incidence_rad(target: &Target, ray: &Ray, triangle: u32) -> f64 {
    oracle::normal(target, triangle).dot(ray.direction.normalize()).abs().min(1.0).asin()
}

/// Whether the surface breaks off, or another comes before it, within
/// [`SILHOUETTE_RAD`] of the beam: one of eight beams around it jumps.
pub fn near_silhouette(target: &Target, ray: &Ray, truth: Option<Crossing>) -> bool {
    around(ray, SILHOUETTE_RAD).any(|beside| jumps(target, ray, truth, &beside))
}

/// Whether the oracle sees another triangle, or none, within `angle_rad`.
pub fn near_edge(target: &Target, ray: &Ray, angle_rad: f64) -> bool {
    let index = |ray: &Ray| oracle::nearest(target, ray).map(|crossing| crossing.index);
    let own = index(ray);
    around(ray, angle_rad).any(|beside| index(&beside) != own)
}

fn around(ray: &Ray, angle_rad: f64) -> impl Iterator<Item = Ray> {
    let ray = *ray;
    let length = ray.direction.length();
    let (across, up): (DVec3, DVec3) = (ray.direction / length).any_orthonormal_pair();
    (0..8).map(move |eighth| {
        let (sine, cosine) = (f64::from(eighth) * std::f64::consts::FRAC_PI_4).sin_cos();
        let aside = (across * cosine + up * sine) * (angle_rad * length);
        Ray { origin: ray.origin, direction: ray.direction + aside }
    })
}

/// On one surface, a turn by an angle changes a range by at most that angle
/// times the tangent of the steeper of both slopes; twice that is a jump.
fn jumps(target: &Target, ray: &Ray, truth: Option<Crossing>, beside: &Ray) -> bool {
    match (truth, oracle::nearest(target, beside)) {
        (None, None) => false,
        (Some(here), Some(there)) => {
            let slope = |r: &Ray, c: Crossing| incidence_rad(target, r, c.index).tan().recip();
            let steepest = slope(ray, here).max(slope(beside, there));
            let change = (here.range_m - there.range_m).abs();
            change > 2.0 * SILHOUETTE_RAD * here.range_m.max(there.range_m) * (1.0 + steepest)
        }
        _ => true,
    }
}

impl Verdict {
    /// Both together.
    pub fn and(mut self, mut other: Self) -> Self {
        self.decided_in_f64 += other.decided_in_f64;
        self.hits += other.hits;
        self.worst = self.worst.max(other.worst);
        self.at_silhouettes += other.at_silhouettes;
        self.broken.append(&mut other.broken);
        self
    }

    /// Asserts that the promise holds.
    pub fn assert_kept(&self, what: &str) {
        let first: Vec<_> = self.broken.iter().take(5).map(String::as_str).collect();
        assert!(first.is_empty(), "{what}: {} beams:\n{}", self.broken.len(), first.join("\n"));
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} hits, {} decided in f64, worst range error {:.1e}, {} differ at \
             silhouettes, {} broken",
            self.hits,
            self.decided_in_f64,
            self.worst,
            self.at_silhouettes,
            self.broken.len()
        )
    }
}
