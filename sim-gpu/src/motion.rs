//! Sensors and objects that move during a scan: each ray is cast with the poses of the sensor and
//! of the object at the time when it fires. Trees stay as they are; the rays are moved.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use crate::aim::{Aim, Culling};
use crate::pose::{Pose, Trajectory};
use crate::ray::RayFrame;
use crate::sensor::{BeamPattern, Cone};
use crate::target::Surface;

/// The motion of a sensor and of an object.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The pose of a sensor that does not move.
    pub pose: Pose,
    /// The poses of a sensor that moves.
    pub sensor: Option<Arc<Trajectory>>,
    /// The pose of the object in the world or, if it moves, in the frame that moves with it.
    pub world_from_object: DAffine3,
    /// The poses of the frame of an object that moves.
    pub object: Option<Arc<Trajectory>>,
    /// The time of the trajectories at which the scan begins, seconds.
    pub start_s: f64,
}

/// The margin of the cone for rounding, radians.
const ANGLE_MARGIN_RAD: f64 = 1e-6;

impl Motion {
    /// The pose of the sensor `time_s` after the scan began.
    #[must_use]
    pub fn pose_at(&self, time_s: f64) -> Pose {
        let at = |sensor: &Arc<Trajectory>| sensor.at(self.start_s + time_s);
        self.sensor.as_ref().map_or(self.pose, at)
    }

    /// The pose of the object `time_s` after the scan began.
    #[must_use]
    pub fn world_from_object_at(&self, time_s: f64) -> DAffine3 {
        self.object.as_ref().map_or(self.world_from_object, |object| {
            let Pose { position_m, rotation } = object.at(self.start_s + time_s);
            DAffine3::from_rotation_translation(rotation, position_m) * self.world_from_object
        })
    }

    /// The frame of the sensor and the object `time_s` after the scan began.
    #[must_use]
    pub fn frame_at(&self, surface: &Surface, time_s: f64) -> RayFrame {
        RayFrame::new(surface, &self.world_from_object_at(time_s), &self.pose_at(time_s))
    }

    /// The wanted beams of `pattern` that may meet `surface`, and their rays.
    pub(crate) fn aim(
        &self,
        surface: &Surface,
        pattern: &BeamPattern,
        culling: Culling,
        is_wanted: impl Fn(u32) -> bool,
    ) -> (Vec<u32>, Aim) {
        let all = culling == Culling::Off;
        let mut beams =
            if all { pattern.order.clone() } else { pattern.within(&self.cone(surface, pattern)) };
        beams.retain(|&beam| is_wanted(beam));
        let (mut kept, mut rays) = (Vec::new(), Vec::new());
        // The rays of a wide beam are neighbours and fire at the same time: they share a frame.
        let mut last = (f64::NAN, self.frame_at(surface, 0.0));
        for beam in beams {
            let time_s = pattern.time_s[beam as usize];
            if time_s != last.0 {
                last = (time_s, self.frame_at(surface, time_s));
            }
            let frame = &last.1;
            let ray = frame.beam(pattern, beam);
            let record = match frame.trace_ray(&ray, 0) {
                None if all => Some(frame.trace_ray_unculled(&ray, 0)),
                record => record,
            };
            if let Some(record) = record {
                kept.push(beam);
                rays.push(record);
            }
        }
        (kept, Aim::Rays(rays))
    }

    /// The cone of directions in which `pattern`'s beams may meet `surface` at any time.
    fn cone(&self, surface: &Surface, pattern: &BeamPattern) -> Cone {
        let everything = Cone { axis: DVec3::X, half_angle_rad: std::f64::consts::PI };
        let from_s = self.start_s;
        let to_s = from_s + pattern.last_s();
        let reach = |of: &Option<Arc<Trajectory>>| {
            of.as_ref().map_or((0.0, 0.0), |trajectory| trajectory.reach(from_s, to_s))
        };
        let ((sensor_m, sensor_rad), (object_m, object_rad)) =
            (reach(&self.sensor), reach(&self.object));
        let centre = surface.frame.to_object(DVec3::ZERO);
        // The object's centre moves around the origin of its frame as the frame turns.
        let around_m = self.world_from_object.transform_point3(centre).length() * object_rad;
        // The Frobenius norm bounds how far a map stretches vectors.
        let squares = self.world_from_object.matrix3.to_cols_array().map(|x| x * x);
        let stretch = squares.iter().sum::<f64>().sqrt();
        let radius_m = surface.radius * surface.frame.scale * stretch;
        let pose = self.pose_at(0.0);
        let from_sensor = self.world_from_object_at(0.0).transform_point3(centre) - pose.position_m;
        let reach_m = radius_m + sensor_m + object_m + around_m + pattern.farthest_start_m();
        let sine = reach_m / from_sensor.length();
        let Some(axis) = (pose.rotation.inverse() * from_sensor).try_normalize() else {
            return everything;
        };
        if sine.is_nan() || sine >= 1.0 {
            return everything;
        }
        Cone { axis, half_angle_rad: libm::asin(sine) + sensor_rad + ANGLE_MARGIN_RAD }
    }
}
