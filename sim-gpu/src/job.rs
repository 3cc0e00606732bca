//! The input and the output of casters.

use crate::aim::aim;
use crate::lanes::{Vectors, each};
use crate::motion::Motion;
use crate::ray::{Ray, RayFrame, Rays, TraceRay};
use crate::sensor::BeamPattern;
use crate::target::Target;
use formats::rng::StreamKey;

pub use crate::aim::{Aim, Culling};

/// The rays of one sensor at one object.
#[derive(Clone, Debug)]
pub struct CastJob {
    /// The object.
    pub target: Target,
    /// The frame of the sensor and the object.
    pub frame: RayFrame,
    /// Their motion, if they move.
    pub motion: Option<Motion>,
    /// The beam of each ray, `[n_rays]`.
    pub beams: Vec<u32>,
    /// The source of the rays.
    pub aim: Aim,
    /// The key of the random numbers of this sensor and object.
    pub stream: StreamKey,
    /// The object's reflectivity, 0 to 1.
    pub reflectivity: f32,
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

    /// Ray number `beam` of `pattern`, at the time when it fires.
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

    /// The rays, computed in f64 and rounded, `[n_rays]`; computed by the first call.
    #[must_use]
    pub fn rays(&self) -> &[TraceRay] {
        match &self.aim {
            Aim::Rays(rays) => rays,
            Aim::ByCaster { directions, rays, .. } => rays
                .get_or_init(|| self.frame.trace_rays(directions, &[], self.beams.clone(), true).1),
        }
    }
}

/// A caster's answer for one job.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cast {
    /// Per ray: triangle index, [`crate::ray::MISS`] or [`crate::ray::AMBIGUOUS`]; `[n_rays]`.
    pub codes: Vec<u32>,
    /// The outputs of [`Effects::per_ray`](crate::effects::Effects::per_ray) side by side, not
    /// meaningful for a miss; `[n_rays, outputs_per_ray]`.
    pub effect_outputs: Vec<f32>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Builder;
    use crate::pose::Pose;
    use crate::sensor::SensorProfile;
    use crate::target::Surface;
    use edgepuck_mesh::TriangleMesh;
    use glam::{DAffine3, DVec3};

    #[test]
    fn casters_make_the_rays_where_integers_are_exact_enough() {
        let vertices = vec![DVec3::X, DVec3::Y, DVec3::Z];
        let surface = Surface::new(TriangleMesh { vertices, triangles: vec![[0, 1, 2]] }, vec![0]);
        let target = Target::new(surface, Builder::Sah);
        let pattern = SensorProfile::builtin("generic-static").unwrap().pattern();
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
