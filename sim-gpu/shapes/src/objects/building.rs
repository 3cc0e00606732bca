//! Walls, fronts of houses, fences and barriers.

pub mod barrier;
pub mod fence;
pub mod house_front;
mod opening;
pub mod wall;
