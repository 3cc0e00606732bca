//! Errors, which are stored per thread, and the boundary that stops panics.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use infer_cpu::Error;
use infer_cpu::sampler::SamplerError;

use crate::status::EdgepuckStatus;

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// The error of a call: its status, and the message for [`edgepuck_last_error`].
#[derive(Debug)]
pub struct Failure {
    status: EdgepuckStatus,
    message: String,
}

impl Failure {
    /// A failure with `status`.
    pub fn new(status: EdgepuckStatus, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::new(status_of(&error), error.to_string())
    }
}

fn status_of(error: &Error) -> EdgepuckStatus {
    match error {
        Error::Format(_) => EdgepuckStatus::BadModel,
        Error::NoPoints
        | Error::NotFinite { .. }
        | Error::TooManyPoints(_)
        | Error::Sampler(SamplerError::TooManyPoints(_)) => EdgepuckStatus::BadCloud,
        Error::KernelMissing(_) | Error::KernelPrecision { .. } | Error::Threads { .. } => {
            EdgepuckStatus::Unsupported
        }
        Error::Overflow => EdgepuckStatus::Overflow,
        Error::Sampler(_)
        | Error::FrontMissing { .. }
        | Error::VotesWithoutDraws(_)
        | Error::TooManyThreads(_)
        | Error::TooMuchRoom(_) => EdgepuckStatus::BadOption,
        // Errors of functions that this interface does not have.
        _ => EdgepuckStatus::Internal,
    }
}

/// Returns the result of `call`, or a status and stores the message for [`edgepuck_last_error`].
/// Catches panics.
///
/// After a panic, values may be half-changed but remain sound: a classifier can still be freed.
pub fn guard<T>(call: impl FnOnce() -> Result<T, Failure>) -> Result<T, EdgepuckStatus> {
    let failure = match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(value)) => return Ok(value),
        Ok(Err(failure)) => failure,
        Err(payload) => {
            let message = format!("a defect in edgepuck: {}", message_of(&*payload));
            Failure::new(EdgepuckStatus::Internal, message)
        }
    };
    let text = CString::new(failure.message.replace('\0', "\u{fffd}")).unwrap_or_default();
    // A thread that is ending cannot store a message, and no longer needs it.
    let _ = LAST_ERROR.try_with(|last| last.replace(text));
    Err(failure.status)
}

/// [`guard`] for a call that returns only a status.
pub fn guard_status(call: impl FnOnce() -> Result<(), Failure>) -> EdgepuckStatus {
    guard(call).err().unwrap_or(EdgepuckStatus::Ok)
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

fn message_of(payload: &(dyn Any + Send)) -> &str {
    let literal = payload.downcast_ref::<&str>().copied();
    literal.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic")
}

#[cfg(test)]
mod tests {
    use std::ffi::CStr;
    use std::ptr::null;

    use super::*;

    fn last_error() -> String {
        // SAFETY: `LAST_ERROR` is a `CString`, which no call replaces in between.
        let text = unsafe { CStr::from_ptr(edgepuck_last_error()) };
        text.to_str().unwrap().to_owned()
    }

    #[test]
    fn a_panic_becomes_a_status_and_a_message() {
        for text in ["broken", "broken too"] {
            let status = guard_status(|| panic!("{text}"));
            assert_eq!(status, EdgepuckStatus::Internal);
            assert_eq!(last_error(), format!("a defect in edgepuck: {text}"));
        }
    }

    #[test]
    fn the_last_error_is_that_of_the_thread_and_outlives_success() {
        assert_eq!(last_error(), "");
        let status = guard_status(|| crate::pointers::check(null::<u8>(), "here"));
        assert_eq!(status, EdgepuckStatus::BadPointer);
        assert_eq!(guard_status(|| Ok(())), EdgepuckStatus::Ok);
        assert_eq!(
            last_error(),
            "expected `here` to be an aligned pointer, found a null or misaligned one"
        );
        std::thread::spawn(|| assert_eq!(last_error(), "")).join().unwrap();
    }

    #[test]
    fn a_message_keeps_what_follows_a_nul() {
        guard_status(|| Err(Failure::new(EdgepuckStatus::Internal, "a\0b")));
        assert_eq!(last_error(), "a\u{fffd}b");
    }
}
