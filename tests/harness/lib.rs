//! What the tests across crates share.

pub mod written_dataset;
