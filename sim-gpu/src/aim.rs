//! Selects the beams of a job and aims them. Rays are computed here in f64, or by the caster.

use crate::fixed_frame::FixedFrame;
use crate::ray::{RayFrame, TraceRay};
use crate::sensor::{BeamPattern, Directions};
use std::sync::OnceLock;

/// The source of the rays of a job.
#[derive(Clone, Debug)]
pub enum Aim {
    /// Casters compute them: GPUs in the shader, the CPU in f64.
    ByCaster {
        /// The frame of the sensor and the object, for the shader.
        fixed: FixedFrame,
        /// The directions of all beams of the pattern.
        directions: Directions,
        /// The rays of the CPU, once it needs them.
        rays: OnceLock<Vec<TraceRay>>,
    },
    /// The rays, `[n_rays]`; roots are relative to the target's tree.
    Rays(Vec<TraceRay>),
}

/// The most directions that a GPU holds at once: 48 MiB of the 128 MiB that every adapter can bind.
pub(crate) const MOST_DIRECTIONS: usize = 1 << 22;

/// Whether beams that cannot hit the object are cast. The scan is the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Culling {
    /// Only beams that may hit the object's bounding sphere are cast.
    #[default]
    On,
    /// All beams are cast: for tests and measurements.
    Off,
}

/// The wanted beams of `pattern`, without those that cannot hit the object, and their rays.
pub(crate) fn aim(
    frame: &RayFrame,
    pattern: &BeamPattern,
    culling: Culling,
    is_wanted: impl Fn(u32) -> bool,
) -> (Vec<u32>, Aim) {
    let mut beams = match culling {
        Culling::On => pattern.within(&frame.cone(pattern)),
        Culling::Off => pattern.order.clone(),
    };
    beams.retain(|&beam| is_wanted(beam));
    // The integer arithmetic of casters has no room for starts beside the sensor.
    let is_simple = pattern.starts_m.is_empty() && pattern.len() <= MOST_DIRECTIONS;
    if let Some(fixed) = frame.fixed().filter(|_| is_simple) {
        let directions = pattern.directions.clone();
        return (beams, Aim::ByCaster { fixed, directions, rays: OnceLock::new() });
    }
    let all = culling == Culling::Off;
    let (beams, rays) = frame.trace_rays(&pattern.directions, &pattern.starts_m, beams, all);
    (beams, Aim::Rays(rays))
}
