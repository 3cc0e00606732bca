//! Studies of building and casting.

pub mod builders;
pub mod scenes;
pub mod simplify;
pub mod speed;
pub mod to_disk;
pub mod watertightness;
