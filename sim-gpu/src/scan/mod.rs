//! Scans of objects.
//!
//! [`scan()`] scans one object, and [`scan_objects`] several objects at once. Both aim the sensor's
//! beams ([`ScanRequest::aim`]), cast them ([`OpenCaster::cast`]), solve the ranges ([`resolve`])
//! and make points of them ([`assemble`]).

mod assemble;
mod beam_returns;
mod echo;
mod hit_effects;
mod measure;
mod normals;
mod object_hits;
mod power;
mod receiver;
mod request;

pub use assemble::assemble;
pub use beam_returns::{BeamReturn, each_return};
pub use object_hits::{ObjectHits, Tally};
pub use request::{Glass, PlacedTarget, ScanRequest};

use crate::cast_error::CastError;
use crate::caster::OpenCaster;
use crate::config::InvalidValue;
use crate::cpu;
use crate::effects::Effects;
use crate::job::{Cast, CastJob};
use crate::resolve::{Hits, resolve};
use crate::target::Target;
use formats::Scan;
use rayon::prelude::*;

/// A scan failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScanError {
    /// The request asks for what its sensor or its caster does not have.
    #[error(transparent)]
    Request(#[from] InvalidValue),
    /// The adapter failed.
    #[error(transparent)]
    Cast(#[from] CastError),
}

/// A scan, with its hits and counts.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Scanned {
    /// The points.
    pub scan: Scan,
    /// Counts of the returns by their fate.
    pub tally: Tally,
    /// The hits of the beams before any effect, by object. If the CPU casts at several objects,
    /// beams that end on a nearer object may be missing. The CPU gives no outputs of effects: it
    /// computes them only for hits that become points.
    pub hits: Vec<Hits>,
    /// Whether the CPU cast because an object was too large for the adapter.
    pub cast_on_cpu: bool,
}

/// The scan of `target` that `request` asks for. `target` stands where its mesh says.
pub fn scan(
    caster: &OpenCaster,
    target: &Target,
    request: &ScanRequest,
) -> Result<Scan, ScanError> {
    Ok(scan_objects(caster, &[PlacedTarget::new(target)], request)?.scan)
}

/// The scan that `request` asks for of several objects: each beam returns from the nearest one.
pub fn scan_objects(
    caster: &OpenCaster,
    objects: &[PlacedTarget<'_>],
    request: &ScanRequest<'_>,
) -> Result<Scanned, ScanError> {
    pollster::block_on(scan_objects_async(caster, objects, request))
}

/// As [`scan_objects`], in a browser too, where nothing may wait for an adapter.
pub async fn scan_objects_async(
    caster: &OpenCaster,
    objects: &[PlacedTarget<'_>],
    request: &ScanRequest<'_>,
) -> Result<Scanned, ScanError> {
    let request = &request.in_motion(caster.effects());
    let fits = objects.iter().all(|object| caster.fits(object.target));
    if !fits || matches!(caster, OpenCaster::Cpu(_)) {
        let (jobs, hits) = cast_nearest_first(objects, request);
        return finish(caster, objects, request, &jobs, hits, !fits);
    }
    let jobs = aimed(objects, request);
    let casts = caster.cast_async(&jobs).await?;
    let hits = resolved(&jobs, &casts, request, caster.effects());
    finish(caster, objects, request, &jobs, hits, false)
}

/// Gives `each` return of the scan that `request` asks for, as [`each_return`]. The CPU casts.
pub fn cast_returns(
    effects: &Effects,
    objects: &[PlacedTarget],
    request: &ScanRequest,
    each: impl FnMut(BeamReturn),
) -> Result<(), ScanError> {
    let request = &request.in_motion(effects);
    let (jobs, hits) = cast_nearest_first(objects, request);
    Ok(each_return(request, effects, &hits_of(objects, &jobs, &hits), each)?)
}

/// The rays of the scan that `request` asks for, for an adapter with these effects.
#[must_use]
pub fn aim_all(objects: &[PlacedTarget], request: &ScanRequest, effects: &Effects) -> Vec<CastJob> {
    aimed(objects, &request.in_motion(effects))
}

/// As [`cast_returns`], from the answers of an adapter to the jobs of [`aim_all`].
pub fn resolve_returns(
    effects: &Effects,
    objects: &[PlacedTarget],
    request: &ScanRequest,
    (jobs, casts): (&[CastJob], &[Cast]),
    each: impl FnMut(BeamReturn),
) -> Result<(), ScanError> {
    let request = &request.in_motion(effects);
    let hits = resolved(jobs, casts, request, effects);
    Ok(each_return(request, effects, &hits_of(objects, jobs, &hits), each)?)
}

fn aimed(objects: &[PlacedTarget], request: &ScanRequest) -> Vec<CastJob> {
    objects.par_iter().map(|object| request.aim(object)).collect()
}

fn resolved(
    jobs: &[CastJob],
    casts: &[Cast],
    request: &ScanRequest,
    effects: &Effects,
) -> Vec<Hits> {
    let answered = jobs.par_iter().zip(casts);
    answered.map(|(job, cast)| resolve(job, cast, request.pattern, effects)).collect()
}

/// Casts on the CPU at the nearest object first, so that a beam that ends there is not cast at
/// objects behind.
fn cast_nearest_first(
    objects: &[PlacedTarget],
    request: &ScanRequest,
) -> (Vec<CastJob>, Vec<Hits>) {
    let nearest_m = |object: &PlacedTarget| request.nearest_m(object);
    let distances_m: Vec<f64> = objects.iter().map(nearest_m).collect();
    let mut order: Vec<usize> = (0..objects.len()).collect();
    order.sort_by(|&a, &b| distances_m[a].total_cmp(&distances_m[b]));

    let mut ends_m = vec![f64::INFINITY; request.pattern.len()];
    let mut cast: Vec<Option<(CastJob, Hits)>> = vec![None; objects.len()];
    for i in order {
        let job = request.aim_where(&objects[i], |beam| ends_m[beam as usize] >= distances_m[i]);
        let codes = cpu::trace::trace(&job.target.bvh.wide, job.rays());
        let answers = Cast { codes, effect_outputs: vec![] };
        // Effects are computed later, for the hits that become points.
        let hits = resolve(&job, &answers, request.pattern, &Effects::default());
        for hit in &hits.hits {
            let end_m = &mut ends_m[hit.beam as usize];
            *end_m = end_m.min(hit.range_m);
        }
        cast[i] = Some((job, hits));
    }
    cast.into_iter().flatten().unzip()
}

fn finish(
    caster: &OpenCaster,
    objects: &[PlacedTarget],
    request: &ScanRequest,
    jobs: &[CastJob],
    hits: Vec<Hits>,
    cast_on_cpu: bool,
) -> Result<Scanned, ScanError> {
    let found = hits_of(objects, jobs, &hits);
    let (scan, tally) = assemble(request, caster.effects(), &found)?;
    Ok(Scanned { scan, tally, hits, cast_on_cpu })
}

fn hits_of<'a>(
    objects: &'a [PlacedTarget<'a>],
    jobs: &'a [CastJob],
    hits: &'a [Hits],
) -> Vec<ObjectHits<'a>> {
    let numbered = (0..).zip(objects).zip(jobs.iter().zip(hits));
    numbered
        .map(|((object, placed), (job, hits))| ObjectHits::new(object, placed, job, hits))
        .collect()
}
