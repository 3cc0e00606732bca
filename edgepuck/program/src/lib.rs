//! What Edgepuck's programs share: exit codes and error messages ([`outcome`]), numbers as they print them
//! ([`significant_digits`]), and the rule for
//! outputs that exist already ([`outputs`]).

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod outcome;
pub mod outputs;
pub mod significant_digits;

pub use outcome::{Outcome, Usage};
