//! Errors, which are stored per thread, and the boundary that stops panics.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// The statuses of an interface: an enum for C.
pub trait Status: Copy {
    /// The call succeeded.
    const OK: Self;
    /// A pointer is null, not aligned for its type, or to more than the memory holds.
    const BAD_POINTER: Self;
    /// A defect of the library.
    const INTERNAL: Self;
}

/// The status of errors `E`, which `?` then turns into a [`Failure`].
pub trait StatusOf<E>: Status {
    /// The status of `error`.
    fn of(error: &E) -> Self;
}

/// The error of a call: its status, and the message for [`last_error`].
#[derive(Debug)]
pub struct Failure<S> {
    status: S,
    message: String,
}

impl<S> Failure<S> {
    /// A failure with `status`.
    pub fn new(status: S, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }

    /// Gives an error this `status`, for `map_err`.
    pub fn of<E: Display>(status: S) -> impl FnOnce(E) -> Self {
        |error| Self::new(status, error.to_string())
    }
}

impl<S: StatusOf<E>, E: std::error::Error> From<E> for Failure<S> {
    fn from(error: E) -> Self {
        Self::new(S::of(&error), error.to_string())
    }
}

/// Returns the result of `call`, or a status and stores the message for [`last_error`]. Catches panics.
///
/// After a panic, values may be half-changed but remain sound: they can still be freed.
pub fn guard<T, S: Status>(call: impl FnOnce() -> Result<T, Failure<S>>) -> Result<T, S> {
    let failure = match caught(call) {
        Ok(Ok(value)) => return Ok(value),
        Ok(Err(failure)) => failure,
        Err(message) => Failure::new(S::INTERNAL, message),
    };
    store(&failure.message);
    Err(failure.status)
}

/// [`guard`] for a call that returns only a status.
pub fn guard_status<S: Status>(call: impl FnOnce() -> Result<(), Failure<S>>) -> S {
    guard(call).err().unwrap_or(S::OK)
}

/// The error message of the last failed call of this thread, UTF-8; empty if no call has failed. It is
/// valid until another call of this thread fails.
pub fn last_error() -> *const c_char {
    // A thread that is ending no longer has a message.
    LAST_ERROR.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

/// The result of `call`, or the message of its panic.
pub(crate) fn caught<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(call))
        .map_err(|payload| format!("a defect in edgepuck: {}", message_of(&*payload)))
}

/// Stores a message for [`last_error`].
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

    impl Status for u8 {
        const OK: Self = 0;
        const BAD_POINTER: Self = 1;
        const INTERNAL: Self = 2;
    }

    fn last() -> String {
        // SAFETY: `LAST_ERROR` is a `CString`, which no call replaces in between.
        let text = unsafe { CStr::from_ptr(last_error()) };
        text.to_str().unwrap().to_owned()
    }

    #[test]
    fn a_panic_becomes_a_status_and_a_message() {
        for text in ["broken", "broken too"] {
            assert_eq!(guard_status::<u8>(|| panic!("{text}")), u8::INTERNAL);
            assert_eq!(last(), format!("a defect in edgepuck: {text}"));
        }
    }

    #[test]
    fn the_last_error_is_that_of_the_thread_and_outlives_success() {
        assert_eq!(last(), "");
        assert_eq!(
            guard_status::<u8>(|| Err(Failure::new(u8::BAD_POINTER, "null"))),
            u8::BAD_POINTER
        );
        assert_eq!(guard_status::<u8>(|| Ok(())), u8::OK);
        assert_eq!(last(), "null");
        std::thread::spawn(|| assert_eq!(last(), "")).join().unwrap();
    }

    #[test]
    fn a_message_keeps_what_follows_a_nul() {
        guard_status(|| Err(Failure::new(u8::INTERNAL, "a\0b")));
        assert_eq!(last(), "a\u{fffd}b");
    }
}
