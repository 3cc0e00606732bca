//! What a caster is given and what it answers: the rays of one sensor against
//! one object, and the triangle that each hits.

use crate::cpu::aim::FixedFrame;
use crate::lanes::{Vectors, each};
use crate::motion::Motion;
use crate::ray::{Ray, RayFrame, Rays, TraceRay};
use crate::sensor::{BeamPattern, Directions};
use crate::target::Target;
use formats::rng::StreamKey;
use std::sync::OnceLock;

/// The rays of one sensor against one object.
#[derive(Clone, Debug)]
pub struct CastJob {
    /// The object.
    pub target: Target,
    /// How the sensor sees it.
    pub frame: RayFrame,
    /// How they move, if they do.
    pub motion: Option<Motion>,
    /// The beam of each ray, `[n_rays]`.
    pub beams: Vec<u32>,
    /// Where the rays come from.
    pub aim: Aim,
    /// Keys the random numbers of this sensor and object.
    pub stream: StreamKey,
    /// The object's reflectivity, 0 to 1.
    pub reflectivity: f32,
}

/// Where the rays of a job come from.
#[derive(Clone, Debug)]
pub enum Aim {
    /// Each caster makes them: a GPU in its shader, the CPU in f64.
    ByCaster {
        /// How the sensor sees the object, for the shader.
        fixed: FixedFrame,
        /// The directions of all beams of the pattern.
        directions: Directions,
        /// The rays as the CPU makes them, once it has to.
        rays: OnceLock<Vec<TraceRay>>,
    },
    /// They are here, `[n_rays]`; roots are relative to the target's tree.
    Rays(Vec<TraceRay>),
}

/// The most beams of a pattern whose directions a GPU is given: 48 MiB of them, of the
/// 128 MiB that every adapter can bind.
pub(crate) const MOST_DIRECTIONS: usize = 1 << 22;

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
        let (beams, aim) = aim(&frame, pattern, culling, |_| true);
        Self { target, frame, motion: None, beams, aim, stream, reflectivity }
    }

    /// The ray of `pattern`'s beam of this number, when it fires.
    #[must_use]
    pub fn beam(&self, pattern: &BeamPattern, beam: u32) -> Ray {
        self.motion.as_ref().map_or_else(
            || self.frame.beam(pattern, beam),
            |motion| {
                let time_s = pattern.time_s[beam as usize];
                motion.frame_at(&self.target.surface, time_s).beam(pattern, beam)
            },
        )
    }

    /// The rays of some of `pattern`'s beams.
    #[inline(always)]
    pub(crate) fn rays_of<const N: usize>(
        &self,
        pattern: &BeamPattern,
        beams: [u32; N],
    ) -> Rays<N> {
        if self.motion.is_none() {
            return self.frame.beams(pattern, beams);
        }
        let rays = beams.map(|beam| self.beam(pattern, beam));
        Rays {
            origin: Vectors::new(each(|lane| rays[lane].origin)),
            direction: Vectors::new(each(|lane| rays[lane].direction)),
        }
    }

    /// The rays in f64, rounded, `[n_rays]`; made now, unless they are there.
    #[must_use]
    pub fn rays(&self) -> &[TraceRay] {
        match &self.aim {
            Aim::Rays(rays) => rays,
            Aim::ByCaster { directions, rays, .. } => rays
                .get_or_init(|| self.frame.trace_rays(directions, &[], self.beams.clone(), true).1),
        }
    }
}

/// Those beams of `pattern` that `is_wanted`, and how they are aimed through `frame`.
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
    // A beam that starts beside the sensor is for f64 to aim.
    let is_simple = pattern.starts_m.is_empty() && pattern.len() <= MOST_DIRECTIONS;
    if let Some(fixed) = frame.fixed().filter(|_| is_simple) {
        let directions = pattern.directions.clone();
        return (beams, Aim::ByCaster { fixed, directions, rays: OnceLock::new() });
    }
    let all = culling == Culling::Off;
    let (beams, rays) = frame.trace_rays(&pattern.directions, &pattern.starts_m, beams, all);
    (beams, Aim::Rays(rays))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Builder;
    use crate::mesh::Mesh;
    use crate::pose::Pose;
    use crate::sensor::Sensor;
    use crate::target::Surface;
    use glam::{DAffine3, DVec3};

    #[test]
    fn casters_make_the_rays_where_whole_numbers_are_exact_enough() {
        let vertices = vec![DVec3::X, DVec3::Y, DVec3::Z];
        let surface = Surface::new(Mesh { vertices, triangles: vec![[0, 1, 2]] }, vec![0]);
        let target = Target::new(surface, Builder::Sah);
        let pattern = Sensor::builtin("generic-static").unwrap().pattern();
        let mut beside = pattern.clone();
        beside.starts_m = vec![DVec3::Z * 0.01; beside.len()];
        let stretched = DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0));
        for (placed, distance_m, pattern, is_made) in [
            (DAffine3::IDENTITY, 3.0, &pattern, true),
            (DAffine3::from_scale(DVec3::splat(1000.0)), 3.0, &pattern, true),
            // The unit length is 0.5 m.
            (DAffine3::IDENTITY, 63.0, &pattern, true),
            (DAffine3::IDENTITY, 65.0, &pattern, false),
            (stretched, 3.0, &pattern, false),
            (DAffine3::IDENTITY, 3.0, &beside, false),
        ] {
            let pose = Pose::look_at(DVec3::X * distance_m, DVec3::ZERO).unwrap();
            let frame = RayFrame::new(&target.surface, &placed, &pose);
            let stream = StreamKey::new(0, "job", 0);
            let job = CastJob::aim(target.clone(), frame, pattern, Culling::Off, stream, 1.0);
            assert_eq!(matches!(job.aim, Aim::ByCaster { .. }), is_made, "{distance_m} m");
            assert_eq!(job.rays().len(), pattern.len());
            let first = frame.trace_ray_unculled(&frame.beam(pattern, job.beams[0]), 0);
            assert_eq!(job.rays()[0].direction, first.direction);
        }
    }
}
