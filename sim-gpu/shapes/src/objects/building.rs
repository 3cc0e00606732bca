pub mod barrier;
pub mod fence;
pub mod house_front;
mod opening;
pub mod wall;
