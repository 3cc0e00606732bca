//! The detection limit that a sensor's maker states.

use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, positive, within};

/// The largest length of a profile or an effect: farther than any sensor sees, and its square is
/// finite in the f32 of shaders.
pub(crate) const LARGEST_M: f64 = 1e9;

/// The weakest surface that a sensor detects, facing it in clear air, as makers state it: "80 % at
/// 120 m".
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DetectionLimit {
    /// The surface's diffuse reflectivity, above 0 and at most 1.
    pub reflectivity: f64,
    /// Its distance in metres.
    pub range_m: f64,
}

impl DetectionLimit {
    /// The least power that is detected, relative to that of a white surface that faces the sensor
    /// at 1 m.
    #[must_use]
    pub fn power(&self) -> f64 {
        self.reflectivity / self.range_m.powi(2)
    }

    pub(crate) fn validate(&self, key: &str) -> Result<(), InvalidValue> {
        positive(&format!("{key}.reflectivity"), self.reflectivity)?;
        within(&format!("{key}.reflectivity"), self.reflectivity, 0.0..=1.0)?;
        positive(&format!("{key}.range_m"), self.range_m)?;
        within(&format!("{key}.range_m"), self.range_m, 0.0..=LARGEST_M)
    }
}
