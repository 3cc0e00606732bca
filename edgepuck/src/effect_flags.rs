//! Flags of effects, for the commands that scan meshes.

use crate::Usage;
use crate::flags::{first_given, of_flag};
use edgepuck_dataset::{noisy, read_effects};
use sim_gpu::effects::{Effects, Quantum};
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct EffectFlags {
    /// Standard deviation of the noise of the ranges, metres; gen-dataset then writes noisy scans beside
    /// the clean ones [default: 0]
    #[arg(long, value_name = "M")]
    noise: Option<f64>,

    /// Probability that a return is missing
    #[arg(long, default_value_t = 0.0, value_name = "P")]
    dropout: f64,

    /// Round the ranges of noisy scans to multiples of M metres, or without a value, of the
    /// sensor's own quantum
    #[arg(long, value_name = "M", num_args = 0..=1, default_missing_value = "sensor")]
    #[arg(hide_short_help = true)]
    quantise: Option<String>,

    /// TOML file with a table `[effects]` as a scene has it
    ///
    /// It has all effects, such as the sensor's detection limit or noise of x, y and z, and replaces the
    /// flags of noise, dropout and quantisation.
    #[arg(long, value_name = "TOML", conflicts_with_all = ["noise", "dropout", "quantise"])]
    effects: Option<PathBuf>,
}

impl EffectFlags {
    /// The effects of the flags.
    pub fn effects(&self) -> anyhow::Result<Effects> {
        if let Some(file) = &self.effects {
            return Ok(read_effects(file)?);
        }
        let effects = noisy(self.noise.unwrap_or(0.0), self.dropout).map_err(of_flag)?;
        let effects = Effects { quantum: self.quantum()?, ..effects };
        effects.validate().map_err(of_flag)?;
        Ok(effects)
    }

    /// A flag that was given.
    pub fn given(&self) -> Option<&'static str> {
        first_given(&[
            (self.noise.is_some(), "--noise"),
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
