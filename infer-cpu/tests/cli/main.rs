//! The program: its output, errors and exit codes.

#![expect(clippy::unwrap_used, reason = "tests")]

mod classify;
mod extremes;
mod inspect;
#[cfg(feature = "mcap")]
mod live;
mod models;
mod program;
#[cfg(feature = "mcap")]
mod recordings;
mod said;
mod sample;
#[cfg(feature = "mcap")]
#[path = "../support/street.rs"]
#[allow(dead_code, reason = "the tests of the library use all of it")]
mod street;
#[path = "../support/tiny_model.rs"]
mod tiny_model;
