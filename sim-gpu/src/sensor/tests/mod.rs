use std::path::Path;

use super::*;

mod culling;
mod patterns;
mod profiles;
mod sphere;

fn sensor(name: &str) -> SensorProfile {
    SensorProfile::builtin(name).unwrap()
}

fn parse(text: &str) -> Result<SensorProfile, ConfigError> {
    profile::parse(text, Path::new("my_sensor.toml"))
}

/// A profile with two beams: the last one fires first, the middle one is cut
/// off in the last sequence.
const TINY: &str = include_str!("tiny.toml");
