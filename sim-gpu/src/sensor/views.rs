//! The places from which a sensor is meant to look at an object.

use formats::rng::StreamKey;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, positive, within};
use crate::mesh::frame::Normalize;
use crate::pose::{Pose, ring_of_views};

/// Views of an object, evenly spread over azimuth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Views {
    /// How many.
    pub count: u32,
    /// From the object's origin, metres.
    pub distance_m: f64,
    /// Above the world's x-y plane.
    pub elevation_deg: f64,
    /// Of the first view, counterclockwise from world x.
    pub azimuth_deg: f64,
    /// Each view's azimuth is moved by a uniform random angle of at most this.
    #[serde(default)]
    pub azimuth_jitter_deg: f64,
    /// How the object should be normalised.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normalize: Option<Normalize>,
}

impl Views {
    /// Four views 90 degrees apart, 20 degrees above, 3 m away.
    pub const ROTATING: Self = Self {
        count: 4,
        distance_m: 3.0,
        elevation_deg: 20.0,
        azimuth_deg: 0.0,
        azimuth_jitter_deg: 0.0,
        normalize: None,
    };

    /// One view from 45 degrees, 20 degrees above, 3 m away.
    pub const STATIC: Self = Self { count: 1, azimuth_deg: 45.0, ..Self::ROTATING };

    /// The poses around `target_m`. The jitter of view k is number k of the
    /// stream `key`, which nothing else depends on.
    #[must_use]
    pub fn poses(&self, target_m: DVec3, key: StreamKey) -> Vec<Pose> {
        let elevation_rad = self.elevation_deg.to_radians();
        let first_azimuth_rad = self.azimuth_deg.to_radians();
        if self.azimuth_jitter_deg == 0.0 {
            return ring_of_views(
                self.count,
                self.distance_m,
                elevation_rad,
                first_azimuth_rad,
                target_m,
            );
        }
        let view = |k: u32| {
            let regular_deg = self.azimuth_deg + 360.0 * f64::from(k) / f64::from(self.count);
            let jitter_deg = self.azimuth_jitter_deg * (2.0 * key.unit(u64::from(k)) - 1.0);
            let azimuth_rad = (regular_deg + jitter_deg).to_radians();
            Pose::view(self.distance_m, elevation_rad, azimuth_rad, target_m)
        };
        (0..self.count).map(view).collect()
    }

    /// Checks all numbers.
    ///
    /// # Errors
    ///
    /// On the first number that is not finite or out of its bounds.
    pub fn validate(&self) -> Result<(), InvalidValue> {
        within("views.count", f64::from(self.count), 0.0..=f64::from(u16::MAX))?;
        positive("views.distance_m", self.distance_m)?;
        within("views.elevation_deg", self.elevation_deg, -90.0..=90.0)?;
        within("views.azimuth_deg", self.azimuth_deg, -360.0..=360.0)?;
        within("views.azimuth_jitter_deg", self.azimuth_jitter_deg, 0.0..=180.0)
    }
}
