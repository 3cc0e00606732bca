pub mod bus;
mod cab;
mod cargo;
mod shell;
pub mod truck;
