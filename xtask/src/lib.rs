//! What the commands of an Edgepuck workstation are made of.

pub mod preview;
