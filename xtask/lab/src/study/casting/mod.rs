//! Studies of building and casting.

pub mod scenes;
pub mod speed;
pub mod to_disk;
