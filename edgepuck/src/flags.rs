//! Checks and parsers for flags of several commands.

use crate::Usage;

/// Checks that this program can simplify meshes, if that is `wanted`.
pub fn need_simplification(wanted: bool) -> Result<(), Usage> {
    if !wanted || cfg!(feature = "simplify") {
        return Ok(());
    }
    Err(Usage(
        "--simplify: this program was built without mesh simplification; released programs have \
         it, and `cargo install --path edgepuck --features simplify` builds it, which takes a C++ \
         compiler"
            .to_owned(),
    ))
}

/// The first of these flags that was given.
pub fn first_given(flags: &[(bool, &'static str)]) -> Option<&'static str> {
    flags.iter().find(|(is_given, _)| *is_given).map(|(_, flag)| *flag)
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
