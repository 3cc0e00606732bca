//! Walls, fronts of houses, fences and barriers.

mod barrier;
mod fence;
mod house_front;
mod opening;
mod wall;

pub use barrier::build as barrier;
pub use fence::build as fence;
pub use house_front::build as house_front;
pub use wall::build as wall;
