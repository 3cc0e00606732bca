//! Weather between a sensor and its surroundings.

use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, within};

/// Rain, snow, fog, haze, dust and spray: EFFECTS.md has the models. The default is clear air.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table with rain_mm_h, fog_visibility_m and others")]
pub struct Weather {
    /// The rate of rain, millimetres per hour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rain_mm_h: Option<f64>,
    /// The rate of snow, millimetres of water per hour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub snow_mm_h: Option<f64>,
    /// The meteorological optical range of fog, metres: the distance up to which a black object
    /// can be distinguished from the sky.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fog_visibility_m: Option<f64>,
    /// The visibility in haze by Koschmieder's law, metres. Haze weakens returns and gives none
    /// itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub haze_visibility_m: Option<f64>,
    /// Dust and spray.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub volumes: Vec<Volume>,
    /// Whether beams that meet no surface may return from the air; `None` is yes, but no for
    /// `gen-dataset`, which cuts clouds of single objects out of scans without such returns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub empty_beams: Option<bool>,
}

/// A box of dust or spray, along the world's axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table with min_m, max_m and visibility_m")]
pub struct Volume {
    /// The lowest corner, metres.
    pub min_m: [f64; 3],
    /// The highest corner, metres.
    pub max_m: [f64; 3],
    /// The meteorological optical range inside, metres.
    pub visibility_m: f64,
}

/// Far more than the heaviest rain ever measured over a minute, 1872 mm/h.
const MOST_MM_H: f64 = 1e6;

/// From opaque to clear beyond every horizon.
const VISIBILITIES_M: std::ops::RangeInclusive<f64> = 1e-3..=1e9;

impl Weather {
    /// Whether the air is clear.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        let is_dry = |rate: Option<f64>| rate.is_none_or(|rate| rate == 0.0);
        is_dry(self.rain_mm_h)
            && is_dry(self.snow_mm_h)
            && self.fog_visibility_m.is_none()
            && self.haze_visibility_m.is_none()
            && self.volumes.is_empty()
    }

    /// Checks all numbers.
    ///
    /// # Errors
    /// On the first that is not finite or out of its bounds.
    pub fn validate(&self) -> Result<(), InvalidValue> {
        within("effects.weather.rain_mm_h", self.rain_mm_h, 0.0..=MOST_MM_H)?;
        within("effects.weather.snow_mm_h", self.snow_mm_h, 0.0..=MOST_MM_H)?;
        within("effects.weather.fog_visibility_m", self.fog_visibility_m, VISIBILITIES_M)?;
        within("effects.weather.haze_visibility_m", self.haze_visibility_m, VISIBILITIES_M)?;
        for (i, volume) in self.volumes.iter().enumerate() {
            let key = |of: &str| format!("effects.weather.volumes[{i}].{of}");
            within(&key("visibility_m"), volume.visibility_m, VISIBILITIES_M)?;
            for (axis, (min_m, max_m)) in volume.min_m.into_iter().zip(volume.max_m).enumerate() {
                within(&key(&format!("min_m[{axis}]")), min_m, -1e9..=1e9)?;
                within(&key(&format!("max_m[{axis}]")), max_m, min_m..=1e9)?;
            }
        }
        Ok(())
    }
}
