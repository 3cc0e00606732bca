use std::path::Path;

use super::*;

mod culling;
mod patterns;
mod profiles;
mod recipe;
mod sphere;

fn sensor(name: &str) -> SensorProfile {
    SensorProfile::builtin(name).unwrap()
}

fn parse(text: &str) -> Result<SensorProfile, ConfigError> {
    profile::parse(text, Path::new("my_sensor.toml"))
}

/// A profile with two beams: the last one fires first, the middle one is cut
/// off in the last sequence.
const TINY: &str = "
name = \"tiny\"
range = { max_m = 10 }
[rotating]
rpm = 60
sequence_us = 400_000
[[rotating.beam]]
azimuth_offset_deg = 0
elevation_deg = 5
firing_us = 100_000
[[rotating.beam]]
azimuth_offset_deg = -90
elevation_deg = -5
firing_us = 0
";
