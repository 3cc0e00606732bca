//! What the tests across crates share.

pub mod adapter;
pub mod casting;
pub mod judge;
pub mod meshes;
pub mod random;
pub mod shared_data;
pub mod written_dataset;
