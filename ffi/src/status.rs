//! The status of a call, its error message, which is stored per thread, and the boundary that stops panics.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The status of a call. edgepuck_last_error returns a message.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgepuckStatus {
    /// The call succeeded.
    Ok = 0,
    /// A pointer is null, or an array is not aligned for its type or is more than the memory can hold.
    BadPointer = 1,
    /// A value is out of its bounds, an option is one that the model does not support, or an array has
    /// another length than others need.
    BadValue = 2,
    /// The caller's buffers are too short.
    BufferTooSmall = 3,
    /// A defect of this library. What was passed to the call can only be freed.
    Internal = 4,
    /// The model file cannot be read, or is not a model.
    BadModel = 5,
    /// The cloud has no points, too many, or a coordinate that is not finite.
    BadCloud = 6,
    /// No cloud has been classified yet, or the last one could not be classified.
    NoPrediction = 7,
    /// The network's arithmetic leaves the range of float on this cloud.
    Overflow = 8,
    /// This machine lacks instructions or cannot start threads.
    Unsupported = 9,
    /// A mesh cannot be read, has no triangle, a coordinate that is not finite, or an index without
    /// a vertex.
    BadMesh = 10,
    /// There is no such sensor, or its file cannot be read.
    BadSensor = 11,
    /// The text of effects is wrong, or the sensor's profile lacks a value that they need.
    BadEffects = 12,
    /// An instance belongs to another scene.
    BadInstance = 13,
    /// A pose is not finite, or its quaternion is not a rotation.
    BadPose = 14,
}

/// The library's version, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// The error message of the last failed call of this thread; empty if no call has failed. A
/// successful call does not change it.
///
/// The text is UTF-8, and valid until another call of this thread fails.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_last_error() -> *const c_char {
    // A thread that is ending no longer has a message.
    LAST_ERROR.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// The error of a call: its status, and the message for [`edgepuck_last_error`].
#[derive(Debug)]
pub(crate) struct Failure {
    status: EdgepuckStatus,
    message: String,
}

impl Failure {
    pub(crate) fn new(status: EdgepuckStatus, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }

    /// Gives an error this `status`, for `map_err`.
    pub(crate) fn of<E: Display>(status: EdgepuckStatus) -> impl FnOnce(E) -> Self {
        move |error| Self::new(status, error.to_string())
    }
}

/// Returns the result of `call`, or a status and stores the message for [`edgepuck_last_error`]. Catches
/// panics.
///
/// After a panic, values may be half-changed but remain sound: they can still be freed.
pub(crate) fn guard<T>(call: impl FnOnce() -> Result<T, Failure>) -> Result<T, EdgepuckStatus> {
    let failure = match caught(call) {
        Ok(Ok(value)) => return Ok(value),
        Ok(Err(failure)) => failure,
        Err(message) => Failure::new(EdgepuckStatus::Internal, message),
    };
    store(&failure.message);
    Err(failure.status)
}

/// [`guard`] for a call that returns only a status.
pub(crate) fn guard_status(call: impl FnOnce() -> Result<(), Failure>) -> EdgepuckStatus {
    guard(call).err().unwrap_or(EdgepuckStatus::Ok)
}

/// The result of `call`, or the message of its panic.
pub(crate) fn caught<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(call))
        .map_err(|payload| format!("a defect in edgepuck: {}", message_of(&*payload)))
}

/// Stores a message for [`edgepuck_last_error`].
pub(crate) fn store(message: &str) {
    let text = CString::new(message.replace('\0', "\u{fffd}")).unwrap_or_default();
    // A thread that is ending cannot store a message, and no longer needs it.
    let _ = LAST_ERROR.try_with(|last| last.replace(text));
}

fn message_of(payload: &(dyn Any + Send)) -> &str {
    let literal = payload.downcast_ref::<&str>().copied();
    literal.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic")
}

#[cfg(test)]
mod tests {
    use std::ffi::CStr;

    use super::*;

    fn last() -> String {
        // SAFETY: `LAST_ERROR` is a `CString`, which no call replaces in between.
        let text = unsafe { CStr::from_ptr(edgepuck_last_error()) };
        text.to_str().unwrap().to_owned()
    }

    #[test]
    fn a_panic_becomes_a_status_and_a_message() {
        for text in ["broken", "broken too"] {
            assert_eq!(guard_status(|| panic!("{text}")), EdgepuckStatus::Internal);
            assert_eq!(last(), format!("a defect in edgepuck: {text}"));
        }
    }

    #[test]
    fn the_last_error_is_that_of_the_thread_and_outlives_success() {
        assert_eq!(last(), "");
        let bad = EdgepuckStatus::BadPointer;
        assert_eq!(guard_status(|| Err(Failure::new(bad, "null"))), bad);
        assert_eq!(guard_status(|| Ok(())), EdgepuckStatus::Ok);
        assert_eq!(last(), "null");
        std::thread::spawn(|| assert_eq!(last(), "")).join().unwrap();
    }

    #[test]
    fn a_message_keeps_what_follows_a_nul() {
        guard_status(|| Err(Failure::new(EdgepuckStatus::Internal, "a\0b")));
        assert_eq!(last(), "a\u{fffd}b");
    }
}
