//! The detection of returns by their power.

use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, positive, within};
use crate::sensor::{DetectionLimit, LARGEST_M};

/// The detection of returns by received power.
///
/// A receiver reports a pulse where its signal crosses a threshold. Here the signal is the received
/// power, and the threshold is the power of the weakest surface that the sensor is stated to
/// detect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Detection {
    /// The weakest surface that the sensor detects; `None` is the sensor's own limit.
    pub limit: Option<DetectionLimit>,
    /// The threshold divided by the standard deviation of the receiver's noise: returns
    /// near the limit are then lost or kept at random. `None` is a receiver without noise.
    pub threshold_to_noise: Option<f64>,
    /// The standard deviation of the range of a return at the limit due to the receiver's noise,
    /// metres; it falls as the square root of the power grows. `None` is 0.
    pub range_sigma_m: Option<f64>,
}

impl Detection {
    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        if let Some(limit) = self.limit {
            limit.validate("effects.detection")?;
        }
        let ratio = self.threshold_to_noise;
        positive("effects.detection.threshold_to_noise", ratio)?;
        within("effects.detection.threshold_to_noise", ratio, 0.0..=1e9)?;
        within("effects.detection.range_sigma_m", self.range_sigma_m, 0.0..=LARGEST_M)
    }
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected true for the sensor's own limit, or a table of reflectivity, range_m, \
                 threshold_to_noise and range_sigma_m as detection"
)]
pub(super) enum Table {
    Switch(bool),
    Numbers(Numbers),
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Numbers {
    /// The reflectivity of the weakest surface that is detected at `range_m`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reflectivity: Option<f64>,
    /// The range up to which that surface is detected, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range_m: Option<f64>,
    /// The threshold divided by the standard deviation of the receiver's noise; without noise if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    threshold_to_noise: Option<f64>,
    /// The standard deviation of the range of a return at the limit, metres; 0 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range_sigma_m: Option<f64>,
}

impl Table {
    pub(super) fn detection(self) -> Result<Option<Detection>, InvalidValue> {
        let numbers = match self {
            Self::Switch(false) => return Ok(None),
            Self::Switch(true) => Numbers::default(),
            Self::Numbers(numbers) => numbers,
        };
        let missing = |key: &str, other: &str| {
            let key = format!("effects.detection.{key}");
            Err(InvalidValue::new(key, format!("expected a number beside {other}, found none")))
        };
        let limit = match (numbers.reflectivity, numbers.range_m) {
            (None, None) => None,
            (Some(reflectivity), Some(range_m)) => Some(DetectionLimit { reflectivity, range_m }),
            (Some(_), None) => return missing("range_m", "reflectivity"),
            (None, Some(_)) => return missing("reflectivity", "range_m"),
        };
        let Numbers { threshold_to_noise, range_sigma_m, .. } = numbers;
        Ok(Some(Detection { limit, threshold_to_noise, range_sigma_m }))
    }
}

impl From<Detection> for Table {
    fn from(detection: Detection) -> Self {
        let Detection { limit, threshold_to_noise, range_sigma_m } = detection;
        if (limit, threshold_to_noise, range_sigma_m) == (None, None, None) {
            return Self::Switch(true);
        }
        Self::Numbers(Numbers {
            reflectivity: limit.map(|limit| limit.reflectivity),
            range_m: limit.map(|limit| limit.range_m),
            threshold_to_noise,
            range_sigma_m,
        })
    }
}
