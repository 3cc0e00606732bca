//! The one crate that every other crate of Edgepuck shares: counter-based
//! random numbers, scans, clouds and packed datasets, and atomic writes.

pub mod rng;
