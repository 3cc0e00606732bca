//! Reading TOML files that users write: sensors, poses and scenes.

use std::fmt;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

pub use formats::InvalidValue;
use formats::plausible::{foreign_toml, read_text};
use serde::de::DeserializeOwned;

use formats::mistakes::Mistakes;
pub(crate) use formats::mistakes::{did_you_mean, one_of};

/// The limit of files, beyond any that people write, so that a wrong path (a mesh, a device) does
/// not fill the memory.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// A TOML file could not be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be opened or read.
    #[error("{}: {source}", file.display())]
    Read {
        /// The file as named by the user.
        file: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file is longer than any configuration is.
    #[error("{}: expected a configuration file of at most {} MiB", file.display(), MAX_FILE_BYTES >> 20)]
    TooLong {
        /// The file as named by the user.
        file: PathBuf,
    },
    /// The content cannot be used: its syntax or its values.
    #[error("{}: {message}", file.display())]
    Content {
        /// The file as named by the user.
        file: PathBuf,
        /// All that is wrong, each with its line, key and cause.
        message: String,
    },
    /// A value cannot be used.
    #[error("{}: {invalid}", file.display())]
    Value {
        /// The file as named by the user.
        file: PathBuf,
        /// Key and cause.
        invalid: InvalidValue,
    },
    /// A sensor's name is neither built in nor a file.
    #[error("expected the path of a TOML profile or one of the sensors {known}, found \"{name}\"{}",
        did_you_mean(name, known.split(", ")))]
    UnknownSensor {
        /// The name that was asked for.
        name: String,
        /// All built-in names.
        known: String,
    },
}

impl ConfigError {
    /// The error of a value in `file`.
    #[must_use]
    pub fn value(file: &Path, invalid: InvalidValue) -> Self {
        Self::Value { file: file.to_owned(), invalid }
    }
}

/// All values, or all that is wrong.
pub fn all<T, E: Into<Vec<InvalidValue>>>(
    results: impl IntoIterator<Item = Result<T, E>>,
) -> Result<Vec<T>, Vec<InvalidValue>> {
    let mut wrong = Vec::new();
    let sound =
        results.into_iter().filter_map(|one| one.map_err(|error| wrong.extend(error.into())).ok());
    let sound = sound.collect();
    if wrong.is_empty() { Ok(sound) } else { Err(wrong) }
}

/// Reads `file`, in which a user `expected` such as "a scene", parses it, and makes of it what is wanted by
/// `check`.
///
/// # Errors
/// As [`parse`]'s; a file of another kind.
pub fn read<T: DeserializeOwned, U, E: Into<Vec<InvalidValue>>>(
    file: &Path,
    expected: &str,
    check: impl Fn(T) -> Result<U, E>,
) -> Result<U, ConfigError> {
    let failed = |source| ConfigError::Read { file: file.to_owned(), source };
    let text = read_text(file, MAX_FILE_BYTES + 1).map_err(failed)?;
    if text.len() as u64 > MAX_FILE_BYTES {
        return Err(ConfigError::TooLong { file: file.to_owned() });
    }
    parse(&text, file, check).map_err(|error| match foreign_toml(&text, expected) {
        Some(message) => ConfigError::Content { file: file.to_owned(), message },
        None => error,
    })
}

/// Parses `text`, which is in `file`, and makes of it what is wanted by `check`.
///
/// # Errors
/// All unknown keys, missing keys and values of other types; in a file without these, all that
/// `check` refuses.
pub fn parse<T: DeserializeOwned, U, E: Into<Vec<InvalidValue>>>(
    text: &str,
    file: &Path,
    check: impl Fn(T) -> Result<U, E>,
) -> Result<U, ConfigError> {
    Mistakes::find(text, |value| check(value).map_err(Into::into)).map_err(|mistakes| {
        ConfigError::Content { file: file.to_owned(), message: mistakes.to_string() }
    })
}

/// Checks that `value`, if there is one, is neither infinite nor NaN: TOML can express both.
pub(crate) fn finite(key: &str, value: impl Into<Option<f64>>) -> Result<(), InvalidValue> {
    expect(key, value, format_args!("a finite number"), |_| true)
}

/// Checks that `value`, if there is one, is finite and at least `least`.
pub(crate) fn at_least(
    key: &str,
    value: impl Into<Option<f64>>,
    least: f64,
) -> Result<(), InvalidValue> {
    expect(key, value, format_args!("a number of at least {least}"), |value| value >= least)
}

/// Checks that `value`, if there is one, is finite and above 0.
pub(crate) fn positive(key: &str, value: impl Into<Option<f64>>) -> Result<(), InvalidValue> {
    expect(key, value, format_args!("a number above 0"), |value| value > 0.0)
}

/// Checks that `value`, if there is one, lies in `range`.
pub fn within(
    key: &str,
    value: impl Into<Option<f64>>,
    range: RangeInclusive<f64>,
) -> Result<(), InvalidValue> {
    let (from, to) = (*range.start(), *range.end());
    let expected = format_args!("a number within {from}..={to}");
    expect(key, value, expected, |value| range.contains(&value))
}

fn expect(
    key: &str,
    value: impl Into<Option<f64>>,
    expected: fmt::Arguments<'_>,
    is_fit: impl Fn(f64) -> bool,
) -> Result<(), InvalidValue> {
    match value.into().filter(|&value| !value.is_finite() || !is_fit(value)) {
        None => Ok(()),
        Some(found) => Err(InvalidValue::new(key, format!("expected {expected}, found {found}"))),
    }
}
