//! The effects that a scan applies to ideal ranges: noise, dropout, the detection limit, wide beams
//! and their returns, weather, quantisation, intensity. An effect that is `None` costs nothing.
//!
//! In TOML and in the manifest:
//!
//! ```toml
//! [effects]
//! noise = { mean_m = 0.0, sigma_m = 0.01, model = "range" }
//! dropout = { probability = 0.05 }
//! detection = { reflectivity = 0.1, range_m = 60 } # or true: the sensor's own limit
//! footprint = { samples = 19, divergence_deg = [0.18, 0.09], separation_m = 1.0 } # or true
//! returns = "dual"
//! weather = { rain_mm_h = 25.0 } # and snow_mm_h, fog_visibility_m, haze_visibility_m, volumes
//! motion = { velocity_m_s = [10.0, 0.0, 0.0], yaw_rate_deg_s = 5.0 }
//! quantise_m = 0.004 # or true: the sensor's own quantum
//! intensity = true
//! ```

use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, positive, within};
use crate::sensor::{BeamPattern, LARGEST_M, SensorProfile};

pub use crate::sensor::DetectionLimit;
pub use detection::Detection;
pub use footprint::{Footprint, ReturnMode};
pub use motion::EvenMotion;
pub use weather::{Volume, Weather};

mod detection;
mod footprint;
mod motion;
mod weather;

/// The effects of a scene or run. The default is a clean scan, without any.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "EffectsTable", into = "EffectsTable")]
pub struct Effects {
    /// Gaussian noise.
    pub noise: Option<Noise>,
    /// Random loss of returns.
    pub dropout: Option<Dropout>,
    /// The loss of returns that are too weak.
    pub detection: Option<Detection>,
    /// The width of beams.
    pub footprint: Option<Footprint>,
    /// The returns of a beam that the sensor reports; `None` is the strongest.
    pub returns: Option<ReturnMode>,
    /// Rain, snow, fog and others. They need a detection limit: `detection`'s or the sensor's own.
    pub weather: Option<Box<Weather>>,
    /// The motion of a sensor without a trajectory.
    pub motion: Option<Box<EvenMotion>>,
    /// Rounding of the range.
    pub quantum: Option<Quantum>,
    /// Intensity of the return.
    pub intensity: Option<Intensity>,
}

/// Gaussian noise of the measured point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table with sigma_m, metres")]
pub struct Noise {
    /// Mean in metres; default 0.
    #[serde(default)]
    pub mean_m: f64,
    /// Standard deviation in metres, 0 or more.
    pub sigma_m: f64,
    /// The quantity that the noise is added to.
    #[serde(default)]
    pub model: NoiseModel,
}

impl Noise {
    /// Noise of the range with this standard deviation, metres, and mean 0.
    #[must_use]
    pub fn along_range(sigma_m: f64) -> Self {
        Self { mean_m: 0.0, sigma_m, model: NoiseModel::Range }
    }
}

formats::named! {
    /// The quantity that Gaussian noise is added to.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum NoiseModel: "noise model" {
        /// The range, along the ray: BLAINDER's model (`scanners/lidar.py`).
        #[default]
        Range = "range",
        /// Each coordinate of the point, independently.
        Xyz = "xyz",
    }
}

/// Independent random loss of returns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table with probability, 0 to 1")]
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

/// An effect that casters compute for each ray that hits, with its parameters.
///
/// [`Effects::per_ray`] lists them in the order of their outputs. The composition of the shader,
/// the outputs of the CPU and the scans that read them all follow that list.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RayEffect {
    /// Gaussian error of the range along the ray, metres: one output.
    NoiseRange(Noise),
    /// Gaussian error of each coordinate in the world frame, metres: three outputs.
    NoiseXyz(Noise),
    /// Whether the return is lost, 1 or 0: one output.
    Dropout(Dropout),
    /// Intensity of the return, 0 to 1: one output.
    Intensity,
}

/// The input of an effect besides the ray and the triangle that it hits.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayInput {
    /// The ray's random bits, `streams` in the shader.
    RandomBits,
    /// Normal deviates from the ray's random bits.
    NormalDeviates,
    /// The object's reflectivity, which the shader's view holds.
    Reflectivity,
}

impl RayEffect {
    /// The name of the effect's function on the CPU and in its shader, `shaders/effects/NAME.wgsl`.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::NoiseRange(_) => "noise_range",
            Self::NoiseXyz(_) => "noise_xyz",
            Self::Dropout(_) => "dropout",
            Self::Intensity => "intensity",
        }
    }

    /// The number of outputs for each ray, 1 to 4.
    #[must_use]
    pub fn width(&self) -> usize {
        match self {
            Self::NoiseXyz(_) => 3,
            Self::NoiseRange(_) | Self::Dropout(_) | Self::Intensity => 1,
        }
    }

    /// The input of the effect.
    #[must_use]
    pub fn input(&self) -> RayInput {
        match self {
            Self::NoiseRange(_) | Self::NoiseXyz(_) => RayInput::NormalDeviates,
            Self::Dropout(_) => RayInput::RandomBits,
            Self::Intensity => RayInput::Reflectivity,
        }
    }

    /// The names and values of the shader's `override` constants.
    #[must_use]
    pub fn constants(&self) -> Vec<(&'static str, f64)> {
        match self {
            Self::NoiseRange(noise) | Self::NoiseXyz(noise) => {
                vec![("noise_mean_m", noise.mean_m), ("noise_sigma_m", noise.sigma_m)]
            }
            Self::Dropout(dropout) => vec![("dropout_probability", dropout.probability)],
            Self::Intensity => vec![],
        }
    }
}

