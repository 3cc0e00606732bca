//! The library as its users see it, a module for each question.

#![expect(clippy::unwrap_used, reason = "tests")]

mod classifier;
mod flushed;
#[cfg(feature = "live")]
mod live;
mod parity;
#[cfg(feature = "live")]
#[path = "support/street.rs"]
#[allow(dead_code, reason = "the tests of the program use all of it")]
mod street;
#[path = "support/tiny_model.rs"]
mod tiny_model;
mod untrained_model;
