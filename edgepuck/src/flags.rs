//! Checks and parsers for flags of several commands.

use crate::Usage;
use formats::{FormatError, hash};
use sim_gpu::errors::InvalidValue;
use sim_gpu::sensors::SensorProfile;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The first of these flags that was given.
pub fn first_given(flags: &[(bool, &'static str)]) -> Option<&'static str> {
    flags.iter().find(|(is_given, _)| *is_given).map(|(_, flag)| *flag)
}

/// The beginnings of keys in files, and the flags for the same values.
const FLAGS: [(&str, &str); 11] = [
    ("units", "--units"),
    ("views.distance", "--distance"),
    ("views.elevation", "--elevation"),
    ("views.azimuth_jitter", "--azimuth-jitter"),
    ("effects.noise.sigma", "--noise"),
    ("effects.dropout", "--dropout"),
    ("effects.quantise", "--quantise"),
    ("effects.weather.rain", "--rain"),
    ("effects.weather.snow", "--snow"),
    ("effects.weather.fog", "--fog"),
    ("effects.weather.haze", "--haze"),
];

/// The error of a value that came from a flag, which names the flag.
pub fn of_flag(InvalidValue { key, cause }: InvalidValue) -> Usage {
    let flag = FLAGS.iter().find(|(beginning, _)| key.starts_with(beginning));
    Usage(format!("{}: {cause}", flag.map_or(&*key, |(_, flag)| flag)))
}

/// That one of several `files` has the same bytes as one before it.
pub fn copy_among(files: &[PathBuf]) -> Result<Option<String>, FormatError> {
    let mut known = HashMap::new();
    for file in files.iter().filter(|_| files.len() > 1) {
        let name = file.display();
        let key = if file.is_file() { hash::of_file(file)? } else { name.to_string() };
        if let Some(first) = known.insert(key, name) {
            return Ok(Some(format!("{}: it has the same bytes as {first}", file.display())));
        }
    }
    Ok(None)
}

/// Prints which numbers of a sensor's profile are odd.
pub fn warn_of_sensor(sensor: &SensorProfile) {
    sensor.warnings().iter().for_each(|warning| program::say!("warning: {warning}"));
}

/// The folder of a dataset, which may be named by its manifest.
pub fn dataset_folder(named: &Path) -> &Path {
    let is_manifest = named.is_file()
        && ["manifest.json", "dataset.json"].iter().any(|name| named.ends_with(name));
    match named.parent().filter(|_| is_manifest) {
        Some(here) if here.as_os_str().is_empty() => Path::new("."),
        Some(folder) => folder,
        None => named,
    }
}

/// Parses a finite number.
pub fn finite(word: &str) -> Result<f64, String> {
    number(word, |x| x.is_finite(), "a finite number")
}

/// Parses a finite number above 0.
pub fn positive(word: &str) -> Result<f64, String> {
    number(word, |x| *x > 0.0 && x.is_finite(), "a finite number above 0")
}

/// Parses an elevation, degrees.
pub fn elevation(word: &str) -> Result<f64, String> {
    number(word, |degrees| (-90.0..=90.0).contains(degrees), "degrees from -90 to 90")
}

/// Parses a probability.
pub fn probability(word: &str) -> Result<f64, String> {
    number(word, |p| (0.0..=1.0).contains(p), "a number from 0 to 1")
}

/// Parses a number that `is_allowed`, as `expected` says.
pub fn number(
    word: &str,
    is_allowed: impl Fn(&f64) -> bool,
    expected: &str,
) -> Result<f64, String> {
    word.parse().ok().filter(is_allowed).ok_or_else(|| format!("expected {expected}"))
}
