//! The pointers of C callers, checked as far as possible.
//!
//! A pointer to one object is an `Option` of a reference or a `Box`, which null makes `None`. Rust cannot
//! check how long an array or a text is: the headers state it, and the functions here turn pointers to
//! them into slices, so that all other code is safe.

use std::borrow::Cow;
use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::path::PathBuf;

use crate::status::{EdgepuckStatus, Failure, caught, guard_status, store};

/// The object that the argument called `name` points at, unless it is null.
pub(crate) fn need<T>(pointer: Option<T>, name: &str) -> Result<T, Failure> {
    pointer.ok_or_else(|| bad(name, "a pointer, found null"))
}

/// Writes the address of the object that `make` returns to `out`, an argument of this name, or null if it
/// fails. [`free`] takes the address back.
pub(crate) fn make<T>(
    out: Option<&mut MaybeUninit<Option<Box<T>>>>,
    make: impl FnOnce() -> Result<T, Failure>,
) -> EdgepuckStatus {
    guard_status(|| {
        let out = need(out, "out")?.write(None);
        *out = Some(Box::new(make()?));
        Ok(())
    })
}

/// Drops an object of [`make`]. There is no status to return: a panic leaves its message.
pub(crate) fn free<T>(object: Option<Box<T>>) {
    if let Err(message) = caught(|| drop(object)) {
        store(&message);
    }
}

/// Checks that `pointer`, the argument called `name`, is not null and is aligned for `T`.
pub(crate) fn check<T>(pointer: *const T, name: &str) -> Result<(), Failure> {
    match pointer.is_null() || !pointer.is_aligned() {
        true => Err(bad(name, "an aligned pointer, found a null or misaligned one")),
        false => Ok(()),
    }
}

/// The array of `n` elements at `pointer`, the argument called `name`; null will do if `n` is 0.
///
/// # Safety
/// If it is neither null nor misaligned, `n` elements lie there that nobody changes during `'a`.
pub(crate) unsafe fn slice<'a, T>(
    pointer: *const T,
    n: usize,
    name: &str,
) -> Result<&'a [T], Failure> {
    if n == 0 {
        return Ok(&[]);
    }
    check(pointer, name)?;
    let n_bytes = n.checked_mul(size_of::<T>());
    if n_bytes.is_none_or(|n_bytes| isize::try_from(n_bytes).is_err()) {
        return Err(bad(name, &format!("an array that fits in memory, found {n} elements")));
    }
    // SAFETY: not null, aligned, and not too long for a slice; the header requires `n` elements there.
    Ok(unsafe { std::slice::from_raw_parts(pointer, n) })
}

/// Copies `values` to the buffer at `out`, the argument called `name`, unless it is null.
///
/// # Safety
/// If it is neither null nor misaligned, as many values may be written there, and nobody else uses them
/// now.
pub(crate) unsafe fn write<T: Copy>(values: &[T], out: *mut T, name: &str) -> Result<(), Failure> {
    if out.is_null() {
        return Ok(());
    }
    check(out, name)?;
    // SAFETY: not null and aligned; the header requires room for the values, and C's buffer does not
    // overlap with Rust's slice.
    unsafe { out.copy_from_nonoverlapping(values.as_ptr(), values.len()) };
    Ok(())
}

/// The text at `pointer`, the argument called `name`; bytes that are not UTF-8 are replaced.
///
/// # Safety
/// If it is not null, it is a NUL-terminated string that nobody changes during `'a`.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<Cow<'a, str>, Failure> {
    check(pointer, name)?;
    // SAFETY: not null; the header requires a NUL-terminated string.
    Ok(unsafe { CStr::from_ptr(pointer) }.to_string_lossy())
}

/// The path at `pointer`, the argument called `name`: bytes as they are on Unix, UTF-8 elsewhere.
///
/// # Safety
/// As [`text`].
pub(crate) unsafe fn path(pointer: *const c_char, name: &str) -> Result<PathBuf, Failure> {
    check(pointer, name)?;
    // SAFETY: not null; the header requires a NUL-terminated string.
    let path = unsafe { CStr::from_ptr(pointer) };
    #[cfg(unix)]
    let path: &std::ffi::OsStr = std::os::unix::ffi::OsStrExt::from_bytes(path.to_bytes());
    #[cfg(not(unix))]
    let path = path.to_string_lossy().into_owned();
    Ok(PathBuf::from(path))
}

fn bad(name: &str, expected: &str) -> Failure {
    Failure::new(EdgepuckStatus::BadPointer, format!("expected `{name}` to be {expected}"))
}
