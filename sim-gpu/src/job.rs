//! What a caster is given and what it answers: the rays of one sensor against
//! one object, and the triangle that each hits.

use crate::ray::{RayFrame, TraceRay};
use crate::sensor::BeamPattern;
use crate::target::Target;
use formats::rng::StreamKey;

/// The rays of one sensor against one object.
#[derive(Clone, Debug)]
pub struct CastJob {
    /// The object.
    pub target: Target,
    /// How the sensor sees it.
    pub frame: RayFrame,
    /// The beam of each ray, `[n_rays]`.
    pub beams: Vec<u32>,
    /// The rays, `[n_rays]`; roots are relative to the target's tree.
    pub rays: Vec<TraceRay>,
    /// Keys the random numbers of this sensor and object.
    pub stream: StreamKey,
    /// The object's reflectivity, 0 to 1.
    pub reflectivity: f32,
}

/// Whether beams that cannot hit are cast. The answers are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Culling {
    /// Only beams that may hit the object's bounding sphere are cast.
    #[default]
    On,
    /// All beams are cast: for tests and measurements.
    Off,
}

impl CastJob {
    /// Aims the beams of `pattern` at `target` through `frame`.
    #[must_use]
    pub fn aim(
        target: Target,
        frame: RayFrame,
        pattern: &BeamPattern,
        culling: Culling,
        stream: StreamKey,
        reflectivity: f32,
    ) -> Self {
        let (beams, rays) = aim(&frame, pattern, culling, |_| true);
        Self { target, frame, beams, rays, stream, reflectivity }
    }
}

/// Those beams of `pattern` that `is_wanted`, and their rays through `frame`.
pub(crate) fn aim(
    frame: &RayFrame,
    pattern: &BeamPattern,
    culling: Culling,
    is_wanted: impl Fn(u32) -> bool,
) -> (Vec<u32>, Vec<TraceRay>) {
    let mut beams = match culling {
        Culling::On => pattern.within(&frame.cone(pattern)),
        Culling::Off => pattern.order.clone(),
    };
    beams.retain(|&beam| is_wanted(beam));
    frame.trace_rays(pattern, beams, culling == Culling::Off)
}

/// What a caster answers for one job.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cast {
    /// Per ray: triangle index, [`crate::ray::MISS`] or
    /// [`crate::ray::AMBIGUOUS`]; `[n_rays]`.
    pub codes: Vec<u32>,
    /// The effects' outputs, [`Effects::per_ray`](crate::effects::Effects::per_ray)
    /// side by side, of no meaning where the code is a miss;
    /// `[n_rays, outputs_per_ray]`.
    pub effect_outputs: Vec<f32>,
}
