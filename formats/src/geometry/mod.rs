//! Poses of sensors and things, alone and over time, and boxes around things.

mod fit;
mod oriented_box;
#[cfg(feature = "poses")]
mod pose;
#[cfg(feature = "poses")]
mod trajectory;

pub use oriented_box::OrientedBox;
#[cfg(feature = "poses")]
pub use pose::Pose;
#[cfg(feature = "poses")]
pub use trajectory::Trajectory;
