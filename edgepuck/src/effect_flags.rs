//! Flags of effects, for the commands that scan meshes.

use crate::Usage;
use crate::flags::{first_given, of_flag};
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel, Quantum};
use sim_gpu::internals::config::{self, InvalidValue};
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct EffectFlags {
    /// Standard deviation of the noise, metres; 0 is no noise [default: 0.01 of gen-dataset, 0 of
    /// scan]
    #[arg(long, value_name = "M")]
    noise: Option<f64>,

    /// What the noise is added to: `range` (along the ray) or `xyz` (each coordinate)
    #[arg(long, default_value = "range", value_name = "MODEL")]
    noise_model: NoiseModel,

    /// Mean of the noise, metres
    #[arg(long, default_value_t = 0.0, value_name = "M")]
    noise_mean: f64,

    /// Probability that a return is missing from a noisy scan
    #[arg(long, default_value_t = 0.0, value_name = "P")]
    dropout: f64,

    /// Round the ranges of noisy scans to multiples of M metres, or without a value, of the
    /// sensor's own quantum
    #[arg(long, value_name = "M", num_args = 0..=1, default_missing_value = "sensor")]
    quantise: Option<String>,

    /// TOML file with a table `[effects]` as a scene has it, such as the sensor's detection limit;
    /// replaces the flags of noise, dropout and quantisation
    #[arg(long, value_name = "TOML",
          conflicts_with_all = ["noise", "noise_model", "noise_mean", "dropout", "quantise"])]
    effects: Option<PathBuf>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct EffectsFile {
    effects: Effects,
}

impl EffectFlags {
    /// The effects of the flags, and intensity if it is wanted. `noise_m` is the noise if no flag
    /// sets it.
    pub fn effects(&self, noise_m: f64, with_intensity: bool) -> anyhow::Result<Effects> {
        let intensity = with_intensity.then_some(Intensity);
        if let Some(file) = &self.effects {
            let mut effects =
                config::read(file, |EffectsFile { effects }| Ok::<_, InvalidValue>(effects))?;
            if let Some(weather) = &mut effects.weather {
                weather.empty_beams.get_or_insert(false);
            }
            return Ok(Effects { intensity: effects.intensity.or(intensity), ..effects });
        }
        let sigma_m = self.noise.unwrap_or(noise_m);
        let noise = Noise { mean_m: self.noise_mean, sigma_m, model: self.noise_model };
        let effects = Effects {
            noise: (sigma_m != 0.0 || self.noise_mean != 0.0).then_some(noise),
            dropout: (self.dropout != 0.0).then_some(Dropout { probability: self.dropout }),
            quantum: self.quantum()?,
            intensity,
            ..Effects::default()
        };
        effects.validate().map_err(of_flag)?;
        Ok(effects)
    }

    /// A flag that was given.
    pub fn given(&self) -> Option<&'static str> {
        first_given(&[
            (self.noise.is_some(), "--noise"),
            (self.noise_mean != 0.0, "--noise-mean"),
            (self.dropout != 0.0, "--dropout"),
            (self.quantise.is_some(), "--quantise"),
            (self.effects.is_some(), "--effects"),
        ])
    }

    fn quantum(&self) -> Result<Option<Quantum>, Usage> {
        let step_m = match self.quantise.as_deref() {
            None => return Ok(None),
            Some("sensor") => None,
            Some(metres) => Some(metres.parse().map_err(|_| {
                Usage(format!(
                    "--quantise: expected a number of metres or sensor, found {metres:?}"
                ))
            })?),
        };
        Ok(Some(Quantum { step_m }))
    }
}
