//! The C interface of Edgepuck, `include/edgepuck.h`: functions that take pointers, check them, and return
//! a status. The feature `classify` has the functions of `infer-cpu`, `scan` those of `sim-gpu`.
//!
//! Doc comments here are for readers of that header, which is generated from them.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]
#![expect(unsafe_code, reason = "callers in C pass pointers; every block says why it is sound")]

#[cfg(feature = "classify")]
mod classify;
mod pointers;
#[cfg(feature = "scan")]
mod scan;
mod status;

#[cfg(feature = "classify")]
pub use classify::*;
#[cfg(feature = "scan")]
pub use scan::*;
pub use status::*;
