//! What the tests across crates share, and `edgepuck-lab` with them. Whatever keeps a test from
//! going on is a panic.

pub mod adapter;
pub mod adversarial;
pub mod casting;
pub mod effects;
pub mod judge;
pub mod meshes;
pub mod random;
pub mod shared_data;
pub mod tree;
pub mod written_dataset;
