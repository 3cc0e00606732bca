//! The studies, each of which ends in a record.

pub mod gpu;
pub mod speed;
pub mod to_disk;
