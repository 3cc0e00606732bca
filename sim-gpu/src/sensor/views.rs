//! The poses of a sensor around an object.

use formats::rng::StreamKey;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, at_least, positive, within};
use crate::pose::{Pose, azimuth_on_ring};

/// Views of an object, evenly spread over azimuth.
// Manifests of earlier versions have one key more, `normalize`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Views {
    /// The number of views.
    pub count: u32,
    /// The distance from the object's origin, metres.
    pub distance_m: f64,
    /// If given, each view's distance is uniform between `distance_m` and this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_to_m: Option<f64>,
    /// The elevation above the world's x-y plane.
    pub elevation_deg: f64,
    /// If given, each view's elevation is uniform between `elevation_deg` and this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elevation_to_deg: Option<f64>,
    /// The azimuth of the first view, counterclockwise from world x.
    pub azimuth_deg: f64,
    /// Each view's azimuth is moved by a uniform random angle of at most this.
    #[serde(default)]
    pub azimuth_jitter_deg: f64,
}

impl Views {
    /// Four views 90 degrees apart, 20 degrees above, 3 m away.
    pub const ROTATING: Self = Self {
        count: 4,
        distance_m: 3.0,
        distance_to_m: None,
        elevation_deg: 20.0,
        elevation_to_deg: None,
        azimuth_deg: 0.0,
        azimuth_jitter_deg: 0.0,
    };

    /// One view from 45 degrees, 20 degrees above, 3 m away.
    pub const STATIC: Self = Self { count: 1, azimuth_deg: 45.0, ..Self::ROTATING };

    /// The poses around `target_m`. The jitter of view k is number k of the stream `key`; random
    /// distances and elevations use other numbers of that stream.
    #[must_use]
    pub fn poses(&self, target_m: DVec3, key: StreamKey) -> Vec<Pose> {
        (0..self.count).map(|view| self.pose(view, target_m, key)).collect()
    }

    /// Whether no number is random, so that the poses around all objects are the same.
    #[must_use]
    pub fn is_regular(&self) -> bool {
        let Self { azimuth_jitter_deg, distance_to_m, elevation_to_deg, .. } = self;
        *azimuth_jitter_deg == 0.0 && distance_to_m.is_none() && elevation_to_deg.is_none()
    }

    /// Pose number `view`.
    #[must_use]
    pub fn pose(&self, view: u32, target_m: DVec3, key: StreamKey) -> Pose {
        if self.is_regular() {
            let first_azimuth_rad = self.azimuth_deg.to_radians();
            let azimuth_rad = azimuth_on_ring(view, self.count, first_azimuth_rad);
            let elevation_rad = self.elevation_deg.to_radians();
            return Pose::view(self.distance_m, elevation_rad, azimuth_rad, target_m);
        }
        let drawn = |from: f64, to: Option<f64>, what: u64| {
            let share = || key.unit(u64::from(view) | what << 32);
            to.map_or(from, |to| from + share() * (to - from))
        };
        let regular_deg = self.azimuth_deg + 360.0 * f64::from(view) / f64::from(self.count);
        let jitter_deg = self.azimuth_jitter_deg * (2.0 * key.unit(u64::from(view)) - 1.0);
        let distance_m = drawn(self.distance_m, self.distance_to_m, 1);
        let elevation_deg = drawn(self.elevation_deg, self.elevation_to_deg, 2);
        let azimuth_rad = (regular_deg + jitter_deg).to_radians();
        Pose::view(distance_m, elevation_deg.to_radians(), azimuth_rad, target_m)
    }

    /// Checks all numbers.
    pub fn validate(&self) -> Result<(), InvalidValue> {
        at_least("views.count", Some(f64::from(self.count)), 1.0)?;
        positive("views.distance_m", self.distance_m)?;
        for (key, from, to) in [
            ("views.distance_to_m", self.distance_m, self.distance_to_m),
            ("views.elevation_to_deg", self.elevation_deg, self.elevation_to_deg),
        ] {
            if let Some(to) = to.filter(|to| *to < from) {
                let cause =
                    format!("expected the smaller number first, {to},{from}, found {from},{to}");
                return Err(InvalidValue::new(key, cause));
            }
        }
        at_least("views.distance_to_m", self.distance_to_m, self.distance_m)?;
        within("views.elevation_deg", self.elevation_deg, -90.0..=90.0)?;
        within("views.elevation_to_deg", self.elevation_to_deg, self.elevation_deg..=90.0)?;
        within("views.azimuth_deg", self.azimuth_deg, -360.0..=360.0)?;
        within("views.azimuth_jitter_deg", self.azimuth_jitter_deg, 0.0..=180.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::SensorProfile;

    #[test]
    fn views_are_regular_if_nothing_of_them_is_drawn() {
        assert!(Views::ROTATING.is_regular());
        for drawn in [
            Views { azimuth_jitter_deg: 1.0, ..Views::ROTATING },
            Views { distance_to_m: Some(4.0), ..Views::ROTATING },
            Views { elevation_to_deg: Some(30.0), ..Views::ROTATING },
        ] {
            assert!(!drawn.is_regular(), "{drawn:?}");
            let pose = |object| drawn.pose(1, DVec3::ZERO, StreamKey::new(0, object, 0));
            assert_ne!(pose("chair"), pose("table"));
        }
    }

    #[test]
    fn cameras_and_other_sensors_have_their_usual_views() {
        let views = |name| SensorProfile::builtin(name).unwrap().default_views();
        assert_eq!(views("vlp32c"), Views::ROTATING);
        assert_eq!(views("generic-static"), Views::STATIC);
        let poses = Views::ROTATING.poses(DVec3::ZERO, StreamKey::new(0, "", 0));
        let (sine, cosine) = 20f64.to_radians().sin_cos();
        assert_eq!(poses.len(), 4);
        assert!(poses[0].position_m.abs_diff_eq(DVec3::new(cosine, 0.0, sine) * 3.0, 1e-15));
        assert!(poses[1].position_m.y > 2.8);
    }

    #[test]
    fn there_is_a_view() {
        assert!(Views::ROTATING.validate().is_ok());
        assert!(Views { count: 0, ..Views::ROTATING }.validate().is_err());
    }

    #[test]
    fn azimuth_distance_and_elevation_are_drawn_by_themselves() {
        let (distance_to_m, elevation_to_deg) = (Some(4.0), Some(30.0));
        let drawn = Views { distance_to_m, elevation_to_deg, count: 1000, ..Views::ROTATING };
        let views = Views { azimuth_jitter_deg: 0.1, ..drawn };
        let poses = views.poses(DVec3::ZERO, StreamKey::new(0, "chair", 0));
        let drawn = (0..).zip(&poses).map(|(view, pose)| {
            let ([x, y, z], d) = (pose.position_m.to_array(), pose.position_m.length());
            let off_deg = y.atan2(x).to_degrees() - 0.36 * f64::from(view);
            // Each in -1 to 1.
            let jitter = ((off_deg + 180.0).rem_euclid(360.0) - 180.0) / 0.1;
            [jitter, (d - 3.5) / 0.5, ((z / d).asin().to_degrees() - 25.0) / 5.0]
        });
        let drawn: Vec<[f64; 3]> = drawn.collect();
        assert!(drawn.iter().flatten().all(|x| x.abs() < 1.0 + 1e-9));
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let pairs: Vec<[f64; 2]> = drawn.iter().map(|drawn| [drawn[a], drawn[b]]).collect();
            test_support::assert_uncorrelated(&format!("{a} and {b}"), &pairs);
        }
    }
}
