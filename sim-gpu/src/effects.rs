//! What a scan does to the ideal ranges: noise, dropout, quantisation,
//! intensity. An effect that is `None` costs nothing.
//!
//! In TOML and in the manifest:
//!
//! ```toml
//! [effects]
//! noise = { mean_m = 0.0, sigma_m = 0.01, model = "range" }
//! dropout = { probability = 0.05 }
//! quantise_m = 0.004 # or true: the sensor's own quantum
//! intensity = true
//! ```

use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, positive, within};
use crate::sensor::Sensor;

/// No length of an effect is larger: shaders hold it in f32, with room to
/// multiply.
const LARGEST_M: f64 = 1e9;

/// The effects of one scene or run. The default is none: a clean scan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "EffectsTable", into = "EffectsTable")]
pub struct Effects {
    /// Gaussian noise.
    pub noise: Option<Noise>,
    /// Random loss of returns.
    pub dropout: Option<Dropout>,
    /// Rounding of the range.
    pub quantum: Option<Quantum>,
    /// Intensity of the return.
    pub intensity: Option<Intensity>,
}

/// Gaussian noise of the measured point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Mean in metres; default 0.
    #[serde(default)]
    pub mean_m: f64,
    /// Standard deviation in metres, 0 or more.
    pub sigma_m: f64,
    /// What the noise is added to; default [`NoiseModel::Range`].
    #[serde(default)]
    pub model: NoiseModel,
}

/// What Gaussian noise is added to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseModel {
    /// The range, along the ray: BLAINDER's model (`scanners/lidar.py`).
    #[default]
    Range,
    /// Each coordinate of the point, independently.
    Xyz,
}

/// Random loss of returns, each on its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dropout {
    /// The probability that a return is lost, in 0..=1.
    pub probability: f64,
}

/// Rounding of the range to a multiple of a quantum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantum {
    /// The quantum in metres; `None` is the sensor's own.
    pub step_m: Option<f64>,
}

/// Intensity of a return: |cos(incidence)| x the object's reflectivity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Intensity;

impl Effects {
    /// What is left of them in a clean scan: all that leaves its points alone.
    #[must_use]
    pub fn clean(&self) -> Self {
        Self { intensity: self.intensity, ..Self::default() }
    }

    /// Whether no effect is wanted.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// The same effects with each "the sensor's own" replaced by what
    /// `sensor` states.
    ///
    /// # Errors
    ///
    /// If quantisation is wanted and the sensor states no quantum.
    pub fn for_sensor(&self, sensor: &Sensor) -> Result<Self, InvalidValue> {
        let mut resolved = self.clone();
        if let Some(quantum) = &mut resolved.quantum
            && quantum.step_m.is_none()
        {
            quantum.step_m = Some(sensor.range.quantum_m.ok_or_else(|| {
                let cause =
                    format!("sensor \"{}\" has no range.quantum_m; state metres", sensor.name);
                InvalidValue::new("effects.quantise_m", cause)
            })?);
        }
        Ok(resolved)
    }

    /// Checks all numbers.
    ///
    /// # Errors
    ///
    /// On the first number that is not finite or out of its bounds.
    pub fn validate(&self) -> Result<(), InvalidValue> {
        if let Some(noise) = self.noise {
            within("effects.noise.mean_m", noise.mean_m, -LARGEST_M, LARGEST_M)?;
            within("effects.noise.sigma_m", noise.sigma_m, 0.0, LARGEST_M)?;
        }
        if let Some(dropout) = self.dropout {
            within("effects.dropout.probability", dropout.probability, 0.0, 1.0)?;
        }
        if let Some(Quantum { step_m: Some(step_m) }) = self.quantum {
            positive("effects.quantise_m", step_m)?;
            within("effects.quantise_m", step_m, 0.0, LARGEST_M)?;
        }
        Ok(())
    }
}

