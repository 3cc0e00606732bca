//! What is reported of a cluster: its box, its track, and the box of the whole object.

use std::sync::Arc;
use std::time::Duration;

use edgepuck_segment::Cluster;
use formats::geometry::{OrientedBox, Pose};
use glam::DVec3;

use super::classes::Fused;
use super::footprint::Observation;
use super::object::{Object, SCHEMA_VERSION};
use super::tracker::Track;
use super::turns::{Tag, Turn};
use super::whole::Whole;
use crate::detect;

/// A cluster of a turn, and where it is.
pub struct Seen<'a> {
    /// Its first and its last point.
    span: [Tag; 2],
    turn: u64,
    n_points: usize,
    /// The object that was seen in it.
    object: Option<&'a detect::Object>,
    /// The box around its points, in the sensor's frame.
    in_sensor: OrientedBox<f32>,
    /// The pose of the sensor, if its motion is known.
    pose: Option<Pose>,
    /// The box in the world if the pose is known, else in the sensor's frame.
    place: OrientedBox,
    /// The direction of `place` as it is reported, degrees.
    yaw_deg: f64,
}

impl<'a> Seen<'a> {
    pub fn new(
        turn: &Turn,
        cluster: Cluster<'_>,
        object: Option<&'a detect::Object>,
        pose: Option<Pose>,
    ) -> Self {
        let of = |point: &u32| *point as usize;
        let in_sensor = object.map_or_else(
            || {
                let points: Vec<_> = cluster.points.iter().map(|at| turn.points[of(at)]).collect();
                OrientedBox::around(&points)
            },
            |object| object.place,
        );
        let tags = || cluster.points.iter().map(|point| turn.tags[of(point)]);
        let by_time = |a: &Tag, b: &Tag| a.time_s.total_cmp(&b.time_s);
        let span = [tags().min_by(by_time), tags().max_by(by_time)].map(Option::unwrap_or_default);
        let (place, yaw_deg) = placed(&in_sensor, pose);
        let (turn, n_points) = (turn.number, cluster.points.len());
        Self { span, turn, n_points, object, in_sensor, pose, place, yaw_deg }
    }

    /// When its last point was measured, Unix time in seconds.
    pub fn last_s(&self) -> f64 {
        self.span[1].time_s
    }

    pub fn object(&self) -> Option<&'a detect::Object> {
        self.object
    }

    pub fn n_points(&self) -> usize {
        self.n_points
    }

    /// The cluster for the tracker, with the log-probabilities of its classes.
    pub fn observation<'b>(&self, view: Option<&'b [f64]>) -> Observation<'b> {
        Observation {
            time_s: self.last_s(),
            position_m: self.place.centre_m,
            size_m: [self.place.size_m[0], self.place.size_m[1]],
            yaw_rad: self.place.yaw_rad,
            sensor_m: self.sensor_m(),
            view,
            whole_length_m: self.object.map(|object| object.whole.size_m[0]),
        }
    }

    fn sensor_m(&self) -> [f64; 2] {
        self.pose.map_or([0.0; 2], |pose| pose.position_m.truncate().to_array())
    }

    /// Adds the object that was seen to the box of the whole object of its `track`, if it has the
    /// track's class. A piece of an object does not change that box, and an unknown track has none.
    pub fn fuse_whole(&self, track: &mut Track, fused: Option<&Fused>) {
        let known = fused.filter(|fused| fused.answer == fused.resembles);
        let Some(fused) = known else {
            track.whole = Whole::default();
            return;
        };
        let is_own = |object: &&detect::Object| *object.class == *fused.answer && !track.is_piece;
        if let Some(object) = self.object.filter(is_own) {
            // Without the sensor's motion, a velocity does not tell the front.
            let velocity_m_s = track.settled_velocity_m_s().filter(|_| self.pose.is_some());
            let (place, _) = placed(&object.whole, self.pose);
            track.whole.fuse(fused.class, &place, self.sensor_m(), velocity_m_s);
        }
    }

    /// The time since the packet with the last point arrived, if packets arrive in real time.
    pub fn latency(&self) -> Option<Duration> {
        let [_, last] = self.span;
        last.moment.map(|moment| moment.elapsed())
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
