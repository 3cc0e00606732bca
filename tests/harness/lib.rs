//! What the tests across crates share. Whatever keeps a test from going on is a panic.

pub mod adapter;
pub mod casting;
pub mod judge;
pub mod meshes;
pub mod random;
pub mod shared_data;
pub mod tree;
pub mod written_dataset;