/// [`Effects`] as written in TOML and JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EffectsTable {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    noise: Option<Noise>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dropout: Option<Dropout>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    quantise_m: Option<SwitchOrMetres>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    intensity: Option<bool>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(untagged, expecting = "quantise_m takes metres, or true for the sensor's own quantum")]
enum SwitchOrMetres {
    Switch(bool),
    Metres(f64),
}

impl TryFrom<EffectsTable> for Effects {
    type Error = InvalidValue;

    fn try_from(table: EffectsTable) -> Result<Self, InvalidValue> {
        let quantum = match table.quantise_m {
            None | Some(SwitchOrMetres::Switch(false)) => None,
            Some(SwitchOrMetres::Switch(true)) => Some(Quantum { step_m: None }),
            Some(SwitchOrMetres::Metres(step_m)) => Some(Quantum { step_m: Some(step_m) }),
        };
        let intensity = (table.intensity == Some(true)).then_some(Intensity);
        let effects = Self { noise: table.noise, dropout: table.dropout, quantum, intensity };
        effects.validate()?;
        Ok(effects)
    }
}

impl From<Effects> for EffectsTable {
    fn from(effects: Effects) -> Self {
        Self {
            noise: effects.noise,
            dropout: effects.dropout,
            quantise_m: effects.quantum.map(|quantum| {
                quantum.step_m.map_or(SwitchOrMetres::Switch(true), SwitchOrMetres::Metres)
            }),
            intensity: effects.intensity.map(|Intensity| true),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_effect_is_the_default_and_plain() {
        let effects: Effects = toml::from_str("").unwrap();
        assert!(effects.is_plain());
        let off: Effects = toml::from_str("intensity = false\nquantise_m = false").unwrap();
        assert!(off.is_plain());
    }

    #[test]
    fn effects_survive_a_round_trip() {
        for text in [
            "",
            "noise = { sigma_m = 0.01 }",
            "noise = { mean_m = -0.5, sigma_m = 1000, model = \"xyz\" }",
            "dropout = { probability = 1 }\nquantise_m = true",
            "quantise_m = 0.004\nintensity = true",
        ] {
            let effects: Effects = toml::from_str(text).unwrap();
            let json = serde_json::to_string(&effects).unwrap();
            assert_eq!(serde_json::from_str::<Effects>(&json).unwrap(), effects, "{json}");
        }
    }

    #[test]
    fn bad_numbers_are_named() {
        for (text, key) in [
            ("noise = { sigma_m = -1e-9 }", "effects.noise.sigma_m"),
            ("noise = { sigma_m = inf }", "effects.noise.sigma_m"),
            ("noise = { sigma_m = 0, mean_m = nan }", "effects.noise.mean_m"),
            ("dropout = { probability = 1.01 }", "effects.dropout.probability"),
            ("dropout = { probability = nan }", "effects.dropout.probability"),
            ("quantise_m = 0.0", "effects.quantise_m"),
            ("quantise_m = -0.004", "effects.quantise_m"),
            ("quantise_m = \"4 mm\"", "quantise_m"),
            ("noise = { sigma = 0.1 }", "sigma"),
            ("fog = true", "fog"),
        ] {
            let error = toml::from_str::<Effects>(text).unwrap_err().to_string();
            assert!(error.contains(key), "{text}: {error}");
        }
    }

    #[test]
    fn the_sensors_own_quantum_is_filled_in() {
        let effects: Effects = toml::from_str("quantise_m = true").unwrap();
        let vlp32c = Sensor::builtin("vlp32c").unwrap();
        let resolved = effects.for_sensor(&vlp32c).unwrap();
        assert_eq!(resolved.quantum, Some(Quantum { step_m: Some(0.004) }));
        let kinect = Sensor::builtin("kinect-v2").unwrap();
        let error = effects.for_sensor(&kinect).unwrap_err();
        assert!(error.to_string().contains("kinect-v2"), "{error}");
    }
}