impl Effects {
    /// The effects that casters compute for each ray, in the order of their outputs. The other
    /// effects need the range, which is computed once all rays are cast.
    #[doc(hidden)]
    pub fn per_ray(&self) -> impl Iterator<Item = RayEffect> + use<> {
        let noise = self.noise.map(|noise| match noise.model {
            NoiseModel::Range => RayEffect::NoiseRange(noise),
            NoiseModel::Xyz => RayEffect::NoiseXyz(noise),
        });
        let dropout = self.dropout.map(RayEffect::Dropout);
        let intensity = self.intensity.map(|Intensity| RayEffect::Intensity);
        [noise, dropout, intensity].into_iter().flatten()
    }

    /// The number of outputs of all effects for each ray.
    #[doc(hidden)]
    #[must_use]
    pub fn outputs_per_ray(&self) -> usize {
        self.per_ray().map(|effect| effect.width()).sum()
    }

    /// The effects that remain in a clean scan: those that leave ranges exact.
    #[must_use]
    pub fn clean(&self) -> Self {
        Self { intensity: self.intensity, motion: self.motion.clone(), ..Self::default() }
    }

    /// Whether there is no effect.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// The same effects, with the values of `sensor` wherever they refer to the sensor's own.
    #[doc(hidden)]
    pub fn for_sensor(&self, sensor: &SensorProfile) -> Result<Self, InvalidValue> {
        let mut resolved = self.clone();
        if let Some(quantum) = &mut resolved.quantum
            && quantum.step_m.is_none()
        {
            quantum.step_m = Some(sensor.range.quantum_m.ok_or_else(|| {
                let name = &sensor.name;
                let cause = format!("expected metres, as sensor \"{name}\" has no range.quantum_m");
                InvalidValue::new("effects.quantise_m", cause)
            })?);
        }
        if resolved.weather.as_ref().is_some_and(|weather| !weather.is_clear()) {
            resolved.detection.get_or_insert_default();
        }
        if let Some(detection) = &mut resolved.detection
            && detection.limit.is_none()
        {
            detection.limit = Some(sensor.detection.ok_or_else(|| {
                let name = &sensor.name;
                let cause = format!(
                    "expected reflectivity and range_m, as sensor \"{name}\" has no [detection]"
                );
                InvalidValue::new("effects.detection", cause)
            })?);
        }
        if let Some(footprint) = &mut resolved.footprint {
            *footprint = footprint.for_sensor(sensor)?;
        }
        Ok(resolved)
    }

    /// The `pattern` of `sensor` with the number of rays per beam that the footprint asks for.
    #[doc(hidden)]
    pub fn widen(
        &self,
        pattern: BeamPattern,
        sensor: &SensorProfile,
    ) -> Result<BeamPattern, InvalidValue> {
        let Some(footprint) = self.footprint else { return Ok(pattern) };
        let own = footprint.for_sensor(sensor)?;
        let divergence_deg = own.divergence_deg.unwrap_or_default();
        pattern
            .widened(footprint.samples, divergence_deg)
            .map_err(|cause| InvalidValue::new("effects.footprint.samples", cause))
    }

    /// Checks all numbers.
    ///
    /// # Errors
    /// On the first number that is not finite or out of its bounds.
    pub fn validate(&self) -> Result<(), InvalidValue> {
        if let Some(noise) = self.noise {
            within("effects.noise.mean_m", noise.mean_m, -LARGEST_M..=LARGEST_M)?;
            within("effects.noise.sigma_m", noise.sigma_m, 0.0..=LARGEST_M)?;
        }
        if let Some(detection) = self.detection {
            detection.validate()?;
        }
        if let Some(footprint) = self.footprint {
            footprint.validate()?;
        }
        if let Some(weather) = &self.weather {
            weather.validate()?;
        }
        if let Some(motion) = &self.motion {
            motion.validate()?;
        }
        let probability = self.dropout.map(|dropout| dropout.probability);
        within("effects.dropout.probability", probability, 0.0..=1.0)?;
        let step_m = self.quantum.and_then(|quantum| quantum.step_m);
        positive("effects.quantise_m", step_m)?;
        within("effects.quantise_m", step_m, 0.0..=LARGEST_M)
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table of effects")]
struct EffectsTable {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    noise: Option<Noise>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dropout: Option<Dropout>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    detection: Option<detection::Table>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    footprint: Option<footprint::Table>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    returns: Option<ReturnMode>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    weather: Option<Box<Weather>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    motion: Option<Box<EvenMotion>>,
    /// The quantum to multiples of which ranges are rounded, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    quantise_m: Option<SwitchOrMetres>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    intensity: Option<bool>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected metres as quantise_m, or true for the sensor's own quantum"
)]
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
        let detection = table.detection.map_or(Ok(None), detection::Table::detection)?;
        let footprint = table.footprint.and_then(Option::from);
        let EffectsTable { noise, dropout, returns, weather, motion, .. } = table;
        let effects = Self {
            noise,
            dropout,
            detection,
            footprint,
            returns,
            weather,
            motion,
            quantum,
            intensity,
        };
        effects.validate()?;
        Ok(effects)
    }
}

impl From<Effects> for EffectsTable {
    fn from(effects: Effects) -> Self {
        Self {
            noise: effects.noise,
            dropout: effects.dropout,
            detection: effects.detection.map(detection::Table::from),
            footprint: effects.footprint.map(footprint::Table::from),
            returns: effects.returns,
            weather: effects.weather,
            motion: effects.motion,
            quantise_m: effects.quantum.map(|quantum| {
                quantum.step_m.map_or(SwitchOrMetres::Switch(true), SwitchOrMetres::Metres)
            }),
            intensity: effects.intensity.map(|Intensity| true),
        }
    }
}

#[cfg(test)]
mod tests;
