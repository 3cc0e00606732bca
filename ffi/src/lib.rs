//! What the C interfaces of Edgepuck share: the error of a call as a status and a text, the boundary that
//! stops panics, and the pointers of callers, checked as far as possible.

mod failure;
mod pointers;

pub use failure::{Failure, Status, StatusOf, guard, guard_status, last_error};
pub use pointers::{BadPointer, check, free, make, need, path, slice, text, write};
