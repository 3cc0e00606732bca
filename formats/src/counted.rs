//! Numbers of things in messages.

use std::fmt::Display;

/// `1 mesh`, `2 meshes`.
#[must_use]
pub fn counted<N: Display + PartialEq + From<u8>>(n: N, noun: &str) -> String {
    let ending = match noun {
        _ if n == 1.into() => "",
        _ if noun.ends_with(['h', 's', 'x']) => "es",
        _ => "s",
    };
    format!("{n} {noun}{ending}")
}
