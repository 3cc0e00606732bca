//! The one command line of an Edgepuck workstation.
fn main() {}
