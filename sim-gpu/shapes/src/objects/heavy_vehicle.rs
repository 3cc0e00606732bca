//! Lorries, buses and coaches.

mod bus;
mod cab;
mod cargo;
mod shell;
mod truck;

pub use bus::bus;
pub use truck::truck;
