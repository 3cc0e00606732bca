//! What is reported of a cluster: its box, its track, and the box of the whole object.

use std::sync::Arc;
use std::time::Duration;

use formats::geometry::{OrientedBox, Pose, Trajectory};
use glam::DVec3;

use super::footprint::Observation;
use super::object::{Object, SCHEMA_VERSION};
use super::object_classifier::{Chosen, Fused};
use super::tracker::Track;
use super::waiting::{Tag, Waiting};
use super::whole::Whole;
use crate::classify::usual_size::usual_size_m;

/// A cluster of the best cut, and where it is.
pub struct Seen {
    /// Its first and its last point.
    span: [Tag; 2],
    turn: u64,
    n_points: usize,
    ground_z_m: Option<f32>,
    /// The box around its points, in the sensor's frame.
    in_sensor: OrientedBox<f32>,
    /// The pose of the sensor, if its motion is known.
    pose: Option<Pose>,
    /// The box in the world if the pose is known, else in the sensor's frame.
    place: OrientedBox,
    /// The direction of `place` as it is reported, degrees.
    yaw_deg: f64,
}

impl Seen {
    pub fn new(waiting: &Waiting, chosen: &Chosen, motion: Option<&Trajectory>) -> Self {
        let cluster = &waiting.nodes[chosen.node];
        let points = &waiting.points[cluster.points.clone()];
        let pose = motion.map(|motion| motion.at_unnormalized(cluster.pose_s));
        let in_sensor = OrientedBox::around(points);
        let (place, yaw_deg) = placed(&in_sensor, pose);
        Self {
            span: chosen.span,
            turn: cluster.turn,
            n_points: points.len(),
            ground_z_m: cluster.ground_z_m,
            in_sensor,
            pose,
            place,
            yaw_deg,
        }
    }

    /// The cluster for the tracker, with the answer of the network and the usual length of the class
    /// that it gives the cluster alone.
    pub fn observation<'a>(
        &self,
        view: Option<&'a [f64]>,
        usual_length_m: Option<f32>,
    ) -> Observation<'a> {
        let [_, last] = self.span;
        Observation {
            time_s: last.time_s,
            position_m: self.place.centre_m,
            size_m: [self.place.size_m[0], self.place.size_m[1]],
            yaw_rad: self.place.yaw_rad,
            sensor_m: self.sensor_m(),
            view,
            usual_length_m,
        }
    }

    fn sensor_m(&self) -> [f64; 2] {
        self.pose.map_or([0.0; 2], |pose| pose.position_m.truncate().to_array())
    }

    /// Adds the cluster to the box of the whole object of its `track`, by the usual size of the
    /// track's class. A class without one has no such box, and neither a piece of an object nor a
    /// cluster that was not classified changes it.
    pub fn fuse_whole(&self, track: &mut Track, fused: Option<&Fused>, is_classified: bool) {
        let usual = fused.and_then(|fused| Some((fused.class, usual_size_m(&fused.answer)?)));
        match usual {
            Some((class, usual_m)) if is_classified && !track.is_piece => {
                let whole = self.in_sensor.completed(usual_m, self.ground_z_m);
                // Without the sensor's motion, a velocity does not tell the front.
                let velocity_m_s = track.settled_velocity_m_s().filter(|_| self.pose.is_some());
                let (place, _) = placed(&whole, self.pose);
                track.whole.fuse(class, &place, self.sensor_m(), velocity_m_s);
            }
            Some(_) => {}
            None => track.whole = Whole::default(),
        }
    }

    /// The time since the packet with the last point arrived, if packets arrive in real time.
    pub fn latency(&self) -> Option<Duration> {
        let [_, last] = self.span;
        last.moment.map(|moment| moment.elapsed())
    }

    /// The number of the turn.
    pub fn turn(&self) -> u64 {
        self.turn
    }

    /// The result for the cluster, with its track's class.
    pub fn report(
        &self,
        track: &Track,
        fused: Option<&Fused>,
        view: Option<&[f64]>,
        latency: Option<Duration>,
    ) -> Object {
        let Self {
            span: [first, last], turn, n_points, ref in_sensor, pose, place, yaw_deg, ..
        } = *self;
        let alone = view.zip(fused);
        Object {
            version: SCHEMA_VERSION,
            turn,
            track: track.id,
            class: fused.map(|fused| Arc::clone(&fused.answer)),
            resembles: fused.map(|fused| Arc::clone(&fused.resembles)),
            confidence: alone.map(|(view, fused)| libm::exp(view[fused.class])),
            probability: fused.map(|fused| fused.probability),
            frame: if pose.is_some() { "world" } else { "sensor" },
            position_m: place.centre_m,
            size_m: place.size_m,
            yaw_deg,
            velocity_m_s: track.velocity_m_s(),
            points: n_points,
            range_m: f64::from(libm::hypotf(in_sensor.centre_m[0], in_sensor.centre_m[1])),
            first_s: first.time_s,
            last_s: last.time_s,
            latency_ms: latency.map(|latency| latency.as_secs_f64() * 1e3),
            whole_box: track.whole.is_known().then_some(track.whole.place),
        }
    }
}

/// A box of the frame of the sensor, in the world if the pose is known, and its direction in degrees.
/// Its radians are those of the degrees that are reported, whose bits recordings keep.
fn placed(seen: &OrientedBox<f32>, pose: Option<Pose>) -> (OrientedBox, f64) {
    let OrientedBox { centre_m, size_m, yaw_rad } = seen.widened();
    let Some(pose) = pose else {
        let yaw_deg = f64::from(seen.yaw_rad.to_degrees());
        return (OrientedBox { centre_m, size_m, yaw_rad: yaw_deg.to_radians() }, yaw_deg);
    };
    let (sin, cos) = libm::sincos(yaw_rad);
    let along = pose.rotation * DVec3::new(cos, sin, 0.0);
    let yaw_deg = libm::atan(along.y / along.x).to_degrees();
    let centre_m = pose.to_world(centre_m.into()).to_array();
    (OrientedBox { centre_m, size_m, yaw_rad: yaw_deg.to_radians() }, yaw_deg)
}
